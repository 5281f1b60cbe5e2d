"""A flight whose log broke off, and was ended hours later on a machine that had been restarted."""

import json
from pathlib import Path
from random import Random

import pytest

from rtshcua.adapters.store.recovery import LogEnder, recover
from rtshcua.app.flights import flight_export
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.records import Close, Recover
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight_reports import report_of

HOURS_US = 3 * 3_600_000_000


def ender(utc_us: int) -> LogEnder:
    """Ends logs at this UTC, 1 s after the machine was started."""
    key, chance = case.KEYS[Duty.LOG], Random(1)
    return LogEnder(
        key.public,
        lambda text: key.sign(text, duty=Duty.LOG),
        lambda: chance.randbytes(32),
        lambda: Now(1_000_000, utc_us, 2_000),
    )


@pytest.fixture(scope="module")
def broken(completed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder: all but the last 12 records, then those of the recovery."""
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)[:-12]
    run = tmp_path_factory.mktemp("broken") / "run"
    run.mkdir()
    (run / "log.jsonl").write_bytes(b"".join(lines))
    (run / "telemetry.tlog").write_bytes((completed / "telemetry.tlog").read_bytes())
    assert recover(run / "log.jsonl", ender(json.loads(lines[-1])["utc_us"] + HOURS_US)).done
    return run


@pytest.fixture(scope="module")
def report(broken: Path) -> FlightReport:
    return report_of(broken).report


def flight_of(run: Path) -> Flight:
    flight = read_flight(run / "log.jsonl")
    assert not isinstance(flight, Refusal)
    return flight


def last_flown(broken: Path) -> int:
    """The time of the last record before the recovery, by hand."""
    lines = [json.loads(line) for line in (broken / "log.jsonl").read_bytes().splitlines()]
    assert [each["type"] for each in lines[-2:]] == ["recover", "close"]
    assert lines[-1]["at_us"] < lines[-3]["at_us"]  # monotonic time restarted
    return int(lines[-3]["at_us"] - lines[0]["at_us"])


def test_flight_lasted_until_its_own_last_record(broken: Path, report: FlightReport) -> None:
    assert report.verdict == "verified"
    assert report.lasted_us == last_flown(broken) > 0
    assert all(each.until_us is None or 0 <= each.until_us <= report.lasted_us for each in report.timeline)
    assert all(each.t_us <= each.until_us for each in report.timeline if each.until_us is not None)


def test_records_of_the_recovery_come_last(broken: Path, report: FlightReport) -> None:
    times = [each.t_us for each in report.records]
    assert times == sorted(times)
    assert times[-2] == last_flown(broken) + HOURS_US


def test_report_and_export_have_the_same_times(broken: Path, report: FlightReport) -> None:
    flight = flight_of(broken)
    listed = {each.seq: each.t_us for each in report.records}
    assert {each.seq: flight.since_begun(each) for each in flight.records} == listed
    told = flight_export._told(broken / "log.jsonl", flight)
    assert [each.t_us for each in told if each.is_decision] == [each.t_us for each in report.decisions]


def test_clock_that_was_set_back_does_not_turn_the_order_around(completed: Path, tmp_path: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)[:-12]
    (tmp_path / "log.jsonl").write_bytes(b"".join(lines))
    assert recover(tmp_path / "log.jsonl", ender(1_000_000)).done
    flight = flight_of(tmp_path)
    times = [flight.since_begun(each) for each in flight.records]
    assert isinstance(flight.records[-2], Recover)
    assert isinstance(flight.records[-1], Close)
    assert times == sorted(times)
    assert times[-2] == flight.lasted_us == times[-3]
