"""`doctor` uses the same time of day as a run would."""

from pathlib import Path
from struct import Struct
from types import SimpleNamespace
from typing import Any

import pytest

from reference.flat_case import MISSION, POLICY
from reference.world import START
from rtshcua.adapters.boundary.home import BoundaryError
from rtshcua.adapters.utc import TimeSources
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.front.cli.commands import doctor
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.isolated import TIME
from rtshcua.wire.clock import ClockSource

SOCKET = Path("run/quad-07")
TOLD = Struct(">BqqqQ")


@pytest.mark.parametrize(
    ("apart", "keyed", "counts"), [(True, False, False), (True, True, True), (False, False, True), (False, True, True)]
)
def test_of_a_run_on_this_machine(monkeypatch: pytest.MonkeyPatch, apart: bool, keyed: bool, counts: bool) -> None:
    monkeypatch.setattr(doctor, "kernel_error_us", lambda: None)
    assert doctor._time_of_day(None, 500_000, keyed=keyed, apart=apart) == TimeSources(None, counts, 500_000)


@pytest.mark.parametrize(
    ("source", "linked", "found"),
    [
        (ClockSource.KERNEL, False, TimeSources(7, vehicle=False, listens=True)),
        (ClockSource.OPERATOR, False, TimeSources(None, vehicle=False, stated_us=7, listens=True)),
        (ClockSource.UNKNOWN, False, TimeSources(None, vehicle=False, listens=True)),
        (ClockSource.UNKNOWN, True, TimeSources(None, vehicle=True, listens=True)),
        (ClockSource.SHARED, True, TimeSources(9, vehicle=True, listens=True)),
    ],
)
def test_of_a_boundary_that_listens(
    monkeypatch: pytest.MonkeyPatch, source: ClockSource, linked: bool, found: TimeSources
) -> None:
    """The boundary is queried like by a run that no longer waits, and then released."""
    asked: list[bytes] = []

    def call(octets: bytes) -> bytes:
        asked.append(octets)
        return b"\0" + TOLD.pack(source, 5, 6, 7, 0)

    def close() -> None:
        asked.append(b"closed")

    made: Any = SimpleNamespace(link_name=b"name" if linked else None, call=call, close=close)
    monkeypatch.setattr(doctor, "ListeningBoundary", lambda path: made)
    monkeypatch.setattr(doctor, "kernel_error_us", lambda: 9)
    assert doctor._time_of_day(SOCKET, None, keyed=False, apart=True) == found
    assert asked == [bytes([TIME, True]), b"closed"]


def test_silent_boundary_is_reported_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    def nobody(path: Path) -> None:
        raise BoundaryError("not-begun", "nobody answers", "start it")

    monkeypatch.setattr(doctor, "ListeningBoundary", nobody)
    monkeypatch.setattr(doctor, "kernel_error_us", lambda: 9)
    assert doctor._time_of_day(SOCKET, None, keyed=False, apart=True) == TimeSources(9, listens=True)


def test_utc_error_is_refused_for_a_listening_boundary(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["doctor", "--connect", "udpin:127.0.0.1:1", "--utc-error", "1s", "--boundary-socket", str(SOCKET)]
    assert main(words) == ExitCode.USAGE
    assert "set it on the boundary's command line" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("time", "stops"),
    [
        (TimeSources(20_000), True),
        (TimeSources(None, stated_us=500_000), True),
        (TimeSources(20_000, stated_us=1 << 50), True),
        (TimeSources(None), False),
    ],
)
def test_a_mission_that_expired_stops_where_the_time_is_known(time: TimeSources, stops: bool) -> None:
    later = Now(START.monotonic_us, START.utc_us + (1 << 40), START.utc_error_us)
    found = doctor._expired(POLICY, MISSION, later, time)
    assert [each.slug for each in found] == ["mission/expired"] * stops
    assert doctor._expired(POLICY, MISSION, START, time) == []
