"""A takeover and a crash end the run at once, whatever else happens at the same moment.

A hold that fails is not left flying.
"""

from collections.abc import Callable
from itertools import permutations
from typing import Any

import pytest
from msgspec.structs import replace

from reference.flat_case import CONTRACTS, GOTO, HOVER, INSPECT, MIN, MISSION, OBSTACLE, POLICY, WIND, M
from reference.world import FakeVehicle, Run, assert_audited, loaded, renewed
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.onboard.ports import (
    AirState,
    CommandFailed,
    Crashed,
    Ending,
    Event,
    EvidenceFailed,
    Interrupted,
    LinkBack,
    LinkLost,
    Readings,
    StatusText,
    Succeeded,
    TakenOver,
)

PILOT = TakenOver(0, "POSCTL")
CRASH = Crashed(0, "upside down at 3 m")
OF = loaded()


def start(**more: Any) -> Run:
    return Run(renewed(OF), **more)


def waiting() -> Run:
    return start(ready=False)


def deferred_on_the_ground() -> Run:
    return start(vehicle=FakeVehicle(silent={WIND}))


def taking_off() -> Run:
    return start()


def running() -> Run:
    return start().until_flies("inspect_area")


def holding() -> Run:
    run = start().until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    return run.until_flies("hover")


def falling() -> Run:
    run = start().until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    return run.until_flies("hover")


def landing() -> Run:
    run = falling()
    return run.until_flies("return_home")


def coming_home() -> Run:
    return start().until_flies("return_home")


def silent() -> Run:
    run = running()
    run.vehicle.mute = True
    run.tick(LinkLost(0))
    return run


STAGES = (waiting, deferred_on_the_ground, taking_off, running, holding, falling, landing, coming_home, silent)

#: events of the same moment; each alone could change or end the run
WITH: dict[str, Callable[[int], tuple[Event, ...]]] = {
    "succeeded": lambda token: (Succeeded(0, token),),
    "failed": lambda token: (CommandFailed(0, token, "no-effect"),),
    "landed": lambda token: (AirState(0, False, False),),
    "landed and succeeded": lambda token: (AirState(0, False, False), Succeeded(0, token)),
    "interrupted": lambda token: (Interrupted(0),),
    "evidence": lambda token: (EvidenceFailed(0, "disk full"),),
    "link": lambda token: (LinkLost(0), LinkBack(0)),
    "violation": lambda token: (Readings(600_000_000, ((WIND, 12 * M),)), Readings(600_000_001, ((WIND, 4 * M),))),
}


#: every such event in every stage, once with a takeover or a crash; the other of the two is for soak
TRIED = [
    pytest.param(stage, along, last, marks=() if (at + row + crash) % 2 else pytest.mark.soak)
    for at, stage in enumerate(STAGES)
    for row, along in enumerate(WITH)
    for crash, last in enumerate((PILOT, CRASH))
]


@pytest.mark.slow
@pytest.mark.parametrize(("stage", "along", "last"), TRIED)
def test_takeover_outweighs_simultaneous_events(stage: Callable[[], Run], along: str, last: Event) -> None:
    template = stage()
    commands = len(template.vehicle.commands)
    batch = (last, *WITH[along](template.vehicle.commands[-1].token if commands else 0))
    for order in permutations(batch):
        run = stage()
        before = len(run.actions)
        run.step(*order)
        crashed = last is CRASH
        assert run.ending is (Ending.CRASHED if crashed else Ending.STOOD_DOWN)
        assert len(run.vehicle.commands) == commands, "nothing is sent any more"
        assert run.vehicle.released
        names = [name for name in run.events if name in ("crashed", "taken-over", "stood-down")]
        assert names == ["crashed" if crashed else "taken-over", "stood-down"]
        assert [type(action).__name__ for action in run.actions[before:]].count("End") == 1
        assert run.step(Succeeded(0, 1), AirState(0, False, False)) == []


@pytest.mark.parametrize("order", [(PILOT, CRASH), (CRASH, PILOT)])
def test_a_crash_is_graver_than_a_takeover(order: tuple[Event, ...]) -> None:
    run = running()
    run.step(*order)
    assert run.ending is Ending.CRASHED
    assert_audited(run)


def test_crash_record_names_its_evidence_and_last_state() -> None:
    run = running()
    run.step(Crashed(0, "on its side"), StatusText(0, 2, "SIM Hit ground at 5.2 m/s"))
    details = {str(record["event"]): record["detail"] for record in run.records if record["type"] == "effect"}
    assert details["said"] == "2: SIM Hit ground at 5.2 m/s", "what the vehicle said of it is not lost"
    assert details["crashed"] == "on its side"
    assert details["stood-down"] == "last seen in the air"
    assert_audited(run)


def test_takeover_seen_after_command_is_respected() -> None:
    """The next step was dispatched in the very step before; the pilot's mode shows only now."""
    run = start().until_flies("goto")
    run.tick()
    run.step(Succeeded(0, run.vehicle.commands[-1].token))
    assert run.flown[-1] == "inspect_area"
    run.step(PILOT)
    assert run.ending is Ending.STOOD_DOWN
    for _ in range(100):
        run.tick()
    assert run.flown[-1] == "inspect_area"


# ------------------------------------------------------------------------------------------- a hold that fails


def held(*, chain: tuple[int, ...] = ()) -> Run:
    """A run that holds for its third step, which waits without limit for an obstacle's distance."""
    fallback = tuple(each for each in CONTRACTS[INSPECT].fallback if each.skill in chain or not chain)
    patient = replace(CONTRACTS[INSPECT], deadline_us=10 * MIN, fallback=fallback)
    contracts = tuple(patient if each is CONTRACTS[INSPECT] else each for each in CONTRACTS)
    policy = replace(POLICY, contracts=contracts)
    invocations = tuple(
        replace(one, contract=patient, on_inadmissible=OnInadmissible.HOLD) if one.skill == INSPECT else one
        for one in MISSION.invocations
    )
    run = Run(renewed(loaded(policy, replace(MISSION, invocations=invocations)))).until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    return run.until_flies("hover")


@pytest.mark.parametrize("reason", ["did-not-stop", "no-progress", "refused"])
def test_a_hold_between_steps_that_fails_flies_the_steps_chain(reason: str) -> None:
    run = held()
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, reason))
    assert run.flown[-1] == "return_home", "another hold would fail as this one did"
    assert run.decisions[-1] == (1, 2, 1, "allow", "admitted")
    run.vehicle.values[OBSTACLE] = 20 * M
    assert run.until_over().ending is Ending.ABORTED
    assert run.flown[-1] == "return_home"
    assert_audited(run)


def test_contingency_skips_holds_after_a_failed_hold() -> None:
    run = held(chain=(HOVER,))
    run.vehicle.fails = {"return_home"}
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "did-not-stop"))
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "return_home", "emergency_land"]
    assert run.ending is Ending.ABORTED


def test_late_report_about_other_command_is_not_a_failed_hold() -> None:
    run = held()
    run.tick(CommandFailed(0, run.vehicle.commands[-2].token, "did-not-stop"))
    for _ in range(20):
        run.tick()
    assert run.flown[-1] == "hover"


@pytest.mark.parametrize("reason", ["did-not-stop", "no-progress"])
def test_a_link_that_does_not_stop_or_get_on_is_followed_by_the_next(reason: str) -> None:
    run = falling()
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, reason))
    assert run.flown[-1] == "return_home"
    assert CONTRACTS[GOTO].fallback[1].skill == MISSION.invocations[-1].skill
