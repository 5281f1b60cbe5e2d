"""Whole flights in virtual time: the shipped missions, with and without faults; `verify-log` accepts every log."""

import re
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import pytest
from msgspec.structs import replace

from rtshcua.codec.frames import Codec
from rtshcua.evidence.report import LogVerdict
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Ending, Event, Interrupted
from rtshcua.simulation.fault_syntax import parse_fault
from virtual import case
from virtual.copying import copied
from virtual.flight import Flight, Flown
from virtual.sampling import each_once
from virtual.shipped import NAMES, equipped, shipped, simulated

STEPS = {"short": 3, "standard": 6, "extended": 12, "one_bridge": 6}
FLAVOURS = ("px4", "ardupilot")
#: where nothing depends on the autopilot but what its own tests hold it to, `make test` flies one of them
PX4_OR_SOAK = ("px4", pytest.param("ardupilot", marks=pytest.mark.soak))
ARDUPILOT_OR_SOAK = ("ardupilot", pytest.param("px4", marks=pytest.mark.soak))
#: until here all flights of the standard mission are the same: faults begin later
SHARED_US = 49 * case.S


def verified(flown: Flown) -> Flown:
    """The flight, whose log proves itself; it ended on the ground unless somebody else took it, or nobody hears it."""
    audit = flown.audit()
    assert audit.report.verdict is LogVerdict.VERIFIED, audit.report
    assert audit.derived == sum(record["type"] == "decision" for record in flown.records)
    if flown.ending not in (Ending.STOOD_DOWN, Ending.LINK_LOST):
        assert not flown.vehicle.simulation.truth().in_air
    return flown


def fly(name: str, flavour: str, *faults: str, **more: Any) -> Flown:
    config = simulated(flavour, faults=tuple(parse_fault(fault) for fault in faults))
    return verified(Flight(shipped(name), config, **more).fly())


@cache
def begun(flavour: str, fence: bool) -> Flight:
    flight = Flight(equipped("standard"), simulated(flavour), fence=fence)
    while flight.clock.elapsed_us < SHARED_US:
        assert flight.loop.turn() is None
    return flight


def under_way(flavour: str, *faults: str, fence: bool = True) -> Flight:
    """The standard mission at 49 s, with faults that come after that."""
    flight = copied(begun(flavour, fence))
    for fault in faults:
        flight.vehicle.simulation.inject(parse_fault(fault))
    return flight


def fly_on(flavour: str, *faults: str, fence: bool = True) -> Flown:
    return verified(under_way(flavour, *faults, fence=fence).fly())


class Short(NamedTuple):
    """The short mission from its beginning to its end, and what ground stations were told meanwhile."""

    flown: Flown
    heard: tuple[str, ...]


@cache
def short(flavour: str) -> Short:
    flight, heard = Flight(shipped("short"), simulated(flavour)), []

    def listen(frame: bytes) -> bool:
        heard.extend(each.message.text for each in Codec(0, 0).parse(frame) if each.name == "STATUSTEXT")
        return False

    flight.vehicle.lose = listen
    return Short(verified(flight.fly()), tuple(heard))


def completed(flown: Flown, name: str) -> None:
    assert flown.ending is Ending.COMPLETED
    assert [(outcome, reason) for _, outcome, reason in flown.decisions()] == [("allow", "admitted")] * STEPS[name]
    assert len(flown.effects("succeeded")) == STEPS[name]
    truth = flown.vehicle.simulation.truth()
    assert abs(truth.north_mm) + abs(truth.east_mm) < 2_000


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_the_short_mission_completes(flavour: str) -> None:
    completed(short(flavour).flown, "short")


@pytest.mark.parametrize("flavour", ARDUPILOT_OR_SOAK)
def test_the_standard_mission_completes(flavour: str) -> None:
    completed(fly_on(flavour), "standard")


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("short", "standard")])
def test_the_longer_missions_complete(name: str, flavour: str) -> None:
    completed(fly(name, flavour), name)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_decisions_reach_ground_stations_and_vehicle_texts_the_log(flavour: str) -> None:
    flown, heard = short(flavour)
    assert heard == ("allow takeoff(altitude = 10 m)", "allow hover(time = 5 s)", "allow return_home()")
    assert [re.split(r" \(|: ", record["detail"])[0] for record in flown.effects("noted")] == [
        "its fence was set to the policy's airspace",
        "streams",
    ]
    said = [record["detail"] for record in flown.effects("said")]
    assert ("6: Arming motors" in said) == (flavour == "ardupilot"), "PX4 says nothing to an onboard controller"


@pytest.mark.slow
def test_equal_flights_leave_equal_logs() -> None:
    fault = parse_fault("battery,at=12s,level=24%")
    flight = Flight(shipped("short"), simulated("px4"))
    while flight.clock.elapsed_us < 10 * case.S:
        assert flight.loop.turn() is None
    copy = copied(flight)
    for each in (flight, copy):
        each.vehicle.simulation.inject(fault)
    whole = fly("short", "px4", "battery,at=12s,level=24%")
    assert whole.effects("violated")
    assert verified(flight.fly()).lines == verified(copy.fly()).lines == whole.lines


FALLBACKS = {
    "battery,at=50s,level=24%": ["return_home"],
    "wind,at=50s,speed=12m/s,from=270deg": ["hover", "return_home"],
    "link-quality,at=50s,quality=20%": ["hover", "return_home"],
    "obstacle,at=50s,distance=2m": ["hover", "return_home"],
}


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "flavour"), each_once(FALLBACKS, FLAVOURS))
def test_breach_in_flight_flies_the_fallback_chain(fault: str, flavour: str) -> None:
    flown = fly_on(flavour, fault)
    assert flown.ending is Ending.ABORTED
    assert flown.effects("violated")
    assert flown.dispatched() == ["takeoff", "goto", "inspect_area", *FALLBACKS[fault]]


@pytest.mark.slow
@pytest.mark.parametrize("flavour", PX4_OR_SOAK)
def test_link_dropout_does_not_end_the_flight(flavour: str) -> None:
    """Regression: a silence of 5 s landed the vehicle on the spot despite good charge and position (recorded)."""
    config = case.simulated(flavour, faults=(parse_fault("link-silence,at=18s,for=5s"),))
    flown = verified(Flight(case.seal(case.mission(case.short_steps())), config).fly())
    assert flown.dispatched() == ["takeoff", "goto", "return_home"]
    assert flown.ending is Ending.COMPLETED
    assert len(flown.effects("link-lost")) == len(flown.effects("link-back")) == 1


PILLAR = "pillar,at=0s,north=118.5m,east=140m,radius=2m,height=28m"


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ARDUPILOT_OR_SOAK)
def test_survey_stops_before_an_obstacle(flavour: str) -> None:
    flown = fly_on(flavour, PILLAR)
    assert flown.dispatched() == ["takeoff", "goto", "inspect_area", "hover", "return_home"]
    (violated,) = flown.effects("violated")
    assert violated["detail"].startswith("obstacle.distance > 3 m + speed * 2 s: obstacle.distance = ")
    assert not flown.vehicle.simulation.truth().crashed


JUMP = "gps-jump,at=50s,north=300m,east=0m"
#: farther than a return comes in its time
FAR_JUMP = "gps-jump,at=50s,north=1000m,east=0m"
JUMPED = ["takeoff", "goto", "inspect_area", "hover", "return_home", "emergency_land"]


@pytest.mark.slow
@pytest.mark.parametrize("flavour", PX4_OR_SOAK)
def test_position_jump_out_of_the_airspace_flies_the_fallback_chain(flavour: str) -> None:
    flown = fly_on(flavour, FAR_JUMP, fence=False)
    assert flown.ending is Ending.ABORTED
    assert flown.dispatched() == JUMPED


#: how the record of a takeover begins where the vehicle's state is critical
FAILSAFE = "by its own failsafe: "


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_own_fence_of_the_autopilot_takes_over(flavour: str) -> None:
    """ArduCopter returns. PX4 holds, in the mode that it is in already: the vehicle's state is critical."""
    flown = fly_on(flavour, JUMP)
    assert flown.ending is Ending.STOOD_DOWN
    (taken,) = flown.effects("taken-over")
    assert taken["detail"] == {"px4": f"{FAILSAFE}the vehicle's state is critical", "ardupilot": "RTL"}[flavour]


#: what may show it first on PX4, and on ArduCopter: a landing shows in the target, or in the landed state, before the
#: mode is told. A pilot's has none of the words of a failsafe.
TAKEN = {
    "pilot,at=50s": ({"Position"}, {"POSHOLD"}),
    "gps-loss,at=50s": ({f"{FAILSAFE}Land", f"{FAILSAFE}landing"}, {f"{FAILSAFE}LAND", f"{FAILSAFE}landing"}),
    "battery,at=50s,level=3%": (
        {f"{FAILSAFE}Land", f"{FAILSAFE}landing", f"{FAILSAFE}another target"},
        {f"{FAILSAFE}LAND", f"{FAILSAFE}landing"},
    ),
}


@pytest.mark.parametrize(("fault", "flavour"), each_once(TAKEN, FLAVOURS))
def test_takeover_ends_the_run(fault: str, flavour: str) -> None:
    flown = fly_on(flavour, fault)
    assert flown.ending is Ending.STOOD_DOWN
    (taken,) = flown.effects("taken-over")
    assert taken["detail"] in TAKEN[fault][FLAVOURS.index(flavour)]
    told = [record["event"] for record in flown.records if record["type"] == "effect"]
    last = [event for event in told if event != "boundary"][-3:]
    assert last == ["taken-over", "released", "stood-down"]


@pytest.mark.slow
@pytest.mark.parametrize("flavour", PX4_OR_SOAK)
def test_silent_vehicle_is_lost_after_its_endurance(flavour: str) -> None:
    """This one flies for 3 minutes; what ships says 18, of which all but the beginning is silence."""
    policy, fault = case.policy(), parse_fault("link-silence,at=20s")
    policy = replace(policy, vehicle=replace(policy.vehicle, endurance_us=ENDURANCE_US))
    flight = Flight(case.seal(case.mission(case.short_steps()), policy), case.simulated(flavour, faults=(fault,)))
    flown = verified(flight.fly())
    assert flown.ending is Ending.LINK_LOST
    (lost,) = flown.effects("link-lost")
    assert ENDURANCE_US < flown.records[-1]["at_us"] - lost["at_us"] < ENDURANCE_US + 60 * case.S


ENDURANCE_US = 3 * case.MIN


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_silent_vehicle_of_the_shipped_mission_is_lost(flavour: str) -> None:
    flown = fly_on(flavour, "link-silence,at=50s")
    assert flown.ending is Ending.LINK_LOST
    assert flown.effects("link-lost")


POOR_LINKS = ("link-loss,at=5s,loss=20%", "link-delay,at=0s,delay=400ms", "gps-loss,at=20s,for=700ms")


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "flavour"), each_once(POOR_LINKS, FLAVOURS))
def test_poor_link_is_survived(fault: str, flavour: str) -> None:
    """Up, one leg, home: each kind of command is lost, late, or lacks its fix."""
    config = case.simulated(flavour, faults=(parse_fault(fault),))
    flight = Flight(case.seal(case.mission(case.short_steps())), config)
    assert verified(flight.fly()).ending is Ending.COMPLETED


@pytest.mark.soak
@pytest.mark.parametrize(("fault", "flavour"), [*product(POOR_LINKS, FLAVOURS)])
def test_standard_mission_survives_a_poor_link(fault: str, flavour: str) -> None:
    assert fly("standard", flavour, fault).ending is Ending.COMPLETED


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ARDUPILOT_OR_SOAK)
def test_lost_fix_stops_and_recovered_fix_returns_home(flavour: str) -> None:
    """While the position estimate is valid, the vehicle does not land on the spot."""
    flown = fly_on(flavour, "gps-loss,at=50s,for=3s")
    assert flown.ending is Ending.ABORTED
    assert [record["detail"].partition(":")[0] for record in flown.effects("violated")] == ["gps.fix >= fix_3d"]
    assert flown.dispatched()[-2:] == ["hover", "return_home"]


@pytest.mark.slow
@pytest.mark.parametrize("level", ["20%", "6%"])
def test_low_battery_on_the_ground_prevents_the_start(level: str) -> None:
    flown = fly("short", "px4", f"battery,at=0s,level={level}")
    assert flown.ending is Ending.REFUSED
    assert flown.dispatched() == []


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [0, 1, 3, 10, 60, pytest.param(200, marks=pytest.mark.soak)])
def test_interrupt_at_any_time_lands(at_s: int) -> None:
    pressed = []

    def press(flight: Flight) -> list[Event]:
        if pressed or flight.clock.elapsed_us < at_s * case.S:
            return []
        pressed.append(True)
        return [Interrupted(flight.clock.now().monotonic_us)]

    flight = Flight(shipped("standard"), simulated("px4")) if at_s * case.S < SHARED_US else under_way("px4")
    flown = verified(flight.fly(press))
    assert flown.ending is Ending.INTERRUPTED


@pytest.mark.slow
def test_full_disk_lands_and_loses_no_record() -> None:
    def fill(flight: Flight) -> list[Event]:
        flight.sink.full = 50 * case.S < flight.clock.elapsed_us < 80 * case.S
        return []

    flown = verified(under_way("px4").fly(fill))
    assert flown.ending is Ending.EVIDENCE_LOST
    assert flown.effects("gap")


def test_mode_none_flies_refused_steps() -> None:
    flown = fly("short", "px4", "battery,at=0s,level=20%", mode=EnforcementMode.NONE)
    assert flown.decisions()[0][1] == "fallback"
    assert flown.dispatched()[0] == "takeoff"
