"""Live missions fly on both autopilots, in virtual time: steps supersede running ones in flight, refused ones change
nothing, the vehicle holds between steps, and each log passes both audits.
"""

from collections.abc import Generator, Sequence
from typing import Any

import pytest

from reference import flat_case as flat
from rtshcua.evidence.report import LogVerdict
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, OnInadmissible, Plan
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Action, Ending, Event, Presented, Reply
from rtshcua.virtual.flight import VirtualFlight
from rtshcua.wire.keys import Duty
from rtshcua.wire.replacement import sign_replacement
from virtual import case
from virtual.flight import Flight, Flown
from virtual.shipped import simulated

S, M = case.S, case.M
HIGH = 15 * M
UP = (case.short_steps()[0],)
BASE = case.seal(case.mission(UP))
IDLE_US = 60 * S
#: the limit on replacements in these tests
MOST = 40

Play = Generator[None, None, None]


def go(step: int, east: int, north: int, on: OnInadmissible = OnInadmissible.REPLAN) -> Invocation:
    plan = Plan(MotionKind.FLY, (east, north), HIGH, 0)
    return case.step(step, 1, flat.GOTO, plan, east, north, HIGH, on_inadmissible=on)


def come(step: int) -> Invocation:
    return case.step(step, 1, flat.HOME, Plan(MotionKind.HOME, (0, 0), 0, 0))


def land(step: int) -> Invocation:
    return case.step(step, 1, flat.LAND, Plan(MotionKind.LAND, (), 0, 0))


class Live(Flight):
    """A live flight of a take-off, and what its client hands in."""

    def __init__(self, flavour: str, mode: EnforcementMode = EnforcementMode.SOFTWARE, **more: Any) -> None:
        self.answers: list[str] = []
        self._queue: list[Event] = []
        self._issued_us = case.flat.ISSUED
        super().__init__(BASE, simulated(flavour), mode=mode, idle_us=IDLE_US, attested=False, **more)

    def give(self, kept: int, *steps: Invocation) -> None:
        """Hand a replacement in."""
        self._issued_us += 1
        flying = self.loaded.in_force
        anew = case.mission((*flying.bundle.mission.invocations[:kept], *steps), self._issued_us)
        document = sign_replacement(
            anew, over=flying.bundle, flight=flying.flight, kept=kept, key=case.KEYS[Duty.MISSION]
        )
        self._queue.append(Presented(self.clock.elapsed_us, document, 1))

    def until(self, words: str, times: int = 1) -> Play:
        """Until the log has so many records with these words."""
        while sum(words.encode() in line for line in self.sink.lines[1:]) < times:
            yield

    def wait(self, us: int) -> Play:
        until_us = self.clock.elapsed_us + us
        while self.clock.elapsed_us < until_us:
            yield

    def played(self, play: Play, ending: Ending = Ending.COMPLETED) -> Flown:
        """Fly while the client plays; the log verifies, and nothing is left in the air."""

        def each(_: VirtualFlight) -> Sequence[Event]:
            next(play, None)
            queue, self._queue = self._queue, []
            return queue

        found = self.fly(each, most_s=900)
        assert isinstance(found, Flown)
        assert found.ending is ending, [record.get("event") for record in found.records]
        assert found.audit().report.verdict is LogVerdict.VERIFIED, found.audit().report
        assert not found.vehicle.simulation.truth().in_air
        return found

    def _watch(self, now: Any, events: Sequence[Event], actions: Sequence[Action]) -> None:
        super()._watch(now, events, actions)
        self.answers += [action.slug for action in actions if isinstance(action, Reply)]


def zigzag(flight: Live) -> Play:
    """Up; five legs that supersede each other under way; home, and out again; then home."""
    yield from flight.until('"idle"')
    for step in range(1, 6):
        flight.give(step, go(step, 40 * M, 20 * M if step % 2 else -20 * M))
        yield from flight.until('"obeyed"', step + 1)
        yield from flight.wait(2 * S)
    yield from flight.until('"idle"', 2)
    flight.give(6, come(6))
    yield from flight.until('"obeyed"', 7)
    yield from flight.wait(4 * S)
    flight.give(7, go(7, 30 * M, 0))
    yield from flight.until('"idle"', 3)
    yield from flight.wait(5 * S)
    flight.give(8, come(8))


@pytest.mark.slow
@pytest.mark.parametrize("mode", [EnforcementMode.SOFTWARE, EnforcementMode.PROCESS])
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_legs_supersede_each_other_in_mid_flight(flavour: str, mode: EnforcementMode) -> None:
    flight = Live(flavour, mode)
    found = flight.played(zigzag(flight))
    assert flight.answers == ["accepted"] * 8
    assert [each for each in found.dispatched() if each != "hover"] == [
        "takeoff", *["goto"] * 5, "return_home", "goto", "return_home"
    ]  # fmt: skip
    assert len(found.effects("superseded")) == 5, "four legs and a return"
    for event in ("taken-over", "violated", "failed", "declined", "undecided", "stood-down"):
        assert not found.effects(event), event


def refused(flight: Live) -> Play:
    """A leg; one out of the airspace; one that is fine."""
    yield from flight.until('"idle"')
    flight.give(1, go(1, 60 * M, 0))
    yield from flight.until('"obeyed"', 2)
    yield from flight.wait(S)
    flight.give(2, go(2, 900 * M, 0))
    yield from flight.until('"declined"')
    yield from flight.until('"idle"', 2)
    flight.give(2, go(2, 600 * M, 0))
    yield from flight.until('"declined"', 2)
    yield from flight.wait(5 * S)
    flight.give(2, land(2))


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_refused_leg_changes_nothing(flavour: str) -> None:
    flight = Live(flavour)
    found = flight.played(refused(flight))
    assert [each for each in found.dispatched() if each != "hover"] == ["takeoff", "goto", "emergency_land"]
    assert found.effects("succeeded")[1]["step"] == 1, "the leg was flown to its end"
    assert not found.effects("superseded")
    assert not found.effects("violated")


def early(flight: Live) -> Play:
    """A leg is handed in before the vehicle has left the ground, and one in the climb."""
    yield from flight.until('"dispatched"')
    flight.give(1, go(1, 30 * M, 0))
    yield from flight.until('"superseded"')
    yield from flight.until('"idle"')
    flight.give(2, come(2))


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_leg_that_is_handed_in_on_the_ground_supersedes_the_climb(flavour: str) -> None:
    flight = Live(flavour)
    found = flight.played(early(flight))
    assert [each for each in found.dispatched() if each != "hover"] == ["takeoff", "goto", "return_home"]
    assert not found.effects("taken-over")


def flood(flight: Live) -> Play:
    """A hundred replacements a second, each for the mission in force."""
    yield from flight.until('"idle"')
    step = 1
    while flight.answers.count("too-many") < 5:
        for _ in range(5):
            flight.give(step, go(step, 40 * M, (step % 40) * M))
        yield
        step = len(flight.loaded.in_force.bundle.mission.invocations)
    yield from flight.until('"idle"', 2)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_agent_that_replans_all_the_time_is_stopped_at_the_limit_and_comes_home(
    flavour: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtshcua.decision.session.MAX_REPLACEMENTS", MOST)
    flight = Live(flavour)
    found = flight.played(flood(flight), Ending.ABORTED)
    assert flight.answers.count("accepted") == MOST
    assert len(found.effects("superseded")) == MOST - 1
    assert not found.effects("taken-over")
    assert found.effects("idle-over"), "no further step can come, so the contingency flies"


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_hold_between_steps_is_left_when_the_charge_is_needed(flavour: str) -> None:
    flight = Live(flavour)

    def drained() -> Play:
        yield from flight.until('"idle"')
        flight.give(1, go(1, 60 * M, 0))
        yield from flight.until('"idle"', 2)
        flight.vehicle.simulation._autopilot.battery.cap(0.24)

    found = flight.played(drained(), Ending.ABORTED)
    (violated,) = found.effects("violated")
    assert violated["detail"].startswith("degrade")
    assert found.dispatched()[-1] == "return_home"


def hurried(flight: Live, ticks: int) -> Play:
    """Steps that supersede others some turns after these were sent, before their modes can show."""
    yield from flight.until('"hover"')
    step = 1
    for _ in range(3):
        for new in (go(step, 40 * M, 0), come(step + 1), go(step + 2, 30 * M, 10 * M), come(step + 3)):
            flight.give(new.step, new)
            for _ in range(ticks):
                yield
        yield from flight.wait(3 * S)
        step += 4
        flight.give(step, go(step, 20 * M, 20 * M))
        yield from flight.until('"idle"', step // 5 + 1)
        yield from flight.until('"hover"', step // 5 + 1)
        step += 1
    flight.give(step, come(step))


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [1, 4, 10])
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_mode_of_a_superseded_command_that_shows_late_is_no_takeover(flavour: str, ticks: int) -> None:
    flight = Live(flavour, tick_us=10_000, wait_us=10_000)
    found = flight.played(hurried(flight, ticks))
    assert not found.effects("taken-over")
    assert not found.effects("failed")
