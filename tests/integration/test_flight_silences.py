"""A link that is silent for a while, both ways or one, in every stage of a flight: nothing lands on the spot.

The vehicle flies on under its standing command. When it is heard again its first messages come in any order, and
nothing is judged before its state is fresh. A silence longer than the policy's `without link` ends the mission at home.
"""

from collections.abc import Callable, Sequence
from itertools import product

import pytest

from rtshcua.evidence.report import Verdict
from rtshcua.model.faults import LinkReorder, LinkSilence, Way, WindStep
from rtshcua.onboard.ports import Ending, Event
from rtshcua.onboard.runtime.view import Stage
from rtshcua.virtual.vehicle import TICK_US
from virtual import case
from virtual.flight import Flight, Flown
from virtual.shipped import shipped, simulated

FLAVOURS = ("px4", "ardupilot")
SECONDS = (0.5, 1.0, 2.5, 3.5, 5.0, 8.0, 20.0, 45.0)
#: from this long on, the shipped policies give the mission up
GIVEN_UP_S = 30.0
#: us that each stage is under way when the silence begins; it waits for little more than a second
UNDER_WAY, WAITED = 2 * case.S, case.S // 2


def running(step: int) -> Callable[[Flight], bool]:
    def is_there(flight: Flight) -> bool:
        view = flight.runtime.view(flight.clock.now())
        return view.stage is Stage.RUNNING and view.step == step

    return is_there


def falling(skill: str) -> Callable[[Flight], bool]:
    def is_there(flight: Flight) -> bool:
        view = flight.runtime.view(flight.clock.now())
        return view.stage is Stage.FALLING and view.contract == skill

    return is_there


def waiting(flight: Flight) -> bool:
    return flight.runtime.view(flight.clock.now()).stage is Stage.WAITING


STAGES: dict[str, Callable[[Flight], bool]] = {
    "waiting": waiting,
    "takeoff": running(0),
    "leg": running(1),
    "survey": running(2),
    "hover": running(4),
    "return": running(5),
    "hover link": falling("hover"),
    "return link": falling("return_home"),
}


def fly(flavour: str, stage: str, seconds: float, way: Way) -> Flown:
    """The standard mission; what falls back does so for the wind."""
    # heard this often, frames that come in another order are as many apart as they are on a real link
    flight = Flight(shipped("standard"), simulated(flavour, seed=round(seconds * 10)), tick_us=TICK_US)
    since_us: list[int] = []
    blown: list[bool] = []
    under_way = WAITED if stage == "waiting" else UNDER_WAY

    def each(flight: Flight) -> Sequence[Event]:
        simulation, now_us = flight.vehicle.simulation, flight.clock.elapsed_us
        if "link" in stage and not blown and running(1)(flight):
            simulation.inject(WindStep(simulation.now_us + case.S, 13_000, 270))
            blown.append(True)
        if STAGES[stage](flight) and len(since_us) < 2:
            since_us.append(now_us) if not since_us else None
            if now_us - since_us[0] >= under_way and len(since_us) == 1:
                since_us.append(now_us)
                for_us = round(seconds * case.S)
                simulation.inject(LinkSilence(simulation.now_us, for_us, way))
                simulation.inject(LinkReorder(simulation.now_us + for_us, 5_000, case.S))
        return ()

    flown = flight.fly(each)
    assert len(since_us) == 2, "the stage was reached"
    return flown


def lands_at_home(flavour: str, stage: str, seconds: float, way: Way) -> None:
    flown = fly(flavour, stage, seconds, way)
    audit = flown.audit()
    assert audit.report.verdict is Verdict.VERIFIED, audit.report
    told = f"{flown.ending} {flown.dispatched()} {[record['detail'] for record in flown.effects('violated')]}"
    assert not flown.effects("taken-over"), told
    if stage == "waiting":
        assert flown.ending in (Ending.COMPLETED, Ending.LINK_LOST), told
        return
    assert "emergency_land" not in flown.dispatched(), told
    truth = flown.vehicle.simulation.truth()
    assert not truth.armed, told
    assert abs(truth.north_mm) + abs(truth.east_mm) < 5_000, told
    if "link" in stage or (seconds > GIVEN_UP_S + 2 and stage != "return" and way is not Way.UP):
        assert flown.ending is Ending.ABORTED, told
    else:
        assert flown.ending in (Ending.COMPLETED, Ending.ABORTED), told
    if seconds <= 5 and "link" not in stage:
        assert flown.ending is Ending.COMPLETED, told


@pytest.mark.parametrize(
    ("flavour", "stage", "seconds", "way"),
    [
        ("px4", "return link", 8.0, Way.UP),
        ("ardupilot", "survey", 45.0, Way.DOWN),
        ("px4", "hover link", 5.0, Way.BOTH),
    ],
)
def test_a_silence_lands_nothing_on_the_spot(flavour: str, stage: str, seconds: float, way: Way) -> None:
    lands_at_home(flavour, stage, seconds, way)


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize(("seconds", "way"), [*product(SECONDS, Way)])
def test_no_silence_in_any_stage_lands_on_the_spot(flavour: str, stage: str, seconds: float, way: Way) -> None:
    lands_at_home(flavour, stage, seconds, way)
