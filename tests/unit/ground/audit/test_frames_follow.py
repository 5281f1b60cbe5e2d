"""The raw frames of every kind of flight agree with its log: each command follows its record, and there is no other."""

from collections.abc import Sequence
from itertools import product

import pytest

from reference.flat_case import S
from reference.forgery import sound
from reference.kept_frames import Entries, kept
from reference.kinds_of_flight import FAULTS, recorded
from rtshcua.evidence.finding import Finding
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.frames import FrameAudit
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Event, Interrupted
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight
from virtual.sampling import each_once


def joined(lines: Sequence[bytes], entries: Entries) -> tuple[Finding | None, FrameAudit]:
    frames = FrameAudit(iter(entries))
    auditor = Auditor(case.KEYS[Duty.ROOT].kid, frames=frames)
    for line in lines:
        auditor.take(line)
    assert auditor.audit().report.failure is None, auditor.audit().report.failure
    return frames.over(), frames


FLAVOURS = ("px4", "ardupilot")


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "flavour"), each_once(FAULTS, FLAVOURS))
def test_log_and_frames_of_every_kind_of_flight_pass(fault: str, flavour: str) -> None:
    lines, entries = recorded(fault, flavour)
    dispatches = sound(lines).dispatches
    found, frames = joined(lines, entries)
    assert found is None
    assert (dispatches, frames.count) == (0, 0) if "ground" in fault else frames.count >= 2, "to arm, to take off"


UNENFORCED = {("low battery", "px4"), ("wind", "ardupilot")}


@pytest.mark.parametrize(
    ("fault", "flavour"),
    [
        pytest.param(*each, marks=() if each in UNENFORCED else pytest.mark.soak)
        for each in product(FAULTS, FLAVOURS)
        if "ground" not in each[0]
    ],
)
def test_frames_of_every_kind_of_flight_without_enforcement_pass(fault: str, flavour: str) -> None:
    found, frames = joined(*recorded(fault, flavour, EnforcementMode.NONE))
    assert found is None
    assert frames.count >= 2, "arm, take off: what is so already is not asked for"


def test_frames_of_an_interrupted_flight_pass() -> None:
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
