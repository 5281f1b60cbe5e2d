"""How PX4 is made to do each kind of motion.

Altitudes in commands are above mean sea level here, whatever the frame says. An acknowledgement of DO_REPOSITION or
DO_SET_MODE says nothing: only the heartbeat tells, and of a stop only the speed.
"""

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.datum import amsl_m
from rtshcua.adapters.vehicle.effects import (
    armed,
    arrived,
    climbed,
    down,
    homeward,
    in_mode,
    in_mode_or_down,
    still,
    to_place,
    to_the_ground,
    up_to,
)
from rtshcua.adapters.vehicle.fence import FenceHabits
from rtshcua.adapters.vehicle.flavour import Flavour, ReturnAltitude, Stage
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.adapters.vehicle.progress import Expected
from rtshcua.adapters.vehicle.targets import Target
from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import PX4_NAMES, Px4Mode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

_MODE_US = 5_000_000
_ARM_US = 8_000_000
#: link time within which a climb, a leg, a return and a landing get a metre further
_CLIMBS_US, _FLIES_US, _RETURNS_US, _LANDS_US = 10_000_000, 8_000_000, 45_000_000, 15_000_000
#: mm: how far from where it is it may say that it takes off, or that it will come to stand;
_TAKES_OFF, _STOPS = 20_000, 10_000
_STOPS_S = 3  # and how many seconds' way further, and what braking at 1 m/s^2 takes, if it moves
_HOLD = frozenset({Px4Mode.HOLD})


def stages(command: Command, seen: Observed, system: int) -> list[Stage]:
    """The stages of a manoeuvre. Raises NoDatum where they need an altitude and `seen.home_amsl` is not known."""
    match command.kind:
        case MotionKind.CLIMB:
            return _climb(command, seen, system)
        case MotionKind.FLY | MotionKind.COVER:
            amsl = amsl_m(command.altitude, seen.home_amsl)
            return [
                Stage(
                    messages.reposition_amsl(system, latitude, longitude, amsl, command.speed),
                    messages.REPOSITION,
                    arrived(latitude, longitude, command.altitude),
                    _HOLD,
                    powered=True,
                    target=Target(latitude, longitude, round(amsl * 1_000)),
                    progress=Expected(to_place(latitude, longitude, command.altitude), _FLIES_US),
                )
                for latitude, longitude in zip(command.geo[::2], command.geo[1::2], strict=True)
            ]
        case MotionKind.HOME:
            return _down(system, Px4Mode.RETURN, Expected(homeward, _RETURNS_US, either_way=True))
        case MotionKind.LAND:
            return _down(system, Px4Mode.LAND, Expected(to_the_ground, _LANDS_US))
        case _:
            return [_stop(seen, system), Stage(None, None, still, _HOLD, powered=True, stops=True)]


def _climb(command: Command, seen: Observed, system: int) -> list[Stage]:
    """Armed in Hold, and only then told to take off: it would accept both the other way round, and one that was refused
    its arming would take off whenever somebody armed it.
    """
    amsl = amsl_m(command.altitude, seen.home_amsl)
    own = frozenset({Px4Mode.TAKEOFF, Px4Mode.HOLD})
    takeoff = messages.command(
        system, messages.TAKEOFF, messages.NAN, 0, 0, messages.NAN, messages.NAN, messages.NAN, amsl
    )
    hold = messages.set_mode(system, Px4Mode.HOLD)
    above = Target(seen.latitude, seen.longitude, round(amsl * 1_000), _TAKES_OFF)
    return [
        Stage(hold, messages.DO_SET_MODE, in_mode(Px4Mode.HOLD), _HOLD, _MODE_US, spare=True),
        Stage(messages.arm(system), messages.ARM_DISARM, armed, _HOLD, _ARM_US),
        Stage(takeoff, messages.TAKEOFF, in_mode(Px4Mode.TAKEOFF), own, _MODE_US, powered=True, target=above),
        Stage(
            None, None, climbed(command.altitude), own, powered=True, target=above,
            progress=Expected(up_to(command.altitude), _CLIMBS_US),
        ),
    ]  # fmt: skip


def _stop(seen: Observed, system: int) -> Stage:
    """Not DO_SET_MODE: in Hold already, flying to a place, PX4 acknowledges that and flies on (vehicles.md 5)."""
    speed = seen.speed or 0
    within = _STOPS + _STOPS_S * speed + speed * speed // 2_000
    here = Target(seen.latitude, seen.longitude, None, within) if seen.located else None
    stop = messages.stop_here(system)
    return Stage(stop, messages.REPOSITION, None, _HOLD, _MODE_US, powered=True, target=here, stops=True)


def _down(system: int, mode: Px4Mode, progress: Expected) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, mode)
    return [
        Stage(message, messages.DO_SET_MODE, in_mode_or_down(mode), own, _MODE_US),
        Stage(None, None, down, own, progress=progress),
    ]


PX4 = Flavour(
    name="px4",
    autopilot=enums.MAV_AUTOPILOT_PX4,
    mode_names=PX4_NAMES,
    stages=stages,
    estimator="ESTIMATOR_STATUS",
    natural=frozenset({(Px4Mode.TAKEOFF, Px4Mode.HOLD)}),
    ours=frozenset({Px4Mode.TAKEOFF, Px4Mode.HOLD, Px4Mode.RETURN}),
    mode_within_us=300_000,  # HEARTBEAT is asked for at twice that rate: by itself it comes each second only
    returns=(ReturnAltitude("RTL_RETURN_ALT", 1_000),),
    bytewise=True,
    fence=FenceHabits(frame=enums.MAV_FRAME_GLOBAL_RELATIVE_ALT, all_inclusions=False, switches=()),
)
