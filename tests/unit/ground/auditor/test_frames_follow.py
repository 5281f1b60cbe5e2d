"""The raw frames of every kind of flight agree with its log: each command after its record, and none besides."""

from collections.abc import Sequence

import pytest

from reference.flat_case import S
from reference.kept_frames import Entries, kept
from rtshcua.evidence.finding import Finding
from rtshcua.ground.auditor.audit import Auditor
from rtshcua.ground.auditor.frames import Frames
from rtshcua.onboard.enforcement.load import Mode
from rtshcua.onboard.ports import Event, Interrupted
from rtshcua.simulation.faults import BatteryLevel, Fault, GpsLoss, LinkSilence, Obstacle, PilotMode, WindStep
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight

FAULTS: dict[str, tuple[Fault, ...]] = {
    "none": (),
    "low battery": (BatteryLevel(15 * S, 2_000),),
    "wind": (WindStep(15 * S, 14 * case.M),),
    "no fix": (GpsLoss(15 * S),),
    "obstacle": (Obstacle(15 * S, 2 * case.M),),
    "pilot": (PilotMode(15 * S),),
    "silence": (LinkSilence(15 * S),),
}


def joined(lines: Sequence[bytes], entries: Entries) -> tuple[Finding | None, Frames]:
    frames = Frames(iter(entries))
    auditor = Auditor(case.KEYS[Duty.ROOT].kid, frames=frames)
    for line in lines:
        auditor.take(line)
    assert auditor.audit().report.failure is None, auditor.audit().report.failure
    return frames.over(), frames


@pytest.mark.parametrize("mode", [Mode.SOFTWARE, Mode.NONE])
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
@pytest.mark.parametrize("faults", FAULTS.values(), ids=FAULTS.keys())
def test_every_kind_of_flight(faults: tuple[Fault, ...], kind: str, mode: Mode) -> None:
    flight = Flight(case.seal(case.mission()), case.simulated(kind, faults=faults), mode=mode)
    entries = kept(flight)
    found, frames = joined(flight.fly().lines, entries)
    assert found is None
    assert frames.count >= 2, "arm, take off: what is so already is not asked for"


def test_a_flight_that_was_interrupted() -> None:
    flight = Flight(case.seal(case.mission(case.short_steps())), case.simulated("px4"))
    entries = kept(flight)
    told = [False]

    def each(run: Flight) -> Sequence[Event]:
        now_us = run.clock.now().monotonic_us
        if told[0] or now_us < 20 * S:
            return ()
        told[0] = True
        return (Interrupted(now_us),)

    found, frames = joined(flight.fly(each).lines, entries)
    assert (found, frames.count >= 3) == (None, True)
