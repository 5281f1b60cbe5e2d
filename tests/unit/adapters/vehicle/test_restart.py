"""Who flies when a run starts in the air: the table of docs/flying/supervision.md, and reported targets."""

import pytest

from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.adapters.vehicle.restart import arrives, flown_by, modes_of
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.left import CommandInForce, Left
from rtshcua.onboard.ports import Command

#: the possible modes of a vehicle that obeyed this command without intervention
OURS = {
    ("px4", MotionKind.CLIMB): "Takeoff, Hold",
    ("px4", MotionKind.FLY): "Hold",
    ("px4", MotionKind.COVER): "Hold",
    ("px4", MotionKind.HOLD): "Hold",
    ("px4", MotionKind.HOME): "Return",
    ("px4", MotionKind.LAND): "Land",
    ("ardupilot", MotionKind.CLIMB): "GUIDED",
    ("ardupilot", MotionKind.FLY): "GUIDED",
    ("ardupilot", MotionKind.COVER): "GUIDED",
    ("ardupilot", MotionKind.HOLD): "BRAKE",
    ("ardupilot", MotionKind.HOME): "RTL",
    ("ardupilot", MotionKind.LAND): "LAND",
}
#: 1e-7 degree and mm above the sea: where it is, and 11 m and 22 m north of that
HERE, NORTH, FAR = ((latitude, 85_455_900, 494_000) for latitude in (473_977_400, 473_978_400, 473_979_400))


def told(kind: MotionKind, *places: tuple[int, int, int], named: tuple[int, int, int] | None = None) -> CommandInForce:
    geo = tuple(part for latitude, longitude, _ in places for part in (latitude, longitude))
    return CommandInForce(Command(0, "skill", kind, (0,) * len(geo), geo, 6_000, 0), named)


def seen(mode: int, target: tuple[int, int, int] | None = None) -> ObservedVehicle:
    vehicle = ObservedVehicle(mode=mode, armed=True, latitude=HERE[0], longitude=HERE[1], located=True, speed=0)
    vehicle.target, vehicle.home_amsl = target, 488_000
    return vehicle


@pytest.mark.parametrize("flavour", [PX4, ARDUPILOT], ids=lambda each: each.name)
def test_flight_mode_shows_who_flies(flavour: AutopilotFlavour) -> None:
    for kind in MotionKind:
        ours = OURS[flavour.name, kind].split(", ")
        for mode, name in flavour.mode_names.items():
            assert flown_by(Left((told(kind, HERE),)), flavour, seen(mode)) == ("" if name in ours else name)


def test_each_command_that_may_be_in_force_counts() -> None:
    """The last command may not have arrived."""
    left = Left((told(MotionKind.FLY, HERE), told(MotionKind.HOME)))
    assert [flown_by(left, ARDUPILOT, seen(mode)) for mode in (CopterMode.GUIDED, CopterMode.RTL)] == ["", ""]
    assert flown_by(left, ARDUPILOT, seen(CopterMode.BRAKE)) == "BRAKE"


def test_landed_or_taken_over_vehicle_is_flown_by_others() -> None:
    assert flown_by(Left(()), PX4, seen(Px4Mode.HOLD)) == "Hold"
    taken = Left((told(MotionKind.HOLD),), "Position")
    assert flown_by(taken, PX4, seen(Px4Mode.HOLD)) == "Position, as the previous run commanded"


def near(place: tuple[int, int, int], north: int = 0, up: int = 0) -> tuple[int, int, int]:
    """So many mm from there."""
    return place[0] + north * 100 // 1_113, place[1], place[2] + up


@pytest.mark.parametrize(
    ("in_force", "target", "ours"),
    [
        # no target was reported yet: its commanded target, up to rounding
        (told(MotionKind.FLY, NORTH), NORTH, True),
        (told(MotionKind.FLY, NORTH), near(NORTH, 2_500), True),
        (told(MotionKind.FLY, NORTH), HERE, False),
        (told(MotionKind.COVER, HERE, NORTH, FAR), FAR, True),
        (told(MotionKind.CLIMB), near(HERE, 15_000), True),
        (told(MotionKind.CLIMB), near(HERE, up=-4_000), False),
        (told(MotionKind.HOLD), near(HERE, 9_000, 20_000), True),
        (told(MotionKind.HOLD), FAR, False),
        # reported: exactly that target, or the next one
        (told(MotionKind.FLY, NORTH, named=NORTH), near(NORTH, 90), True),
        (told(MotionKind.FLY, NORTH, named=NORTH), near(NORTH, 150), False),
        (told(MotionKind.COVER, HERE, NORTH, FAR, named=HERE), NORTH, True),
        (told(MotionKind.COVER, HERE, NORTH, FAR, named=HERE), FAR, False),
        (told(MotionKind.COVER, HERE, NORTH, FAR, named=NORTH), HERE, False),
        (told(MotionKind.CLIMB, named=HERE), near(HERE, up=-1_000), False),
        (told(MotionKind.HOLD, named=HERE), near(HERE, 700), False),
        # no report of a target
        (told(MotionKind.FLY, NORTH, named=NORTH), None, True),
    ],
)
def test_in_the_same_mode_the_target_tells(
    in_force: CommandInForce, target: tuple[int, int, int] | None, ours: bool
) -> None:
    assert flown_by(Left((in_force,)), PX4, seen(Px4Mode.HOLD, target)) == ("" if ours else "another target")


def test_superseded_command_stays_in_force_only_at_exact_place() -> None:
    """A return that is paused at its beginning holds at the place of the hold before it."""
    left = Left((told(MotionKind.HOLD, named=HERE), told(MotionKind.HOME)))
    assert flown_by(left, PX4, seen(Px4Mode.HOLD, HERE)) == ""
    assert flown_by(left, PX4, seen(Px4Mode.HOLD, near(HERE, 50))) == "another target"


def test_a_command_may_get_there_only_now() -> None:
    left = Left((told(MotionKind.FLY, HERE), told(MotionKind.HOLD)))
    assert arrives(left, ARDUPILOT, CopterMode.GUIDED, CopterMode.BRAKE)
    assert not arrives(left, ARDUPILOT, CopterMode.BRAKE, CopterMode.GUIDED)
    assert not arrives(left, ARDUPILOT, CopterMode.GUIDED, CopterMode.RTL)
    assert not arrives(None, ARDUPILOT, CopterMode.GUIDED, CopterMode.BRAKE)
    assert modes_of(left, ARDUPILOT) == {CopterMode.GUIDED, CopterMode.BRAKE}
    assert not modes_of(None, ARDUPILOT)


def test_a_target_of_its_own_is_not_compared() -> None:
    assert flown_by(Left((told(MotionKind.HOME),)), PX4, seen(Px4Mode.RETURN, FAR)) == ""


def test_hold_at_an_unknown_position_is_ours() -> None:
    lost = seen(Px4Mode.HOLD, FAR)
    lost.located = False
    assert flown_by(Left((told(MotionKind.HOLD),)), PX4, lost) == ""
    assert flown_by(Left((told(MotionKind.CLIMB),)), PX4, lost) == ""
