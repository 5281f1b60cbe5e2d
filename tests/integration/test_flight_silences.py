"""Silences of the link, in one or both directions, in every stage of a flight: the vehicle does not land on the spot.

The vehicle flies on under its last command. After the silence its first messages come in any order, and no condition is
checked before the state is fresh. A silence longer than the policy's `without link` ends the mission at home.
"""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from rtshcua import library
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.evidence.report import LogVerdict
from rtshcua.model.faults import Direction, LinkReorder, LinkSilence, WindStep
from rtshcua.onboard.ports import Ending, Event
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import RunStage
from rtshcua.virtual.vehicle import TICK_US
from virtual import case
from virtual.flight import Flight, Flown
from virtual.shipped import equipped, sealed, shipped, simulated

FLAVOURS = ("px4", "ardupilot")
SECONDS = (0.5, 1.0, 2.5, 3.5, 5.0, 8.0, 20.0, 45.0)
#: from this long on, the shipped policies give the mission up
GIVEN_UP_S = 30.0
#: us that each stage is under way when the silence begins; it waits for little more than a second
UNDER_WAY, WAITED = 2 * case.S, case.S // 2


def running(step: int) -> Callable[[Flight], bool]:
    def is_there(flight: Flight) -> bool:
        view = flight.runtime.view(flight.clock.now())
        return view.stage is RunStage.RUNNING and view.step == step

    return is_there


def falling(skill: str) -> Callable[[Flight], bool]:
    def is_there(flight: Flight) -> bool:
        view = flight.runtime.view(flight.clock.now())
        return view.stage is RunStage.FALLING and view.contract == skill

    return is_there


def waiting(flight: Flight) -> bool:
    return flight.runtime.view(flight.clock.now()).stage is RunStage.WAITING


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


def fly(flavour: str, stage: str, seconds: float, way: Direction) -> Flown:
    """The standard mission; what falls back does so for the wind."""
    # heard this often, frames that come in another order are as many apart as they are on a real link
    flight = Flight(equipped("standard"), simulated(flavour, seed=round(seconds * 10)), tick_us=TICK_US)
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


def lands_at_home(flavour: str, stage: str, seconds: float, way: Direction) -> None:
    flown = fly(flavour, stage, seconds, way)
    audit = flown.audit()
    assert audit.report.verdict is LogVerdict.VERIFIED, audit.report
    told = f"{flown.ending} {flown.dispatched()} {[record['detail'] for record in flown.effects('violated')]}"
    assert not flown.effects("taken-over"), told
    if stage == "waiting":
        assert flown.ending in (Ending.COMPLETED, Ending.LINK_LOST), told
        return
    assert "emergency_land" not in flown.dispatched(), told
    truth = flown.vehicle.simulation.truth()
    assert not truth.armed, told
    assert abs(truth.north_mm) + abs(truth.east_mm) < 5_000, told
    if "link" in stage or (seconds > GIVEN_UP_S + 2 and stage != "return" and way is not Direction.UP):
        assert flown.ending is Ending.ABORTED, told
    else:
        assert flown.ending in (Ending.COMPLETED, Ending.ABORTED), told
    if seconds <= 5 and "link" not in stage:
        assert flown.ending is Ending.COMPLETED, told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "stage", "seconds", "way"),
    [
        ("px4", "return link", 8.0, Direction.UP),
        ("ardupilot", "survey", 45.0, Direction.DOWN),
        ("px4", "hover link", 5.0, Direction.BOTH),
    ],
)
def test_silence_does_not_land_on_the_spot(flavour: str, stage: str, seconds: float, way: Direction) -> None:
    lands_at_home(flavour, stage, seconds, way)


class Killed(Exception):
    """The program was, in the air."""


def resumed(flavour: str, seconds: float) -> Flown:
    """Killed on a leg, and restarted while the uplink is silent for so long."""
    first = Flight(shipped("standard"), simulated(flavour), tick_us=TICK_US)
    since_us: list[int] = []

    def each(flight: Flight) -> Sequence[Event]:
        if running(1)(flight):
            since_us.append(flight.clock.elapsed_us)
            if since_us[-1] - since_us[0] > 2 * UNDER_WAY:
                raise Killed
        return ()

    with pytest.raises(Killed):
        first.fly(each)
    vehicle = first.vehicle
    if seconds:
        silence = LinkSilence(vehicle.simulation.now_us, round(seconds * case.S), Direction.UP)
        vehicle.simulation.inject(silence)
    vehicle.driver = Driver(first.loaded.bundle.policy, vehicle.frames, fence=False)
    second = Flight(shipped("standard"), simulated(flavour), tick_us=TICK_US, resumed=True, vehicle=vehicle)
    return second.fly()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "seconds"),
    [
        pytest.param(flavour, seconds, marks=() if tried else pytest.mark.soak)
        for flavour, seconds, tried in (
            ("px4", 0.0, True), ("px4", 10.0, False), ("px4", 150.0, False),
            ("ardupilot", 0.0, False), ("ardupilot", 10.0, True), ("ardupilot", 150.0, False),
        )
    ],
)  # fmt: skip
def test_restart_in_the_air_returns_home(flavour: str, seconds: float) -> None:
    """Regression: PX4's readings were checked before they had an age, and the vehicle landed on the spot."""
    flown = resumed(flavour, seconds)
    truth = flown.vehicle.simulation.truth()
    assert flown.dispatched() == ["hover", "return_home"]
    assert (flown.ending, truth.armed) == (Ending.ABORTED, False)
    assert abs(truth.north_mm) + abs(truth.east_mm) < 5_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "stage"),
    [
        pytest.param(flavour, stage, marks=() if (flavour, stage) == ("px4", "return") else pytest.mark.soak)
        for flavour, stage in product(FLAVOURS, STAGES)
    ],
)
def test_deaf_vehicle_is_not_awaited_forever(flavour: str, stage: str) -> None:
    """Without a failsafe of its own it keeps its last command until its battery is low."""
    flown = fly(flavour, stage, 1e5, Direction.UP)
    assert flown.audit().report.verdict is LogVerdict.VERIFIED
    told = f"{flown.ending} {flown.dispatched()}"
    assert flown.ending in (Ending.COMPLETED, Ending.ABORTED, Ending.STOOD_DOWN, Ending.LINK_LOST), told
    last_us = flown.loaded.bundle.policy.vehicle.endurance_us + Limits().silent_us
    assert flown.vehicle.clock.elapsed_us <= 90 * case.S + last_us, told
    if flown.ending is not Ending.LINK_LOST and stage != "waiting":
        assert not flown.vehicle.simulation.truth().armed or flown.effects("taken-over"), told


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize(("seconds", "way"), [*product(SECONDS, Direction)])
def test_silence_in_any_stage_does_not_land_on_the_spot(
    flavour: str, stage: str, seconds: float, way: Direction
) -> None:
    lands_at_home(flavour, stage, seconds, way)


@cache
def hovers() -> bytes:
    """The short mission, with a hover of 20 s: it may last 35 s."""
    text = (library.root() / "missions" / "short.rts").read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        source = Path(folder) / "short.rts"
        source.write_text(text.replace("hover(5 s)", "hover(20 s)"), encoding="utf-8")
        return sealed(source)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "silences", "way"),
    [
        ("px4", (20.0,), Direction.BOTH),
        pytest.param("ardupilot", (20.0,), Direction.BOTH, marks=pytest.mark.soak),
        pytest.param("px4", (5.0, 5.0, 5.0, 5.0), Direction.DOWN, marks=pytest.mark.soak),
        ("ardupilot", (5.0, 5.0, 5.0, 5.0), Direction.DOWN),
        ("px4", (20.0,), Direction.UP),
        pytest.param("ardupilot", (20.0,), Direction.UP, marks=pytest.mark.soak),
    ],
)
def test_hover_continues_after_silences_beyond_its_limit(
    flavour: str, silences: tuple[float, ...], way: Direction
) -> None:
    flight = Flight(hovers(), simulated(flavour))
    began: list[int] = []

    def each(flight: Flight) -> Sequence[Event]:
        if running(1)(flight) and not began:
            at_us = flight.vehicle.simulation.now_us + 4 * case.S
            for seconds in silences:
                began.append(at_us)
                flight.vehicle.simulation.inject(LinkSilence(at_us, round(seconds * case.S), way))
                at_us += round((seconds + 3) * case.S)
        return ()

    flown = flight.fly(each)
    told = [record["detail"] for record in flown.effects("violated")]
    assert (flown.ending, told) == (Ending.COMPLETED, [])
    assert flown.audit().report.verdict is LogVerdict.VERIFIED
