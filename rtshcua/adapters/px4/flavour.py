"""How PX4 is made to do each kind of motion.

Altitudes in commands are above mean sea level here, whatever the frame says. An acknowledgement of DO_REPOSITION or
DO_SET_MODE says nothing: only the heartbeat tells.
"""

from rtshcua.adapters.px4 import modes
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.datum import amsl_m
from rtshcua.adapters.vehicle.effects import armed, arrived, climbed, down, in_mode, in_mode_or_down, still
from rtshcua.adapters.vehicle.fence import FenceHabits
from rtshcua.adapters.vehicle.flavour import Flavour, ReturnAltitude, Stage
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

_MODE_US = 5_000_000
_ARM_US = 8_000_000
_HOLD = frozenset({modes.HOLD})


def stages(command: Command, seen: Observed, system: int) -> list[Stage]:
    """The stages of a manoeuvre. Raises NoDatum where they need an altitude and `seen.home_amsl` is not known."""
    match command.kind:
        case MotionKind.CLIMB:
            amsl = amsl_m(command.altitude, seen.home_amsl)
            own = frozenset({modes.TAKEOFF, modes.HOLD})
            takeoff = messages.command(
                system, messages.TAKEOFF, messages.NAN, 0, 0, messages.NAN, messages.NAN, messages.NAN, amsl
            )
            # Armed in Hold, and only then told to take off: it would accept both the other way round, and one that was
            # refused its arming would take off whenever somebody armed it.
            return [
                _hold(system),
                Stage(messages.arm(system), messages.ARM_DISARM, armed, _HOLD, _ARM_US),
                Stage(takeoff, messages.TAKEOFF, in_mode(modes.TAKEOFF), own, _MODE_US, powered=True),
                Stage(None, None, climbed(command.altitude), own, powered=True),
            ]
        case MotionKind.FLY | MotionKind.COVER:
            amsl = amsl_m(command.altitude, seen.home_amsl)
            return [
                Stage(
                    messages.reposition_amsl(system, latitude, longitude, amsl, command.speed),
                    messages.REPOSITION,
                    arrived(latitude, longitude, command.altitude),
                    _HOLD,
                    powered=True,
                    travels=True,
                )
                for latitude, longitude in zip(command.geo[::2], command.geo[1::2], strict=True)
            ]
        case MotionKind.HOME:
            return _down(system, modes.RETURN, modes.SUB_RETURN)
        case MotionKind.LAND:
            return _down(system, modes.LAND, modes.SUB_LAND)
        case _:
            return [_hold(system), Stage(None, None, still, _HOLD, powered=True)]


def _hold(system: int) -> Stage:
    """Hold first: it is entered at once where it is the mode already."""
    message = messages.set_mode(system, modes.AUTO, modes.SUB_LOITER)
    return Stage(message, messages.DO_SET_MODE, in_mode(modes.HOLD), _HOLD, _MODE_US)


def _down(system: int, mode: int, sub: int) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, modes.AUTO, sub)
    return [
        Stage(message, messages.DO_SET_MODE, in_mode_or_down(mode), own, _MODE_US),
        Stage(None, None, down, own),
    ]


PX4 = Flavour(
    name="px4",
    autopilot=12,
    mode_names=modes.NAMES,
    stages=stages,
    estimator="ESTIMATOR_STATUS",
    natural=frozenset({(modes.TAKEOFF, modes.HOLD)}),
    returns=(ReturnAltitude("RTL_RETURN_ALT", 1_000),),
    bytewise=True,
    fence=FenceHabits(frame=3, all_inclusions=False, switches=()),
)
