"""`rtshcua verify-log`: output and exit codes."""

import hashlib
import json
import os
import re
import shutil
from pathlib import Path

import pytest

from reference.forgery import edit, flight, signed
from reference.marked import mark, note_of
from rtshcua.adapters.store import logs
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.logs import report_code
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.front.cli import app
from rtshcua.front.cli.render import progress, verdict
from rtshcua.wire.keys import Duty
from rtshcua.wire.names import LOG
from virtual import case
from virtual.rows import rows

ROOT = case.KEYS[Duty.ROOT]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The folder of a run, with its log and its bundle; there is no telemetry in virtual time."""
    folder = tmp_path / "20250615T150740Z-short"
    folder.mkdir()
    (folder / "log.jsonl").write_bytes(b"".join(flight()))
    (folder / "mission.bundle").write_bytes(case.seal(case.mission(case.short_steps())))
    (tmp_path / "root.trust").write_bytes(case.root()[1])
    return folder


def rewrite(run: Path, lines: list[bytes]) -> None:
    (run / "log.jsonl").write_bytes(b"".join(lines))


def verify(*words: object) -> int:
    return app.main(["verify-log", "--root", ROOT.public.hex(), *map(str, words)])


def test_a_sound_log(run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert verify(run) == ExitCode.OK
    out = capsys.readouterr().out
    count = len(flight())
    assert f"VERIFIED  {count} records, closed and signed; unanchored" in out
    assert f"{count} records, in 8 sealed epochs; only signed records were read" in out
    assert f"- unanchored tail: {count} records" in out
    assert "closed and signed by log key" in out
    assert "complete" not in out.replace("completed", "")
    assert "\033" not in out
    monkeypatch.delenv("COLUMNS")
    assert verify(run) == ExitCode.OK
    out = capsys.readouterr().out
    assert max(len(line) for line in out.splitlines() if str(run) not in line) <= 80  # a path is never broken


def test_file_and_folder_are_the_same(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run) == verify(run / "log.jsonl") == ExitCode.OK
    out = capsys.readouterr().out
    assert out[: len(out) // 2] == out[len(out) // 2 :]


@pytest.mark.parametrize("place", [".", "y", "y/deeper"])
def test_of_a_folder_no_log_is_passed_over_for_its_name(
    place: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: a folder with a forged `flight-0412.jsonl` beside a good `log.jsonl` was VERIFIED."""
    folder = tmp_path / "given"
    (folder / "y/deeper").mkdir(parents=True)
    shutil.copy(run / "log.jsonl", folder / "y/log.jsonl")
    assert verify(folder, "--json") == verify(folder / "y", "--json") == ExitCode.OK
    forged = (run / "log.jsonl").read_bytes().replace(b'"goto', b'"gota', 1)
    assert forged != (run / "log.jsonl").read_bytes()
    (folder / place / "flight-0412.jsonl").write_bytes(forged)
    capsys.readouterr()
    assert verify(folder, "--json") == ExitCode.EVIDENCE
    told = map(json.loads, capsys.readouterr().out.splitlines())
    verdicts = {Path(each["log"]).name: each["verdict"] for each in told}
    assert verdicts == {"log.jsonl": "verified", "flight-0412.jsonl": "failed"}
    if place != ".":
        assert verify(folder / "y") == ExitCode.EVIDENCE, "the folder of a run is looked through too"


def test_other_files_in_a_folder_are_listed(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "events.jsonl").write_text('{"event": "took off"}\n')
    (run / "nothing.jsonl").touch()
    assert verify(run) == ExitCode.OK
    said = capsys.readouterr().err
    for name in ("events", "nothing"):
        assert f"{name}.jsonl`: not a log" in " ".join(said.split()), said


def test_unreadable_log_in_a_folder_fails(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "flight-0412.jsonl").symlink_to("nowhere")
    assert verify(run) == ExitCode.INPUT
    assert "flight-0412.jsonl" in capsys.readouterr().err


@pytest.mark.parametrize("pin", ["public", "kid", "file", "hex file"])
def test_every_way_to_name_the_root(pin: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "pin.txt").write_text(ROOT.public.hex() + "\n")
    named = {
        "public": ROOT.public.hex(),
        "kid": ROOT.kid.hex().upper(),
        "file": tmp_path / "root.trust",
        "hex file": tmp_path / "pin.txt",
    }
    assert app.main(["verify-log", str(run), "--root", str(named[pin])]) == ExitCode.OK


def test_the_key_stores_root_is_the_default(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = KeyStore(data_folder())
    store.folder.mkdir(parents=True)
    store.root_path.write_bytes(case.root()[1])
    assert app.main(["verify-log", str(run)]) == ExitCode.OK
    assert "pinned  the development root of your key store" in capsys.readouterr().out


def test_without_any_root(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["verify-log", str(run)]) == ExitCode.UNTRUSTED
    err = capsys.readouterr().err
    assert err.startswith("error[no-keys]: no root to trust: `")
    assert "`--root`" in err


@pytest.mark.parametrize("data", [b"", b"hello", b"00" * 31, bytes(100)])
def test_invalid_root_file_is_refused(
    data: bytes, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "no.trust").write_bytes(data)
    assert app.main(["verify-log", str(run), "--root", str(tmp_path / "no.trust")]) == ExitCode.UNTRUSTED
    assert "is neither a root key nor a trust root" in capsys.readouterr().err


def test_another_root(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["verify-log", str(run), "--root", "00" * 32]) == ExitCode.UNTRUSTED
    assert "FAILED  at record 0, line 1: trust/root-unknown-key" in capsys.readouterr().out


def test_log_under_another_root_is_reported_with_a_remedy(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run) == ExitCode.OK
    duration = re.search(r", (\d+\.\d) s, mode", capsys.readouterr().out)
    assert duration is not None
    assert app.main(["verify-log", str(run), "--root", "00" * 32]) == ExitCode.UNTRUSTED
    out = capsys.readouterr().out
    assert duration.group() in out
    assert "not signed under the trust root that you pinned" in out
    assert "name it or its public key with `--root`" in out
    assert app.main(["verify-log", str(run), "--json", "--root", "00" * 32]) == ExitCode.UNTRUSTED
    assert "`--root`" in json.loads(capsys.readouterr().out)["failure"]["help"]


def test_a_changed_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = list(flight())
    lines[4] = edit(lines[4], event="failed")
    rewrite(run, lines)
    assert verify(run) == ExitCode.EVIDENCE
    out = capsys.readouterr().out
    assert "FAILED  at record 4, line 5: chain/broken" in out
    assert f"begins    at byte {sum(map(len, lines[:4]))} of the log" in out
    assert "The log was changed after it was written" in out
    assert "shown" not in out.replace("not shown", "")
    assert "VERIFIED" not in out


def test_a_cut_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(run, list(flight()[:-1]))
    assert verify(run) == ExitCode.INCOMPLETE
    count = len(flight())
    assert f"INCOMPLETE  at record {count - 1}, line {count}: close/missing" in capsys.readouterr().out
    rewrite(run, [*flight()[:-1], flight()[-1][:50]])
    assert verify(run) == ExitCode.INCOMPLETE
    out = capsys.readouterr().out
    assert "tail/torn" in out
    assert "The log was cut" in out


def test_an_empty_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(run, [])
    assert verify(run) == ExitCode.EVIDENCE
    assert "log/empty" in capsys.readouterr().out


def test_a_later_format_is_not_trusted(run: Path) -> None:
    rewrite(run, [edit(flight()[0], version=LOG.version + 1), *flight()[1:]])
    assert verify(run) == ExitCode.UNTRUSTED


@pytest.mark.parametrize("data", [b"\x00\x01", b"hello\n", b"{}\n", b"\xff" * 100_000])
def test_other_file_is_refused(data: bytes, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "log.jsonl").write_bytes(data)
    assert verify(run) == ExitCode.INPUT
    assert "is not a log of this program" in capsys.readouterr().err


def test_no_file(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run / "none") == ExitCode.INPUT
    assert "no such file" in capsys.readouterr().err


def test_the_log_of_another_run(run: Path) -> None:
    (run / "mission.bundle").write_bytes(case.seal(case.mission()))
    assert verify(run) == ExitCode.EVIDENCE
    (run / "log.jsonl").rename(run / "alone.jsonl")
    assert verify(run / "alone.jsonl") == ExitCode.OK


def with_telemetry(run: Path, data: bytes) -> None:
    rewrite(run, signed([*flight()[:-1], edit(flight()[-1], tlog=hashlib.sha256(data).hexdigest())]))
    (run / "telemetry.tlog").write_bytes(data)


def test_telemetry_file_is_verified(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_telemetry(run, b"frames")
    assert verify(run) == ExitCode.OK
    assert "`telemetry.tlog` is the one that was signed" in capsys.readouterr().out
    (run / "telemetry.tlog").write_bytes(b"other frames")
    assert verify(run) == ExitCode.EVIDENCE
    assert "telemetry/changed" in capsys.readouterr().out
    (run / "telemetry.tlog").unlink()
    assert verify(run) == ExitCode.OK
    assert "`telemetry.tlog` is missing beside the log" in capsys.readouterr().out.replace("\n    ", " ")


def test_telemetry_that_was_not_whole_is_not_vouched_for(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "telemetry.tlog").write_bytes(b"some frames")
    assert verify(run) == ExitCode.OK
    assert "the log has no digest of `telemetry.tlog`" in capsys.readouterr().out


def test_summary_file_is_reported_as_unsigned(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run) == ExitCode.OK
    assert "summary.json" not in capsys.readouterr().out
    (run / "summary.json").write_text("{}")
    assert verify(run) == ExitCode.OK
    assert "- `summary.json`: it is not signed" in capsys.readouterr().out


def test_as_json(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run, "--json") == ExitCode.OK
    sound = json.loads(capsys.readouterr().out)
    assert (sound["verdict"], sound["exit_code"], sound["records"], sound["failure"]) == (
        "verified", 0, len(flight()), None,
    )  # fmt: skip
    assert sound["flight"]["ending"] == "completed"
    assert sound["counts"] == {"genesis": 1, "seal": 7, "close": 1}
    assert (sound["signed"], sound["epochs"]) == (len(flight()), 8)
    assert (sound["anchored"], sound["unanchored_tail"]) == (0, len(flight()))
    assert verify(run, "--json", "--audit") == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["counts"]["allow"] == 3
    rewrite(run, [flight()[0], *flight()[2:]])
    assert verify(run, "--json") == ExitCode.EVIDENCE
    broken = json.loads(capsys.readouterr().out)
    assert broken["failure"]["slug"] == "chain/sequence"
    assert (broken["failure"]["record"], broken["failure"]["line"]) == (1, 2)
    assert broken["failure"]["offset"] == len(flight()[0])
    assert broken["flight"]["ending"] is None
    rewrite(run, [])
    assert verify(run, "--json") == ExitCode.EVIDENCE
    assert json.loads(capsys.readouterr().out)["flight"] is None


def test_an_audit_derives_every_decision(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run, "--audit") == ExitCode.OK
    out = capsys.readouterr().out
    count = len(flight())
    assert f"{count} records read: 3 decisions (3 allow), {count - 12} effects, in 8 sealed epochs" in out
    assert "+ 3 decisions derived again" in out
    assert verify(run, "--audit", "--no-derive") == ExitCode.OK
    out = capsys.readouterr().out
    assert "3 decisions (3 allow)" in out
    assert "- that decisions follow from their recorded inputs" in out


def test_a_decision_that_its_own_signers_forged(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    forged = list(flight())
    number = next(number for number, line in enumerate(forged) if b'"type":"decision"' in line)
    forged[number] = edit(forged[number], outcome="deny")
    rewrite(run, signed(forged))
    assert verify(run) == ExitCode.OK
    assert "- the format, number, clocks and place of each unsigned record" in capsys.readouterr().out
    assert verify(run, "--audit") == ExitCode.DECISION
    assert f"FAILED  at record {number}, line {number + 1}: decision/outcome" in capsys.readouterr().out
    assert verify(run, "--audit", "--no-derive") == ExitCode.OK


def test_fast_claims_only_checked_properties(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run, "--fast") == ExitCode.OK
    out = capsys.readouterr().out
    assert f"+ the octets of records 0 to {len(flight()) - 2} are the signed ones" in out
    assert "- that records are linked line by line" in out
    lines = list(flight())
    lines[4] = edit(lines[4], event="failed")
    rewrite(run, lines)
    assert verify(run, "--fast") == ExitCode.EVIDENCE
    assert "chain/broken" in capsys.readouterr().out


def test_a_log_may_have_to_be_anchored(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for how in ([], ["--audit"], ["--fast"]):
        assert verify(run, "--require-anchor", *how) == ExitCode.INCOMPLETE
        assert "INCOMPLETE  at record 0, line 1: anchor/missing" in capsys.readouterr().out


@pytest.mark.parametrize("how", [[], ["--audit"], ["--fast"]])
def test_anchor_files_are_found_and_named(
    how: list[str], run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    count = len(flight())
    last = mark(note_of(flight(), count - 1))
    (tmp_path / "seen.anchors").write_text(last + "\n")
    assert verify(run, "--require-anchor", "--anchors", tmp_path / "seen.anchors", *how) == ExitCode.OK
    out = capsys.readouterr().out
    assert f"VERIFIED  {count} records, closed and signed; anchored to its end" in out
    assert "unanchored" not in out
    anchored = next(number for number, line in enumerate(flight()) if b'"type":"seal"' in line) + 1
    (run / "log.anchors").write_text(mark(note_of(flight(), anchored - 1)) + "\n")
    assert verify(run, *how) == ExitCode.OK
    assert f"anchored but for the last {count - anchored} records" in capsys.readouterr().out
    assert verify(run, "--require-anchor", "--json", *how) == ExitCode.INCOMPLETE
    told = json.loads(capsys.readouterr().out)
    left = count - anchored
    assert (told["anchored"], told["unanchored_tail"], told["shortfall"]["record"]) == (anchored, left, anchored)
    rewrite(run, signed([flight()[0], *flight()[2:]]))
    assert verify(run, *how) == ExitCode.ANCHOR
    assert "anchor/root" in capsys.readouterr().out
    assert verify(run, "--anchors", tmp_path / "none.anchors", *how) == ExitCode.INPUT


@pytest.mark.parametrize("how", [[], ["--audit"], ["--fast"]])
def test_named_anchors_are_read_or_reported(
    how: list[str], run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder.anchors").mkdir()
    os.mkfifo(tmp_path / "pipe.anchors")
    (tmp_path / "loop.anchors").symlink_to("loop.anchors")
    (tmp_path / "large.anchors").write_bytes(b"x" * 65)
    monkeypatch.setattr(logs, "_LARGEST", 64)
    for name, reason in (
        ("folder", "not a regular file"), ("pipe", "not a regular file"), ("loop", ""), ("large", "more than"),
    ):  # fmt: skip
        assert verify(run, "--anchors", tmp_path / f"{name}.anchors", *how) == ExitCode.INPUT
        assert reason in capsys.readouterr().err
    (tmp_path / "large.anchors").write_bytes(b"x" * 64)
    assert verify(run, "--anchors", tmp_path / "large.anchors", *how) == ExitCode.OK


@pytest.mark.parametrize("words", [["--fast", "--audit"], ["--fast", "--explain", "1"], ["--no-derive"]])
def test_options_that_contradict_each_other(words: list[str], run: Path) -> None:
    assert verify(run, *words) == ExitCode.USAGE


def test_several_logs(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cut.jsonl").write_bytes(b"".join(flight()[:-1]))
    assert verify(run, tmp_path / "cut.jsonl", run) == ExitCode.INCOMPLETE
    out = capsys.readouterr().out
    assert out.count("VERIFIED") == 2
    assert out.count("INCOMPLETE") == 1


def test_a_hostile_log_does_not_write_to_the_terminal(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(run, signed([edit(flight()[0], vehicle="\x1b[2J\rVERIFIED", mission="\u202e"), *flight()[1:]]))
    assert verify(run) == ExitCode.UNTRUSTED
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert "\u202e" not in out
    assert "\r" not in out


def test_long_log_shows_progress(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "_LONG", 100)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert verify(run) == ExitCode.OK


def test_terminal_output_is_coloured(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    assert verify(run) == ExitCode.OK
    out = capsys.readouterr().out
    assert "\x1b[" in out
    assert "VERIFIED" in out


def test_every_kind_of_failure_has_its_meaning() -> None:
    slugs = set()
    for folder in ("evidence", "ground/audit", "front/cli"):
        for file in (Path(verdict.__file__).parents[3] / folder).rglob("*.py"):
            slugs |= set(re.findall(r'\b(?:Flaw|Finding)\(\s*f?"([a-z]+)/', file.read_text()))
    of_others = {"note", "proof"}  # reported as slugs of a `seal`, and by `verify-proof`
    assert slugs - of_others <= set(verdict.MEANINGS)
    assert "chain" in slugs


@rows(
    ("slug", "code"),
    [
        ("trust/log-key", ExitCode.UNTRUSTED),
        ("preparation/parameter", ExitCode.DECISION),
        ("genesis/format", ExitCode.UNTRUSTED),
        ("genesis/mission", ExitCode.EVIDENCE),
        ("seal/root", ExitCode.EVIDENCE),
        ("telemetry/changed", ExitCode.EVIDENCE),
        ("decision/outcome", ExitCode.DECISION),
        ("document/wrong-key", ExitCode.DECISION),
        ("dispatch/late", ExitCode.DECISION),
        ("frames/early", ExitCode.DECISION),
        ("anchor/root", ExitCode.ANCHOR),
        ("anchor/beyond", ExitCode.ANCHOR),
    ],
)
def test_exit_codes_of_failures(slug: str, code: ExitCode) -> None:
    report = LogReport(0, {}, Finding(slug, 0, ""), None, None, None, 0, b"", (), ())
    assert report.verdict is LogVerdict.FAILED
    assert report_code(report) is code
