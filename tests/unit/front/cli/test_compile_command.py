"""`rtshcua compile`, `check` and `schema`, called by a person, a script and an agent."""

import json
import os
import shutil
from pathlib import Path

import jsonschema
import pytest

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.wire.keys import Duty
from rtshcua.wire.trust import open_root

AT = ["--at", "2026-01-31T08:00:00Z"]


@pytest.fixture(autouse=True)
def keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "init"]) == ExitCode.OK
    capsys.readouterr()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def proposal(checkout: Path) -> str:
    return (checkout / "missions" / "proposal.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["short.rts", "standard.rts", "extended.rts", "proposal.json"])
def test_shipped_missions_compile_reproducibly(checkout: Path, tmp_path: Path, name: str) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    under = ["--policy", "bridge_inspection@7"] if name.endswith(".json") else []
    for target in (first, second):
        assert main(["compile", str(checkout / "missions" / name), "-o", str(target), *AT, *under]) == ExitCode.OK
    assert first.read_bytes() == second.read_bytes()


def test_a_copied_mission_compiles_to_the_same_bytes_elsewhere(checkout: Path, here: Path) -> None:
    for folder in (here / "one", here / "two" / "deep"):
        folder.mkdir(parents=True)
        (folder / "short.rts").write_bytes((checkout / "missions" / "short.rts").read_bytes())
    assert main(["compile", "one/short.rts", "-o", "first", *AT]) == ExitCode.OK
    assert main(["compile", str(here / "two" / "deep" / "short.rts"), "-o", "second", *AT]) == ExitCode.OK
    assert (here / "first").read_bytes() == (here / "second").read_bytes()


def test_another_time_of_issue_gives_another_bundle(checkout: Path, here: Path) -> None:
    source = str(checkout / "missions" / "short.rts")
    assert main(["compile", source, "-o", "a", *AT]) == ExitCode.OK
    assert main(["compile", source, "-o", "b", "--at", "2026-01-31T08:00:01Z"]) == ExitCode.OK
    assert (here / "a").read_bytes() != (here / "b").read_bytes()


def test_a_refusal_names_clause_argument_and_nearest_value(
    checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (checkout / "missions" / "standard.rts").read_text(encoding="utf-8")
    (here / "high.rts").write_text(
        text.replace("inspect_area(bridge_a, altitude = 20 m)", "inspect_area(bridge_a, altitude = 35 m)"),
        encoding="utf-8",
    )
    assert main(["compile", "high.rts"]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr()
    assert said.out == ""
    assert "error[E0703]" in said.err
    assert "high.rts:13:" in said.err
    assert "nearest accepted: `altitude = 30 m`" in said.err
    assert names(here) == ["high.rts"]


def test_an_agent_repairs_its_proposal_from_the_answer_alone(
    checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The intended use of the JSON answer: follow each pointer, insert an accepted value, and propose again."""
    wrong = json.loads(proposal(checkout))
    wrong["phases"][1]["steps"][1]["arguments"]["altitude"] = "35 m"
    (here / "p.json").write_text(json.dumps(wrong), encoding="utf-8")
    assert main(["compile", "p.json", "--json", "--policy", "bridge_inspection"]) == ExitCode.DIAGNOSTICS
    answer = json.loads(capsys.readouterr().out)
    assert answer["exit"] == "diagnostics"
    (found,) = answer["diagnostics"]
    assert (found["code"], found["pointer"]) == ("E0703", "/phases/1/steps/1/arguments/altitude")
    value = found["help"].split("`")[1].split(" = ")[1]
    *way, last = found["pointer"].strip("/").split("/")
    place = wrong
    for word in way:
        place = place[int(word)] if isinstance(place, list) else place[word]
    place[last] = value
    (here / "p.json").write_text(json.dumps(wrong), encoding="utf-8")
    assert main(["compile", "p.json", "--json", "--policy", "bridge_inspection"]) == ExitCode.OK
    answer = json.loads(capsys.readouterr().out)
    assert answer["diagnostics"] == []
    assert answer["bundle"]["steps"] == 4


def test_the_policy_of_a_proposal_may_be_named_by_whoever_compiles(checkout: Path, here: Path) -> None:
    without = json.loads(proposal(checkout))
    del without["imports"]
    (here / "p.json").write_text(json.dumps(without), encoding="utf-8")
    assert main(["compile", "p.json"]) == ExitCode.DIAGNOSTICS
    policy = str(checkout / "policies" / "bridge_inspection.rts")
    assert main(["compile", "p.json", "--with", policy]) == ExitCode.OK


def test_schema_is_valid_and_accepts_shipped_missions(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == ExitCode.OK
    schema = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    assert validator.is_valid(json.loads(proposal(checkout)))
    assert not validator.is_valid({**json.loads(proposal(checkout)), "surplus": 1})


@pytest.mark.parametrize(
    ("content", "name", "code"),
    [
        (b"", "empty.rts", ExitCode.DIAGNOSTICS),
        (b"\0\1\2\xff" * 100, "binary.rts", ExitCode.DIAGNOSTICS),
        (b"mission {" * 50, "nonsense.rts", ExitCode.DIAGNOSTICS),
        (b"(" * 100_000, "deep.rts", ExitCode.DIAGNOSTICS),
        (b"[" * 100_000, "deep.json", ExitCode.DIAGNOSTICS),
        (b"{", "cut.json", ExitCode.DIAGNOSTICS),
        (b"\xff\xfe", "utf16.json", ExitCode.DIAGNOSTICS),
        (b"//" + b"x" * (9 << 20), "huge.rts", ExitCode.INPUT),
    ],
)
def test_sources_that_are_none(
    here: Path, capsys: pytest.CaptureFixture[str], content: bytes, name: str, code: ExitCode
) -> None:
    (here / name).write_bytes(content)
    assert main(["compile", name]) == code
    said = capsys.readouterr()
    assert "error[E" in said.err
    assert "Traceback" not in said.err
    assert names(here) == [name]


def test_a_missing_source(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile", "nowhere.rts"]) == ExitCode.INPUT
    assert main(["check", "nowhere.rts"]) == ExitCode.INPUT
    assert "nowhere.rts" in capsys.readouterr().err


@pytest.mark.parametrize("target", ["source.rts", ".", "/dev/null", "nowhere/x.bundle"])
def test_bundle_does_not_replace_other_files(checkout: Path, here: Path, target: str) -> None:
    source = (checkout / "missions" / "short.rts").read_bytes()
    (here / "source.rts").write_bytes(source)
    assert main(["compile", "source.rts", "-o", target]) in {ExitCode.USAGE, ExitCode.INPUT}
    assert (here / "source.rts").read_bytes() == source
    assert names(here) == ["source.rts"]
    assert Path("/dev/null").is_char_device()


def test_a_key_of_the_wrong_duty_signs_nothing(checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = Path(os.environ["RTSHCUA_DATA_DIR"]) / "keys" / "mission-agent.key"
    words = ["compile", str(checkout / "missions" / "short.rts"), "-o", "x", "--policy-key", str(key)]
    assert main(words) == ExitCode.UNTRUSTED
    assert "the key is for `mission`, not for `policy`" in capsys.readouterr().err
    assert main([*words, "--json"]) == ExitCode.UNTRUSTED
    assert json.loads(capsys.readouterr().out)["error"]["slug"] == "wrong-duty"
    assert names(here) == []


def test_without_keys_there_is_a_way_on(
    checkout: Path, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(here / "none"))
    assert main(["compile", str(checkout / "missions" / "short.rts"), "-o", "x"]) == ExitCode.UNTRUSTED
    assert "rtshcua keys init" in capsys.readouterr().err


@pytest.mark.parametrize("moment", ["yesterday", "2026-01-31", "2026-01-31T08:00:00", ""])
def test_invalid_time_of_issue_is_refused(checkout: Path, here: Path, moment: str) -> None:
    assert main(["compile", str(checkout / "missions" / "short.rts"), "--at", moment]) == ExitCode.USAGE


def test_a_mission_that_the_source_does_not_have(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["compile", str(checkout / "missions" / "short.rts"), "--mission", "shor"]
    assert main(words) == ExitCode.DIAGNOSTICS
    assert "short" in capsys.readouterr().err


def test_check_needs_no_keys_and_writes_nothing(
    checkout: Path, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(here / "none"))
    sources = sorted(
        str(path) for name in ("skills", "policies", "missions") for path in (checkout / name).glob("*.rts")
    )
    assert main(["check", *sources, "--deny-warnings"]) == ExitCode.OK
    assert capsys.readouterr().err == ""
    assert main(["check", sources[0], "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["diagnostics"] == []
    assert names(here) == []


def test_the_key_of_the_store_that_may_sign_a_mission_signs_it(
    checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Keys of `keys init` are for operators only; if no key may sign, the error names the command that makes one."""
    text = """import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
role technician
policy shift version 1 {
  permit takeoff by role technician through agent
  permit return_home, emergency_land by any
  airspace inside city
  contingency return_home, emergency_land
}
mission lift under shift@1 on quad {
  proposed by agent openclaw for role technician
  phase departure { takeoff(altitude = 20 m) }
  phase recovery { return_home() }
}
"""
    (here / "lift.rts").write_text(text, encoding="utf-8")
    assert main(["compile", "lift.rts", *AT]) == ExitCode.UNTRUSTED
    assert (
        "`rtshcua keys mission agent --role technician --policy shift` makes a key that may" in capsys.readouterr().err
    )
    assert main(["keys", "mission", "agent", "--role", "technician", "--policy", "shift"]) == ExitCode.OK
    assert main(["compile", "lift.rts", *AT]) == ExitCode.OK
    source = str(checkout / "missions" / "short.rts")
    assert main(["compile", source, "-o", "short.bundle", *AT]) == ExitCode.OK


@pytest.mark.parametrize("named", [".", "..", "made", "made.bundle"])
def test_folder_or_bundle_as_source_is_refused(
    named: str, checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "made").mkdir()
    assert main(["compile", str(checkout / "missions" / "short.rts"), "-o", "made.bundle", *AT]) == ExitCode.OK
    kept = (here / "made.bundle").read_bytes()
    capsys.readouterr()
    for output in ([], ["-o", "other"]):
        expected = ExitCode.USAGE if named == "made.bundle" else ExitCode.INPUT
        assert main(["compile", named, *output, *AT]) == expected
        what = "bundle" if named == "made.bundle" else "folder"
        assert capsys.readouterr().err.partition("]: ")[2].startswith(f"`{named}` is a {what}, and no source\n help: ")
    assert ((here / "made.bundle").read_bytes(), names(here)) == (kept, ["made", "made.bundle"])


def test_readable_key_is_refused_with_a_remedy(checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = here / "policy.key"
    shutil.copy(KeyStore(data_folder()).folder / "policy.key", key)
    key.chmod(0o644)
    source = str(checkout / "missions" / "short.rts")
    assert main(["compile", source, "-o", "made", "--policy-key", str(key), *AT]) == ExitCode.UNTRUSTED
    assert "its mode is 0644\n help: `chmod 600` it; " in capsys.readouterr().err


def test_a_slip_in_an_option_is_not_blamed_on_the_file(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = str(checkout / "missions" / "proposal.json")
    for named, text, help in (
        ("bridge_inspectoin", "`bridge_inspectoin`", "did you mean `--policy bridge_inspection`?"),
        ("bridge_inspection@8", "`bridge_inspection@8`", "`bridge_inspection@7`"),
        ("zzz", "`zzz`", "the sources declare `bridge_inspection`"),
    ):
        assert main(["compile", source, "--policy", named, "--json"]) == ExitCode.USAGE
        error = json.loads(capsys.readouterr().out)["error"]
        assert error["slug"] == "usage"
        assert f"no policy {text}" in str(error)
        assert help in error["help"]


def test_unreadable_import_is_reported_before_a_missing_policy(here: Path, checkout: Path) -> None:
    text = proposal(checkout).replace("lib:policies/bridge_inspection.rts", "lib:policies/none.rts")
    (here / "spec.json").write_text(text, encoding="utf-8")
    assert main(["compile", "spec.json", "--policy", "bridge_inspection"]) == ExitCode.DIAGNOSTICS


def test_a_key_of_another_root_is_warned_of(
    checkout: Path, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bundle is signed, because the vehicle may have that root; the warning comes before `run` refuses it."""
    own = data_folder()
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(here / "other"))
    assert main(["keys", "init"]) == ExitCode.OK
    other = KeyStore(data_folder())
    (theirs,) = {other.signing_key(Duty.MISSION, whose="operator").kid}
    path = other.paths(open_root(other.root(), pinned=other.pin(), now_us=0))[theirs]
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(own))
    capsys.readouterr()
    source = [str(checkout / "missions" / "short.rts"), "-o", "a", *AT]
    assert main(["compile", *source]) == ExitCode.OK
    assert capsys.readouterr().err == ""
    assert main(["compile", *source, "--mission-key", str(path), "--json"]) == ExitCode.OK
    said = capsys.readouterr()
    (warning,) = json.loads(said.out)["warnings"]
    assert f"does not name this mission key: {theirs.hex()}" in warning
    assert said.err.startswith("warning: the trust root of this key store")
    assert main(["compile", *source, "--mission-key", str(path), "--deny-warnings"]) == ExitCode.UNTRUSTED
