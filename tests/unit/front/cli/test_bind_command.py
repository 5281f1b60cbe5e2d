"""`rtshcua bind`: what it writes, tells and refuses, and what `show` and `verify-log` make of it."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from reference.autopilot_logs import ardupilot_log, px4_log
from reference.bound_run import ROOT, bind_words, flight_of, recorded, run_folder, with_log
from rtshcua.app.autopilot_bindings import FoundBinding, read_bindings
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.ground.flight.autopilot_log import AutopilotPoint
from rtshcua.wire.autopilot_binding import AutopilotBinding

S = 1_000_000


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return run_folder(tmp_path / "run")


def bound(run: Path, file: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    assert app.main([*bind_words(run, file), "--json"]) == ExitCode.OK
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    return told


def refused(run: Path, file: Path, capsys: pytest.CaptureFixture[str], code: ExitCode) -> str:
    assert app.main([*bind_words(run, file), "--json"]) == code
    slug: str = json.loads(capsys.readouterr().out)["error"]["slug"]
    assert not list(run.glob("*.binding"))
    return slug


def verified(run: Path, capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    assert app.main(["verify-log", "--json", "--root", ROOT, *words, str(run)]) == ExitCode.OK
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    return told


def claims(told: dict[str, Any], which: str) -> dict[str, str]:
    return {each["slug"]: each["text"] for each in told[which] if each["slug"].startswith("autopilot")}


@pytest.mark.parametrize(("name", "write"), [("flight.ulg", px4_log), ("00000012.BIN", ardupilot_log)])
def test_binding_of_the_flights_own_log(name: str, write: Any, run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = with_log(run, name, write)
    told = bound(run, file, capsys)
    (found,) = read_bindings(run)
    assert str(found.path) == told["document"]
    assert isinstance(found.content, AutopilotBinding)
    binding = found.content
    assert (binding.file, binding.size, binding.condition) == (name, file.stat().st_size, "whole")
    assert binding.points == binding.compared == binding.agreed > 500
    assert binding.covered_us == binding.flown_us > 50 * S
    assert binding.horizontal < 200
    assert binding.vertical < 200
    assert binding.error_us < 100_000
    assert not binding.deviations
    shown = verified(run, capsys)
    assert name in claims(shown, "proven")["autopilot"]
    assert not claims(shown, "unproven")
    assert claims(verified(run, capsys, "--audit"), "proven") == claims(shown, "proven")
    assert "autopilot/unread" in claims(verified(run, capsys, "--fast"), "unproven")
    assert app.main(["show", "--json", str(found.path)]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["binding"] == told["binding"]


def test_text_fits_80_columns(run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(run.parent)
    run = Path("run")
    file = with_log(run, write=lambda track: px4_log([at._replace(above_sea=at.above_sea + 2_000) for at in track]))
    assert app.main(bind_words(run, file)) == ExitCode.OK
    assert app.main(["show", str(read_bindings(run)[0].path)]) == ExitCode.OK
    assert app.main(["verify-log", "--root", ROOT, str(run)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "not shown" in out
    assert max(map(len, out.splitlines())) <= 80


def test_utc_of_the_same_boot_is_compared(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flight, offset_us = flight_of(run), bound(run, with_log(run), capsys)["binding"]["offset_us"]
    booted_us = flight.genesis.utc_us + offset_us + 30_000
    for name, write in (("a.ulg", px4_log), ("a.bin", ardupilot_log)):
        (run / name).write_bytes(write(recorded(flight), booted_us))
        assert abs(bound(run, run / name, capsys)["binding"]["utc_apart_us"] - 30_000) < 1_000


def test_deviation_is_stated_with_its_time(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """For three seconds the autopilot recorded that it was 1.5 m higher than it reported."""
    track = recorded(flight_of(run))
    begin = track[len(track) // 2].boot_us
    off = [at._replace(above_sea=at.above_sea + 1_500 * (begin <= at.boot_us <= begin + 3 * S)) for at in track]
    (run / "flight.ulg").write_bytes(px4_log(off))
    told = bound(run, run / "flight.ulg", capsys)["binding"]
    assert told["agreed"] < told["points"]
    assert told["vertical"] in range(1_400, 1_601)
    offset, begins, ends = told["offset_us"], told["deviations"][0]["from_us"], told["deviations"][-1]["to_us"]
    assert abs(begins - offset - begin) < 400_000
    assert abs(ends - begins - 3 * S) < 400_000
    doubt = claims(verified(run, capsys), "unproven")["autopilot/apart"]
    assert "in height" in doubt


def test_log_of_part_of_the_flight(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """PX4 records from arming to disarming, the telemetry more."""
    track = recorded(flight_of(run))
    (run / "flight.ulg").write_bytes(px4_log(track[20 : len(track) // 2]))
    told = bound(run, run / "flight.ulg", capsys)["binding"]
    assert 0 < told["agreed"] == told["compared"] < told["points"]
    assert 0 < told["covered_us"] < told["flown_us"] // 2
    assert "it has nothing of" in claims(verified(run, capsys), "unproven")["autopilot/apart"]


def test_cut_log_is_bound_as_far_as_it_goes(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = with_log(run).read_bytes()
    (run / "flight.ulg").write_bytes(data[: len(data) // 2 - 1])
    told = bound(run, run / "flight.ulg", capsys)["binding"]
    assert told["condition"] == "cut"
    assert 0 < told["covered_us"] < told["flown_us"]
    assert "cut off at its end" in claims(verified(run, capsys), "proven")["autopilot"]


def test_each_file_has_a_binding(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = with_log(run), with_log(run, "b.bin", ardupilot_log)
    assert bound(run, first, capsys)["document"] != bound(run, second, capsys)["document"]
    bound(run, first, capsys)
    assert len(read_bindings(run)) == 2
    proven = [each for each in verified(run, capsys)["proven"] if each["slug"] == "autopilot"]
    assert len(proven) == 2


def test_file_elsewhere_or_changed_is_not_shown(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = with_log(run).rename(tmp_path / "flight.ulg")
    digest = bound(run, file, capsys)["binding"]["digest"]
    assert digest in claims(verified(run, capsys), "unproven")["autopilot/missing"]
    (run / "flight.ulg").write_bytes(file.read_bytes() + b"x")
    told = verified(run, capsys)
    assert "autopilot" in claims(told, "proven")
    assert "autopilot/changed" in claims(told, "unproven")


def test_wrong_files_and_boots_are_refused(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flight, track = flight_of(run), recorded(flight_of(run))
    later = tmp_path / "later.ulg"
    later.write_bytes(px4_log([at._replace(boot_us=at.boot_us + 3_600 * S) for at in track]))
    assert refused(run, later, capsys, ExitCode.INPUT) == "other-boot"
    later.write_bytes(px4_log(track, flight.genesis.utc_us - 86_400 * S))
    assert refused(run, later, capsys, ExitCode.INPUT) == "other-boot"
    later.write_bytes(b"# notes")
    assert refused(run, later, capsys, ExitCode.INPUT) == "wrong-kind"
    assert refused(run, tmp_path / "none.ulg", capsys, ExitCode.INPUT) == "input"
    file = with_log(run)
    (run / "telemetry.tlog").unlink()
    assert refused(run, file, capsys, ExitCode.INPUT) == "no-telemetry"


def test_only_a_verified_log_of_this_program_is_bound(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = with_log(run)
    data = (run / "log.jsonl").read_bytes()
    (run / "log.jsonl").write_bytes(data.replace(b'"seq":5,', b'"seq":6,'))
    assert refused(run, file, capsys, ExitCode.EVIDENCE).startswith(("record", "chain"))
    (run / "log.jsonl").write_text('{"speed": 1}\n')
    assert refused(run, file, capsys, ExitCode.INPUT) == "input"
    (run / "log.jsonl").write_bytes(data)
    with (run / "telemetry.tlog").open("ab") as telemetry:
        telemetry.write(bytes(20))
    assert refused(run, file, capsys, ExitCode.EVIDENCE) == "telemetry/changed"


def test_unreadable_binding_is_listed(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "x.binding").write_bytes(b"junk")
    (found,) = read_bindings(run)
    assert isinstance(found, FoundBinding)
    assert not isinstance(found.content, AutopilotBinding)
    assert "x.binding" in claims(verified(run, capsys), "unproven")["autopilot/untrusted"]


def test_positions_without_motion_are_compared_too(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    still = [AutopilotPoint(at.boot_us, 473_000_000, 85_000_000, 0) for at in recorded(flight_of(run))]
    (run / "flight.ulg").write_bytes(px4_log(still))
    told = bound(run, run / "flight.ulg", capsys)["binding"]
    assert told["agreed"] == 0
    assert len(told["deviations"]) == 1


@pytest.mark.parametrize("name", [b"a\nb.ulg", b"a\xe2\x80\xaeb.ulg", b"\xff.ulg"])
def test_file_whose_name_cannot_be_shown_is_refused(
    name: bytes, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / os.fsdecode(name)
    file.write_bytes(with_log(run).read_bytes())
    assert refused(run, file, capsys, ExitCode.INPUT) == "input"
