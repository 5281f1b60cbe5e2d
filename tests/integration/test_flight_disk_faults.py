"""Flights with a failing evidence disk, with faults injected at the file port: the reaction follows the policy.

The flight climbs at 1.5 s, flies a leg from 15.9 to 27.2 s and then goes home; it seals every 10 s, and the steps'
deadlines are 2 s.
"""

import errno
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.faulty_disk import FaultyDisk
from rtshcua.adapters.clock import StepWatch
from rtshcua.evidence.report import LogVerdict
from rtshcua.model.flat.policy import WithoutEvidence
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Command, Ending, Event
from virtual import case
from virtual.disk import DiskSink
from virtual.flight import Flight, Flown

LAND, REFUSE = WithoutEvidence.LAND, WithoutEvidence.REFUSE
REFUSED = {"full": errno.ENOSPC, "defect": errno.EIO, "read-only": errno.EROFS}

Fault = Callable[[DiskSink], None]


class Watched:
    """A flight with the times and skills of the commands that were really sent."""

    def __init__(self, folder: Path, without: WithoutEvidence) -> None:
        policy = replace(case.policy(), without_evidence=int(without))
        bundle = case.seal(case.mission(case.short_steps()), policy)
        self.disk = FaultyDisk()
        self.flight = Flight(
            bundle, case.simulated("px4", land_mm_s=None),  # disks that are well again are so before it is down
            sink=lambda clock: DiskSink(folder / "log.jsonl", self.disk, clock),
        )  # fmt: skip
        self.sent: list[tuple[float, str]] = []
        begin = self.flight.vehicle.begin

        def watched(command: Command, now_us: int) -> None:
            self.sent.append((self.flight.clock.elapsed_us / case.S, command.skill))
            begin(command, now_us)

        self.flight.vehicle.begin = watched  # type: ignore[method-assign]

    @property
    def skills(self) -> list[str]:
        return [skill for _, skill in self.sent]

    def fly(self, fault: Fault, from_s: float, to_s: float) -> Flown:
        """Fly with a fault that lasts from one second of the flight to another."""

        def each(flight: Flight) -> Sequence[Event]:
            if from_s <= flight.clock.elapsed_us / case.S < to_s:
                fault(flight.sink)
            else:
                self.disk.heal()
                flight.sink.hangs = False
            return ()

        return self.flight.fly(each)


def refuses(number: int) -> Fault:
    """Every write fails."""
    return lambda sink: sink.disk.failing.update(write=number)


def fills(sink: DiskSink) -> None:
    """Only a hundred bytes are free."""
    sink.disk.room = min(sink.disk.room, 100)


def fails_to_sync(sink: DiskSink) -> None:
    sink.disk.failing["sync"] = errno.EIO


def hangs(sink: DiskSink) -> None:
    sink.hangs = True


def verified(flown: Flown) -> None:
    """Check that its log is valid and its chain complete."""
    assert flown.audit().report.verdict is LogVerdict.VERIFIED, flown.audit().report.failure


FAULTS = {**{name: refuses(number) for name, number in REFUSED.items()}, "full within a line": fills}


def faults(tried: str) -> list[Any]:
    """All of them: a disk that refuses for this reason; the others are for soak."""
    return [
        pytest.param(fault, id=name, marks=() if name == tried else pytest.mark.soak) for name, fault in FAULTS.items()
    ]


@pytest.mark.slow
@pytest.mark.parametrize("fault", faults("full within a line"))
def test_full_disk_lands_if_the_policy_says_land(fault: Fault, tmp_path: Path) -> None:
    run = Watched(tmp_path, LAND)
    flown = run.fly(fault, 18, 40)
    assert flown.ending is Ending.EVIDENCE_LOST
    assert run.skills[:2] == ["takeoff", "goto"]
    first = next(second for second, skill in run.sent if skill not in ("takeoff", "goto"))
    assert 20 <= first < 21, "when the seal could not be written it turned home"
    assert len(flown.effects("gap")) == len(flown.effects("gap-over")) == 1
    verified(flown)


@pytest.mark.slow
@pytest.mark.parametrize("fault", faults("defect"))
def test_full_disk_finishes_the_step_if_the_policy_says_refuse(fault: Fault, tmp_path: Path) -> None:
    run = Watched(tmp_path, REFUSE)
    flown = run.fly(fault, 18, 40)
    assert flown.ending is Ending.EVIDENCE_LOST
    assert len(flown.effects("succeeded")) >= 2, "the leg went on to its end"
    assert run.skills[:3] == ["takeoff", "goto", "hover"]
    assert "return_home" not in [record["detail"] for record in flown.effects("dispatched") if record["kind"] == 0]
    contingency = [second for second, _ in run.sent[3:]]
    assert 29 <= contingency[0] < 30, "at the step's deadline"
    verified(flown)


@pytest.mark.slow
@pytest.mark.parametrize("fault", faults("read-only"))
def test_mission_continues_once_records_are_written(fault: Fault, tmp_path: Path) -> None:
    run = Watched(tmp_path, REFUSE)
    flown = run.fly(fault, 18, 28)
    assert flown.ending is Ending.COMPLETED
    home = next(second for second, skill in run.sent if skill == "return_home")
    assert 28 <= home < 29.2
    (gap,), (over,) = flown.effects("gap"), flown.effects("gap-over")
    assert gap["seq"] < over["seq"]
    verified(flown)


@pytest.mark.parametrize("without", [LAND, REFUSE])
def test_no_step_begins_on_the_ground_without_its_record(without: WithoutEvidence, tmp_path: Path) -> None:
    run = Watched(tmp_path, without)
    flown = run.fly(refuses(errno.EROFS), 0.1, 100)
    assert (flown.ending, run.skills) in (
        (Ending.EVIDENCE_LOST, []), (Ending.EVIDENCE_LOST, ["emergency_land"]),
    )  # fmt: skip


@pytest.mark.parametrize("without", [LAND, REFUSE])
def test_climb_waits_for_a_successful_sync(without: WithoutEvidence, tmp_path: Path) -> None:
    run = Watched(tmp_path, without)
    flown = run.fly(fails_to_sync, 0.1, 100)
    assert flown.ending is Ending.EVIDENCE_LOST
    assert "takeoff" not in run.skills
    assert len(flown.effects("gap")) == 1
    assert not flown.effects("gap-over"), "what a disk says after that is not believed"


@pytest.mark.slow
def test_failed_sync_in_the_air_is_permanent(tmp_path: Path) -> None:
    run = Watched(tmp_path, REFUSE)
    flown = run.fly(fails_to_sync, 18, 21)
    assert flown.ending is Ending.EVIDENCE_LOST
    assert run.skills[:3] == ["takeoff", "goto", "hover"]
    assert not flown.effects("gap-over")


@pytest.mark.slow
def test_short_writes_have_no_effect(tmp_path: Path) -> None:
    def takes_seven(sink: DiskSink) -> None:
        sink.disk.step = 7

    run = Watched(tmp_path, LAND)
    flown = run.fly(takes_seven, 0, 1_000)
    assert flown.ending is Ending.COMPLETED
    assert not flown.effects("gap")
    verified(flown)


@pytest.mark.slow
def test_short_disk_stall_is_noted_and_a_long_one_is_a_failure(tmp_path: Path) -> None:
    flown = Watched(tmp_path, LAND).fly(hangs, 18, 23)
    assert flown.ending is Ending.COMPLETED
    (noted,) = [each for each in flown.effects("noted") if "reach the disk" in each["detail"]]
    assert noted["detail"] == "a write did not reach the disk within 1000 ms"
    verified(flown)
    (tmp_path / "log.jsonl").unlink()
    flown = Watched(tmp_path, LAND).fly(hangs, 18, 40)
    assert flown.ending is Ending.EVIDENCE_LOST
    (gap,) = flown.effects("gap")
    assert gap["detail"] == "the disk has not answered for 5 s"
    verified(flown)


@pytest.mark.slow
def test_step_is_not_sent_before_its_record_is_written(tmp_path: Path) -> None:
    run = Watched(tmp_path, LAND)
    flown = run.fly(hangs, 15, 60)
    assert "goto" not in run.skills
    (failed, *_) = [str(record["detail"]) for record in flown.effects("failed")]
    assert failed.startswith("late: nothing was sent: this computer was too busy, or its disk too slow")
    verified(flown)


class Machine:
    """Monotonic time and UTC of a machine whose time of day is set."""

    def __init__(self) -> None:
        self.now_us, self.set_us = 0, 0

    def __call__(self) -> tuple[int, int]:
        return self.now_us, 1_750_000_000_000_000 + self.now_us + self.set_us


@pytest.mark.slow
def test_clock_step_is_recorded_and_moves_no_record(tmp_path: Path) -> None:
    run, machine = Watched(tmp_path, LAND), Machine()
    steps = StepWatch(machine)

    def each(flight: Flight) -> Sequence[Event]:
        second = machine.now_us / case.S
        machine.now_us = flight.clock.elapsed_us
        if second < 20 <= machine.now_us / case.S:
            machine.set_us += 3_600 * case.S
        if 30 <= machine.now_us / case.S < 33:
            machine.set_us -= 150_000  # at each turn
        return steps.events(flight.clock.now())

    flown = run.flight.fly(each)
    assert flown.ending is Ending.COMPLETED
    first, *others = flown.effects("clock-stepped")
    assert first["detail"] == "+3600000000 us"
    assert 1 <= len(others) <= 4
    assert sum(int(each["detail"].removesuffix(" us")) for each in others) == machine.set_us - 3_600 * case.S
    assert all(after["at_us"] - before["at_us"] >= case.S for before, after in pairwise(others))
    verified(flown)


def test_small_clock_difference_is_not_a_step() -> None:
    machine = Machine()
    steps, now = StepWatch(machine), Now(0, case.flat.ISSUED, 0)
    for second in range(1, 50):
        machine.now_us, machine.set_us = second * case.S, 500 * second
        assert steps.events(now) == []
