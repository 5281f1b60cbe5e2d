"""How ArduCopter is made to do each kind of motion.

It obeys position targets in GUIDED only, and ignores them silently elsewhere; takeoff takes a height above home.
"""

from rtshcua.adapters.ardupilot import modes
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.datum import relative_m
from rtshcua.adapters.vehicle.effects import airborne, armed, arrived, climbed, down, in_mode, in_mode_or_down, still
from rtshcua.adapters.vehicle.fence import FenceHabits
from rtshcua.adapters.vehicle.flavour import Flavour, ReturnAltitude, Stage
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

_MODE_US = 5_000_000
_ARM_US = 8_000_000
_SPEED_US = 5_000_000
_REPEAT_US = 2_000_000  # position targets have no acknowledgement
_GUIDED = frozenset({modes.GUIDED})
_POLYGONS = 4  # of FENCE_TYPE: inclusions and exclusions, polygons and circles


def stages(command: Command, seen: Observed, system: int) -> list[Stage]:
    """The stages of a manoeuvre."""
    match command.kind:
        case MotionKind.CLIMB:
            takeoff = messages.command(system, messages.TAKEOFF, 0, 0, 0, 0, 0, 0, relative_m(command.altitude))
            return [
                _guided(system),
                Stage(messages.arm(system), messages.ARM_DISARM, armed, _GUIDED, _ARM_US),
                Stage(takeoff, messages.TAKEOFF, airborne, _GUIDED, _ARM_US, powered=True),
                Stage(None, None, climbed(command.altitude), _GUIDED, powered=True),
            ]
        case MotionKind.FLY | MotionKind.COVER:
            way = [_guided(system)]
            if command.speed:
                speed = messages.command(system, messages.CHANGE_SPEED, 1, command.speed / 1_000, -1)
                way.append(Stage(speed, messages.CHANGE_SPEED, None, _GUIDED, _SPEED_US, powered=True))
            for latitude, longitude in zip(command.geo[::2], command.geo[1::2], strict=True):
                target = messages.position_target(system, latitude, longitude, relative_m(command.altitude))
                near = arrived(latitude, longitude, command.altitude)
                way.append(Stage(target, None, near, _GUIDED, repeat_us=_REPEAT_US, powered=True, travels=True))
            return way
        case MotionKind.HOME:
            return _down(system, modes.RETURN)
        case MotionKind.LAND:
            return _down(system, modes.LAND)
        case _:
            hold = frozenset({modes.HOLD})
            mode = messages.set_mode(system, modes.HOLD)
            return [
                Stage(mode, messages.DO_SET_MODE, in_mode(modes.HOLD), hold, _MODE_US, powered=True),
                Stage(None, None, still, hold, powered=True),
            ]


def _guided(system: int) -> Stage:
    """GUIDED first: it is entered at once where it is the mode already."""
    message = messages.set_mode(system, modes.GUIDED)
    return Stage(message, messages.DO_SET_MODE, in_mode(modes.GUIDED), _GUIDED, _MODE_US)


def _down(system: int, mode: int) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, mode)
    return [
        Stage(message, messages.DO_SET_MODE, in_mode_or_down(mode), own, _MODE_US),
        Stage(None, None, down, own),
    ]


ARDUPILOT = Flavour(
    name="ardupilot",
    autopilot=3,
    mode_names=modes.NAMES,
    stages=stages,
    estimator="EKF_STATUS_REPORT",
    natural=frozenset(),
    returns=(ReturnAltitude("RTL_ALT", 10), ReturnAltitude("RTL_ALT_M", 1_000)),  # cm before 4.7, metres from then on
    bytewise=False,
    fence=FenceHabits(frame=0, all_inclusions=True, switches=(("FENCE_TYPE", _POLYGONS), ("FENCE_ENABLE", 1))),
)
