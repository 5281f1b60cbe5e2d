"""`rtshcua explain` knows every finding that `verify-log` may print."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import rtshcua
from reference.forgery import flight
from reference.verifiers import ROOT_KEY
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.note import _PARTS
from rtshcua.evidence.records import DECIDED
from rtshcua.front.cli.app import main
from rtshcua.front.cli.render import log_slugs
from rtshcua.front.cli.render.verdict import MEANINGS
from rtshcua.wire.untrusted import Untrusted

PACKAGE = Path(rtshcua.__file__).parent
#: the modules that make findings about logs
MAKERS = ("evidence", "ground/audit", "adapters/archive", "app", "front/cli")
#: slugs of `verify-proof`, and of notes within other artefacts
OTHERS = ("proof/", "note/")
#: prefixes whose remainder is the slug of a refusal by `wire` or by a session
REFUSE = ("wire", "decision/session.py")
SLUG = re.compile("[a-z]+(-[a-z]+)*")
#: of keys on the disk, of streams, and of the archive
NEVER_OF_A_LOG = {"memory", "passphrase-needed", "unencrypted", "wrong-passphrase"}


def calls(places: tuple[str, ...]) -> Iterator[ast.Call]:
    for place in places:
        path = PACKAGE / place
        for file in path.rglob("*.py") if path.is_dir() else [path]:
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                    yield node


def first_text(call: ast.Call) -> str | None:
    value = call.args[0] if call.args else None
    return value.value if isinstance(value, ast.Constant) and isinstance(value.value, str) else None


def literal_slugs() -> set[str]:
    found = {first_text(call) for call in calls(MAKERS) if call.func.id in ("Flaw", "Finding")}  # type: ignore[attr-defined]
    return {slug for slug in found if slug and not slug.startswith(OTHERS)}


def refused_slugs() -> set[str]:
    """The slugs with which a signed artefact may be refused."""
    named = ("Error", "Untrusted")
    found = {first_text(call) for call in calls(REFUSE) if call.func.id.endswith(named)}  # type: ignore[attr-defined]
    return {slug for slug in found if slug is not None and SLUG.fullmatch(slug)}


def documented_slugs() -> set[str]:
    """The slugs that the docstrings of `wire` errors list."""
    found: set[str] = set()
    for error in Untrusted.__subclasses__():
        if error.__module__.startswith("rtshcua.wire."):
            found |= {slug for slug in re.findall("`([a-z-]+)`", error.__doc__ or "") if "-" in slug}
    return found


@pytest.mark.slow
def test_every_finding_that_is_written_down_is_explained() -> None:
    assert len(literal_slugs()) > 80
    assert [slug for slug in sorted(literal_slugs()) if log_slugs.find(slug) is None] == []
    parts = {f"seal/{part}" for part in _PARTS.values()}
    fields = {f"decision/{field.replace('_', '-')}" for field in DECIDED}
    assert [slug for slug in sorted(parts | fields) if log_slugs.find(slug) is None] == []


def test_every_refusal_of_something_signed_is_explained() -> None:
    refused = (refused_slugs() | documented_slugs()) - NEVER_OF_A_LOG
    assert len(refused) > 30
    kinds = ("document/", "boundary/", "trust/root-", "trust/bundle-")
    assert [slug for slug in sorted(refused) for kind in kinds if log_slugs.find(kind + slug) is None] == []


@pytest.mark.slow
def test_explained_slugs_exist() -> None:
    """An explanation of a removed slug would mislead."""
    written = literal_slugs() | {f"seal/{part}" for part in _PARTS.values()} | {"boundary/frames", "boundary/clock"}
    written |= {f"decision/{field.replace('_', '-')}" for field in DECIDED} | {"trust/revoked-key"}
    assert {slug for slug in log_slugs._FOUND if slug not in written} == set()


def test_each_slug_has_a_meaning_and_an_exit_code() -> None:
    for slug in log_slugs.every():
        found = log_slugs.find(slug)
        assert found is not None
        assert found.meaning, slug
        assert found.exit_code is not ExitCode.OK
        assert slug.partition("/")[0] in {*MEANINGS, "archive"}


@pytest.mark.parametrize(
    ("word", "code"), [("seal/missing", 9), ("SEAL/MISSING", 9), ("close/junk-after", 9), ("boundary/lost", 10),
                       ("trust/root-unknown-key", 4), ("document/expired", 11), ("anchor/root", 12)],
)  # fmt: skip
def test_explain_prints_the_meaning_of_a_slug(
    word: str, code: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS")
    assert main(["explain", word]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"{word.lower()}: ")
    assert f"exit code {code}: " in text
    assert max(map(len, text.splitlines())) <= 80
    assert main(["explain", word, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["exit_code"] == code


def test_unknown_slug_suggests_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "seal/mising"]) == 2
    assert "did you mean `seal/missing`?" in capsys.readouterr().err


def test_zeros_after_a_closed_log_are_recognised(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file system may pad the file after a power cut; the finding does not suggest forgery, and says what to do."""
    whole = b"".join(flight())
    path = tmp_path / "log.jsonl"
    path.write_bytes(whole + bytes(4096))
    assert main(["verify-log", str(path), "--root", ROOT_KEY.hex()]) == ExitCode.EVIDENCE
    out = " ".join(capsys.readouterr().out.split())
    assert "close/junk-after" in out
    assert "4096 zero octets, as a file system leaves them after a power cut" in out
    assert "before it is valid and complete" in out
    assert "forged" not in out
    assert f"begins at byte {len(whole)} of the log" in out
    path.write_bytes(path.read_bytes()[: len(whole)])
    assert main(["verify-log", str(path), "--root", ROOT_KEY.hex()]) == ExitCode.OK
