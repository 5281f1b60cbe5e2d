"""`rtshcua export`: files, pipes, the status of the log, refusals and exit codes."""

import csv
import io
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from reference.exported_flight import by_pymavlink, run_in, trust_its_root
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.ground.flight.export import FORMATS, GEOTAG

RUN = "20260101T000000Z-short"
#: the formats that a flight without images has too
OF_ANY = [each for each in FORMATS if each != GEOTAG]
_BEGINS = {
    "kml": b"<?xml", "gpx": b"<?xml", "geojson": b'{"type":"FeatureCollection"', "csv": b"time_utc,",
    "plan": b'{\n  "fileType": "Plan"', "mcap": b"\x89MCAP", "tlog": b"\x00",
}  # fmt: skip


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    run_in(Path("runs", RUN))
    return tmp_path


def export(*words: object) -> int:
    return app.main(["export", *map(str, words)])


def refused(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert export(*words) in (ExitCode.USAGE, ExitCode.INPUT, ExitCode.EVIDENCE)
    said = capsys.readouterr()
    assert said.out == ""
    assert "Traceback" not in said.err
    return said.err


class Terminal(io.TextIOWrapper):
    """A standard output that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("to", OF_ANY)
def test_every_format_as_a_file(to: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert export(f"runs/{RUN}", "--to", to, "-o", "flight.out") == ExitCode.OK
    said = capsys.readouterr()
    data = Path("flight.out").read_bytes()
    assert data.startswith(_BEGINS[to])
    assert "wrote `flight.out`: " in said.out
    assert f"{len(data)} bytes" in said.out
    assert "log: not verified: the key store has no root" in said.err


@pytest.mark.parametrize("to", OF_ANY)
def test_every_format_to_a_pipe(to: str, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert export(f"runs/{RUN}/log.jsonl", "--to", to) == ExitCode.OK
    said = capfdbinary.readouterr()
    assert said.out.startswith(_BEGINS[to])
    assert b"log: not verified" in said.err
    assert [*map(str, Path().iterdir())] == ["runs"]


@pytest.mark.parametrize("to", OF_ANY)
def test_a_file_is_named_after_the_run_at_a_terminal(to: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", Terminal(io.BytesIO(), encoding="utf-8"))
    assert export(f"runs/{RUN}", "--to", to) == ExitCode.OK
    assert Path(f"{RUN}.{to}").read_bytes().startswith(_BEGINS[to])


@pytest.mark.parametrize("to", ["mcap", "tlog"])
def test_no_binary_file_is_written_to_a_terminal(
    to: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdout", Terminal(io.BytesIO(), encoding="utf-8"))
    assert "binary" in refused(capsys, f"runs/{RUN}", "--to", to, "-o", "-")


def test_json_says_what_was_written(capsys: pytest.CaptureFixture[str]) -> None:
    trust_its_root()
    assert export(f"runs/{RUN}", "--to", "gpx", "--json") == ExitCode.OK
    said = json.loads(capsys.readouterr().out)
    assert said["file"] == f"{RUN}.gpx"
    assert said["bytes"] == Path(said["file"]).stat().st_size
    assert said["points"] == len(by_pymavlink(Path(f"runs/{RUN}/telemetry.tlog"), "GLOBAL_POSITION_INT"))
    assert said["datum"] == {"horizontal": "WGS 84", "vertical": "above mean sea level as the autopilot reported it"}
    assert (said["format"], said["log"]["verified"], said["log"]["verdict"]) == ("gpx", True, "verified")
    assert said["warnings"] == []


def status(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert export(f"runs/{RUN}", "--to", "csv", "--json", "-o", "flight.csv") == ExitCode.OK
    found: dict[str, Any] = json.loads(capsys.readouterr().out)["log"]
    rows = list(csv.DictReader(io.StringIO(Path("flight.csv").read_text(encoding="utf-8"))))
    assert {row["log"] for row in rows} == {"verified" if found["verified"] else "not verified"}
    return found


def test_the_log_is_verified_with_the_key_store(capsys: pytest.CaptureFixture[str]) -> None:
    assert status(capsys)["verdict"] is None
    trust_its_root()
    found = status(capsys)
    assert (found["verdict"], "with the telemetry that it names" in found["text"]) == ("verified", True)
    telemetry = Path("runs", RUN, "telemetry.tlog")
    telemetry.write_bytes(telemetry.read_bytes()[:-40])
    found = status(capsys)
    assert (found["verified"], found["verdict"]) == (False, "failed")
    assert found["text"].startswith("not verified: telemetry/changed")


def test_a_log_that_is_changed_or_cut_is_not_verified(capsys: pytest.CaptureFixture[str]) -> None:
    trust_its_root()
    log = Path("runs", RUN, "log.jsonl")
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:-1]))
    assert status(capsys)["verdict"] == "incomplete"
    log.write_bytes(b"".join([*lines[:3], *lines[4:]]))
    assert status(capsys)["verdict"] == "failed"


def test_telemetry_that_is_cut_is_exported_with_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    telemetry = Path("runs", RUN, "telemetry.tlog")
    telemetry.write_bytes(telemetry.read_bytes()[:-5])
    assert export(f"runs/{RUN}", "--to", "tlog", "-o", "flight.tlog") == ExitCode.OK
    said = capsys.readouterr()
    frames = len(by_pymavlink(Path("flight.tlog")))
    assert f"warning: the telemetry is damaged: cut after {frames} frames" in said.err
    assert f"{frames} frames" in said.out
    assert export(f"runs/{RUN}", "--to", "kml", "-o", "flight.kml") == ExitCode.OK
    assert "warning: the telemetry is damaged from byte" in capsys.readouterr().err


def test_telemetry_after_the_end_of_a_cut_log_is_exported_with_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    run = Path("runs", RUN)
    assert export(run, "--to", "csv", "-o", "whole.csv") == ExitCode.OK
    assert "after the last record" not in capsys.readouterr().err
    log = run / "log.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:3]))
    assert export(run, "--to", "csv", "-o", "cut.csv") == ExitCode.OK
    said = " ".join(capsys.readouterr().err.split())
    assert re.search(r"warning: the telemetry: it goes on for [0-9.]+ s after the last record of the log", said)
    whole, cut = (list(csv.reader(io.StringIO(Path(name).read_text()))) for name in ("whole.csv", "cut.csv"))
    assert len(cut) == len(whole) > 10


def test_without_telemetry_only_the_plan_is_exported(capsys: pytest.CaptureFixture[str]) -> None:
    Path("runs", RUN, "telemetry.tlog").unlink()
    for to in OF_ANY:
        if to != "plan":
            assert "--to plan" in refused(capsys, f"runs/{RUN}", "--to", to, "-o", "flight.out")
    assert not Path("flight.out").exists()
    assert export(f"runs/{RUN}", "--to", "plan", "-o", "flight.plan") == ExitCode.OK
    assert "home's height above the sea is not known" in capsys.readouterr().err


def test_telemetry_without_a_position(capsys: pytest.CaptureFixture[str]) -> None:
    Path("runs", RUN, "telemetry.tlog").write_bytes(b"")
    assert "has no position" in refused(capsys, f"runs/{RUN}", "--to", "kml")
    assert "has no whole frame" in refused(capsys, f"runs/{RUN}", "--to", "tlog")
    assert export(f"runs/{RUN}", "--to", "mcap", "-o", "flight.mcap") == ExitCode.OK


def test_unknown_formats(capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean `geojson`?" in refused(capsys, f"runs/{RUN}", "--to", "geojsn")
    assert "accepted: `kml`" in refused(capsys, f"runs/{RUN}", "--to", "shapefile")
    assert "--to" in refused(capsys, f"runs/{RUN}")


@pytest.mark.parametrize("name", ["log.jsonl", "telemetry.tlog"])
def test_no_file_of_the_run_is_overwritten(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = Path("runs", RUN, name)
    before = path.read_bytes()
    Path("link").symlink_to(path)
    Path("hard").hardlink_to(path)
    for target in (path, "link"):
        assert "is not overwritten" in refused(capsys, f"runs/{RUN}", "--to", "csv", "-o", target)
    assert path.read_bytes() == before
    export(f"runs/{RUN}", "--to", "csv", "-o", "hard")
    assert path.read_bytes() == before


def test_targets_that_cannot_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    Path("yard.rts").write_text('import "lib:skills/hover.rts"\n', encoding="utf-8")
    assert "is a source" in refused(capsys, f"runs/{RUN}", "--to", "csv", "-o", "yard.rts")
    assert "is a folder" in refused(capsys, f"runs/{RUN}", "--to", "csv", "-o", "runs")
    assert "no folder `none`" in refused(capsys, f"runs/{RUN}", "--to", "csv", "-o", "none/flight.csv")
    assert "standard output" in json.loads(_json_error(capsys, "-o", "-"))["error"]["text"]


def _json_error(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert export(f"runs/{RUN}", "--to", "csv", "--json", *words) == ExitCode.USAGE
    return capsys.readouterr().out


def test_files_that_are_no_logs(capsys: pytest.CaptureFixture[str]) -> None:
    Path("plan.plan").write_text('{"fileType": "Plan"}', encoding="utf-8")
    Path("noise").write_bytes(b"\x00\xff" * 50)
    assert "a QGroundControl plan, not a log" in refused(capsys, "plan.plan", "--to", "csv")
    assert "is not a log" in refused(capsys, "noise", "--to", "kml")
    assert "none" in refused(capsys, "none", "--to", "kml")
    assert "log.jsonl" in refused(capsys, "runs", "--to", "kml")
    log = Path("runs", RUN, "log.jsonl")
    log.write_bytes(log.read_bytes()[:500])
    assert "cut inside its first record" in refused(capsys, f"runs/{RUN}", "--to", "plan")


def test_mcap_without_its_package(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    from rtshcua.ground.flight import export as package

    monkeypatch.delattr(package, "mcap_file", raising=False)
    monkeypatch.delitem(sys.modules, "rtshcua.ground.flight.export.mcap_file", raising=False)
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    assert "pip install '.[export]'" in refused(capsys, f"runs/{RUN}", "--to", "mcap", "-o", "flight.mcap")


def test_a_file_may_be_written_again() -> None:
    for _ in range(2):
        assert export(f"runs/{RUN}", "--to", "kml", "-o", "flight.kml") == ExitCode.OK


def test_help_names_the_formats(capsys: pytest.CaptureFixture[str]) -> None:
    assert export("--help") == ExitCode.OK
    said = capsys.readouterr().out
    assert all(to in said for to in FORMATS)


def test_file_with_another_name_is_not_overwritten(capsys: pytest.CaptureFixture[str]) -> None:
    Path("notes.md").write_text("notes", encoding="utf-8")
    assert "not overwritten" in refused(capsys, f"runs/{RUN}", "--to", "kml", "-o", "notes.md")
    assert Path("notes.md").read_text(encoding="utf-8") == "notes"
    for name in ("new.md", "flight.KML", "flight.KML"):
        assert export(f"runs/{RUN}", "--to", "kml", "-o", name) == ExitCode.OK


def test_telemetry_of_another_run_is_not_overwritten(capsys: pytest.CaptureFixture[str]) -> None:
    other = Path("runs", "other")
    shutil.copytree(Path("runs", RUN), other)
    before = (other / "telemetry.tlog").read_bytes()
    for name in ("telemetry.tlog", "log.jsonl"):
        assert "not overwritten" in refused(capsys, f"runs/{RUN}", "--to", "tlog", "-o", str(other / name))
    assert (other / "telemetry.tlog").read_bytes() == before
