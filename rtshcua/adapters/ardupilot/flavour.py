"""How ArduCopter is made to do each kind of motion.

It obeys position targets in GUIDED only, and ignores them silently elsewhere; takeoff takes a height above home.
"""

from collections.abc import Callable

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.datum import relative_m
from rtshcua.adapters.vehicle.effects import (
    airborne,
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
from rtshcua.mavlink.modes import COPTER_NAMES, CopterMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

_MODE_US = 5_000_000
_ARM_US = 8_000_000
_SPEED_US = 5_000_000
_REPEAT_US = 2_000_000  # position targets have no acknowledgement
#: link time within which a climb, a leg, a return (it hovers over home for 5 s) and a landing get a metre further
_CLIMBS_US, _FLIES_US, _RETURNS_US, _LANDS_US = 10_000_000, 8_000_000, 45_000_000, 15_000_000
_GUIDED = frozenset({CopterMode.GUIDED})
_POLYGONS = 4  # of FENCE_TYPE: inclusions and exclusions, polygons and circles


def stages(command: Command, seen: Observed, system: int) -> list[Stage]:
    """The stages of a manoeuvre."""
    match command.kind:
        case MotionKind.CLIMB:
            takeoff = messages.command(system, messages.TAKEOFF, 0, 0, 0, 0, 0, 0, relative_m(command.altitude))
            rises = Expected(up_to(command.altitude), _CLIMBS_US)
            return [
                _guided(system),
                Stage(messages.arm(system), messages.ARM_DISARM, armed, _GUIDED, _ARM_US),
                Stage(takeoff, messages.TAKEOFF, airborne, _GUIDED, _ARM_US, powered=True),
                Stage(None, None, climbed(command.altitude), _GUIDED, powered=True, progress=rises),
            ]
        case MotionKind.FLY | MotionKind.COVER:
            points = list(zip(command.geo[::2], command.geo[1::2], strict=True))
            legs = [_leg(system, *point, command.altitude, seen.home_amsl) for point in points]
            if not command.speed or not legs:
                return [_guided(system), *legs]
            # A speed that is set before the first target in GUIDED is forgotten (recorded): it goes out behind it.
            speed = messages.command(system, messages.CHANGE_SPEED, 1, command.speed / 1_000, -1)
            first, *others = legs
            return [
                _guided(system),
                Stage(
                    first.message, None, _sets_off(first), _GUIDED, repeat_us=_REPEAT_US, powered=True,
                    target=first.target, progress=first.progress,
                ),
                Stage(speed, messages.CHANGE_SPEED, None, _GUIDED, _SPEED_US, powered=True),
                Stage(None, None, first.done, _GUIDED, powered=True, progress=first.progress),
                *others,
            ]  # fmt: skip
        case MotionKind.HOME:
            return _down(system, CopterMode.RTL, Expected(homeward, _RETURNS_US, either_way=True))
        case MotionKind.LAND:
            return _down(system, CopterMode.LAND, Expected(to_the_ground, _LANDS_US))
        case _:
            # not LOITER, which obeys the throttle stick: an onboard computer has none
            hold = frozenset({CopterMode.BRAKE})
            mode = messages.set_mode(system, CopterMode.BRAKE)
            return [
                Stage(mode, messages.DO_SET_MODE, in_mode(CopterMode.BRAKE), hold, _MODE_US, powered=True, stops=True),
                Stage(None, None, still, hold, powered=True, stops=True),
            ]


def _leg(system: int, latitude: int, longitude: int, altitude: int, home_amsl: int | None) -> Stage:
    return Stage(
        messages.position_target(system, latitude, longitude, relative_m(altitude)),
        None,
        arrived(latitude, longitude, altitude),
        _GUIDED,
        repeat_us=_REPEAT_US,
        powered=True,
        target=Target(latitude, longitude, None if home_amsl is None else home_amsl + altitude),
        progress=Expected(to_place(latitude, longitude, altitude), _FLIES_US),
    )


def _sets_off(leg: Stage) -> Callable[[Observed], bool]:
    """The autopilot says that it flies to the leg's target; one that says nothing of it is seen to move."""

    def done(seen: Observed) -> bool:
        if seen.target is None or leg.target is None:
            return seen.speed is not None and not still(seen)
        return leg.target.matches(seen.target)

    return lambda seen: done(seen) or (leg.done is not None and leg.done(seen))


def _guided(system: int) -> Stage:
    """GUIDED first. Where it is the mode already nothing is sent, for that would undo a takeover under way."""
    message = messages.set_mode(system, CopterMode.GUIDED)
    return Stage(message, messages.DO_SET_MODE, in_mode(CopterMode.GUIDED), _GUIDED, _MODE_US, spare=True)


def _down(system: int, mode: CopterMode, progress: Expected) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, mode)
    return [
        Stage(message, messages.DO_SET_MODE, in_mode_or_down(mode), own, _MODE_US),
        Stage(None, None, down, own, progress=progress),
    ]


ARDUPILOT = Flavour(
    name="ardupilot",
    autopilot=enums.MAV_AUTOPILOT_ARDUPILOTMEGA,
    mode_names=COPTER_NAMES,
    stages=stages,
    estimator="EKF_STATUS_REPORT",
    natural=frozenset(),
    ours=frozenset({CopterMode.GUIDED, CopterMode.BRAKE, CopterMode.RTL}),
    mode_within_us=200_000,  # HEARTBEAT is streamed at twice that rate
    returns=(ReturnAltitude("RTL_ALT", 10), ReturnAltitude("RTL_ALT_M", 1_000)),  # cm before 4.7, metres from then on
    bytewise=False,
    fence=FenceHabits(
        frame=enums.MAV_FRAME_GLOBAL, all_inclusions=True, switches=(("FENCE_TYPE", _POLYGONS), ("FENCE_ENABLE", 1))
    ),
)
