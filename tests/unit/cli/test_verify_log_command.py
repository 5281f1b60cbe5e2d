"""`rtshcua verify-log`: what it says, and its exit codes."""

import hashlib
import json
import re
from pathlib import Path

import pytest

from reference.forgery import edit, flight, signed
from rtshcua.adapters.files.folders import data_folder
from rtshcua.adapters.files.keystore import KeyStore
from rtshcua.cli import app, verdict, verify_log
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.report import Report, Verdict
from rtshcua.wire.keys import Duty
from virtual import case

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


def test_a_sound_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run) == ExitCode.OK
    out = capsys.readouterr().out
    count = len(flight())
    assert f"VERIFIED  {count} records, closed and signed; unanchored" in out
    assert f"{count} records read: 3 decisions (3 allow), {count - 5} effects" in out
    assert "closed and signed by log key" in out
    assert "complete" not in out.replace("completed", "")
    assert "\033" not in out
    assert max(len(line) for line in out.splitlines() if str(run) not in line) <= 120  # a path is never broken


def test_file_and_folder_are_the_same(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run) == verify(run / "log.jsonl") == ExitCode.OK
    out = capsys.readouterr().out
    assert out[: len(out) // 2] == out[len(out) // 2 :]


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
    assert err.startswith("error: no root to trust: there are no keys in ")
    assert "`--root`" in err


@pytest.mark.parametrize("data", [b"", b"hello", b"00" * 31, bytes(100)])
def test_a_root_file_that_is_none(data: bytes, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "no.trust").write_bytes(data)
    assert app.main(["verify-log", str(run), "--root", str(tmp_path / "no.trust")]) == ExitCode.UNTRUSTED
    assert "is neither a root key nor a trust root" in capsys.readouterr().err


def test_another_root(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["verify-log", str(run), "--root", "00" * 32]) == ExitCode.UNTRUSTED
    assert "FAILED  at record 0, line 1: trust/root-unknown-key" in capsys.readouterr().out


def test_a_log_under_another_root_is_told_whole_and_how_to_trust_it(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert verify(run) == ExitCode.OK
    duration = re.search(r", (\d+\.\d) s, mode", capsys.readouterr().out)
    assert duration is not None
    assert app.main(["verify-log", str(run), "--root", "00" * 32]) == ExitCode.UNTRUSTED
    out = capsys.readouterr().out
    assert duration.group() in out
    assert "Not trusted here" in out
    assert "`--root` takes that trust root" in out
    assert app.main(["verify-log", str(run), "--json", "--root", "00" * 32]) == ExitCode.UNTRUSTED
    assert "`--root`" in json.loads(capsys.readouterr().out)["failure"]["help"]


def test_a_changed_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = list(flight())
    lines[4] = edit(lines[4], event="failed")
    rewrite(run, lines)
    assert verify(run) == ExitCode.EVIDENCE
    out = capsys.readouterr().out
    assert "FAILED  at record 4, line 5: chain/broken" in out
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
    rewrite(run, [edit(flight()[0], version=2), *flight()[1:]])
    assert verify(run) == ExitCode.UNTRUSTED


@pytest.mark.parametrize("data", [b"\x00\x01", b"hello\n", b"{}\n", b"\xff" * 100_000])
def test_what_is_no_log(data: bytes, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_the_telemetry_beside_the_log(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with_telemetry(run, b"frames")
    assert verify(run) == ExitCode.OK
    assert "`telemetry.tlog` is the one that was signed" in capsys.readouterr().out
    (run / "telemetry.tlog").write_bytes(b"other frames")
    assert verify(run) == ExitCode.EVIDENCE
    assert "telemetry/changed" in capsys.readouterr().out
    (run / "telemetry.tlog").unlink()
    assert verify(run) == ExitCode.OK
    assert "`telemetry.tlog` does not lie beside the log" in capsys.readouterr().out.replace("\n    ", " ")


def test_telemetry_that_was_not_whole_is_not_vouched_for(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "telemetry.tlog").write_bytes(b"some frames")
    assert verify(run) == ExitCode.OK
    assert "the log does not vouch for `telemetry.tlog`" in capsys.readouterr().out


def test_nothing_vouches_for_the_summary(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run) == ExitCode.OK
    assert "summary.json" not in capsys.readouterr().out
    (run / "summary.json").write_text("{}")
    assert verify(run) == ExitCode.OK
    assert "- `summary.json`: nothing signs it" in capsys.readouterr().out


def test_as_json(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(run, "--json") == ExitCode.OK
    sound = json.loads(capsys.readouterr().out)
    assert (sound["verdict"], sound["exit_code"], sound["records"], sound["failure"]) == (
        "verified", 0, len(flight()), None,
    )  # fmt: skip
    assert sound["flight"]["ending"] == "completed"
    assert sound["counts"]["allow"] == 3
    rewrite(run, [flight()[0], *flight()[2:]])
    assert verify(run, "--json") == ExitCode.EVIDENCE
    broken = json.loads(capsys.readouterr().out)
    assert broken["failure"]["slug"] == "chain/sequence"
    assert (broken["failure"]["record"], broken["failure"]["line"]) == (1, 2)
    assert broken["flight"]["ending"] is None
    rewrite(run, [])
    assert verify(run, "--json") == ExitCode.EVIDENCE
    assert json.loads(capsys.readouterr().out)["flight"] is None


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


def test_a_long_log_shows_that_it_goes_on(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(verify_log, "_LONG", 100)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert verify(run) == ExitCode.OK


def test_in_a_terminal_it_is_coloured(
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
    for folder in ("evidence", "ground/auditor", "cli"):
        for file in (Path(verdict.__file__).parents[1] / folder).glob("*.py"):
            slugs |= set(re.findall(r'(?:Flaw|Finding)\(\s*f?"([a-z]+)/', file.read_text()))
    assert slugs <= set(verdict.MEANINGS)
    assert "chain" in slugs


@pytest.mark.parametrize(
    ("slug", "code"),
    [
        ("trust/log-key", ExitCode.UNTRUSTED),
        ("genesis/format", ExitCode.UNTRUSTED),
        ("genesis/mission", ExitCode.EVIDENCE),
        ("close/root", ExitCode.EVIDENCE),
    ],
)
def test_exit_codes_of_failures(slug: str, code: ExitCode) -> None:
    report = Report(0, {}, Finding(slug, 0, ""), None, None, None, 0, b"", (), ())
    assert report.verdict is Verdict.FAILED
    assert verify_log.exit_code(report) is code
