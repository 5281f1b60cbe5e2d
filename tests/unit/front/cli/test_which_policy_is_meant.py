"""`compile --with` a file that declares a policy which the mission imports: the message names the one used."""

import json
from pathlib import Path

import pytest

from rtshcua.front.cli import app

CHECKOUT = Path(__file__).resolve().parents[4]
POLICY = CHECKOUT / "policies/bridge_inspection.rts"


@pytest.mark.parametrize("changed", [False, True])
def test_a_copy_of_a_shipped_policy(
    changed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = POLICY.read_text(encoding="utf-8")
    Path("mine.rts").write_text(text.replace("altitude <= 30 m", "altitude <= 20 m") if changed else text, "utf-8")
    Path("proposal.json").write_bytes((CHECKOUT / "missions/proposal.json").read_bytes())
    assert app.main(["compile", "proposal.json", "--with", "mine.rts", "-o", "made.bundle", "--json"]) == 1
    (found,) = json.loads(capsys.readouterr().out)["diagnostics"]
    assert found["code"] == "E0202"
    assert ("is a copy of" in found["help"]) is not changed
    assert "leave out `--with mine.rts`" in found["help"]
    assert "the imports of `proposal.json`" in found["help"]


def test_missing_name_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.rts").write_text(
        'import "lib:policies/site.rts" import "lib:skills/return_home.rts" import "lib:skills/emergency_land.rts"\n'
        "policy p version 1 { permit fly by role operator forbid fly by any when battery < 9 %\n"
        "degrade fly when battery < 10 % to return_home permit return_home, emergency_land by any\n"
        "contingency return_home, emergency_land }",
        "utf-8",
    )
    assert app.main(["check", "a.rts"]) == 1
    told = "".join(capsys.readouterr())
    assert "`fly` is not declared; expected a skill (3 places)" in told
    assert "1 error" in told
