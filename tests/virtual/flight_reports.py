"""Reports of run folders, under the tests' root."""

from collections.abc import Iterable
from pathlib import Path

from rtshcua.app.flights.flight_report import FlightReportRequest, LiveFlight, ReportedFlight, flight_report
from rtshcua.app.pin import Pin
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.model.faults import BatteryLevel
from rtshcua.wire.keys import Duty
from virtual import case, run_folder
from virtual.once import once

PIN = Pin(case.KEYS[Duty.ROOT].public, "the tests' root")
MADE_US = case.flat.ISSUED + 3_600 * case.S


def report_of(run: Path, *removed: str) -> ReportedFlight:
    """The report of a run."""
    found = flight_report(FlightReportRequest(run / "log.jsonl", PIN, (), MADE_US, removed))
    assert isinstance(found, ReportedFlight), found
    return found


def completed(at: Path) -> Path:
    """The run folder of a flight that completes."""
    flown = once("flight-report", lambda: run_folder.fly(case.mission(case.short_steps()), case.simulated("px4")))
    return run_folder.folder(at, flown)


def turned(at: Path) -> Path:
    """The run folder of a flight whose battery falls so low that it turns home."""
    config = case.simulated("ardupilot", faults=(BatteryLevel(16 * case.S, 1_800),))
    flown = once("flight-report-turned", lambda: run_folder.fly(case.mission(case.short_steps()), config))
    return run_folder.folder(at, flown)


def told(lines: Iterable[bytes], at: Path) -> FlightReport:
    """What a page says of these lines of a log, while it grows: nothing is verified."""
    (at / "log.jsonl").write_bytes(b"".join(lines))
    live = LiveFlight(at / "log.jsonl", ())
    live.update()
    found = live.report(MADE_US)
    assert isinstance(found, FlightReport)
    return found
