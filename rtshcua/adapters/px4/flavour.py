"""How PX4 is made to do each kind of motion.

Altitudes in commands are above mean sea level here, whatever the frame says, so the height above home is converted in
this one place. An acknowledgement of DO_REPOSITION or DO_SET_MODE says nothing: only the heartbeat tells.
"""

from rtshcua.adapters.px4 import modes
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.effects import armed, arrived, climbed, down, in_mode, in_mode_or_down, still
from rtshcua.adapters.vehicle.flavour import Flavour, Stage
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command

_MODE_US = 5_000_000
_ARM_US = 8_000_000


def stages(command: Command, seen: Observed, system: int) -> list[Stage]:
    """The stages of a manoeuvre; needs `seen.home_amsl`, which a ready vehicle has reported."""
    amsl = (seen.home_amsl or 0) + command.altitude
    match command.kind:
        case MotionKind.CLIMB:
            own = frozenset({modes.TAKEOFF, modes.HOLD})
            takeoff = messages.command(
                system, messages.TAKEOFF, messages.NAN, 0, 0, messages.NAN, messages.NAN, messages.NAN, amsl / 1_000
            )
            return [
                Stage(takeoff, messages.TAKEOFF, in_mode(modes.TAKEOFF), own, _MODE_US),
                Stage(messages.arm(system), messages.ARM_DISARM, armed, own, _ARM_US),
                Stage(None, None, climbed(command.altitude), own, powered=True),
            ]
        case MotionKind.FLY | MotionKind.COVER:
            return [
                Stage(
                    messages.reposition_amsl(system, latitude, longitude, amsl, command.speed),
                    messages.REPOSITION,
                    arrived(latitude, longitude, command.altitude),
                    frozenset({modes.HOLD}),
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
            hold = frozenset({modes.HOLD})
            mode = messages.set_mode(system, modes.AUTO, modes.SUB_LOITER)
            return [
                Stage(mode, messages.DO_SET_MODE, in_mode(modes.HOLD), hold, _MODE_US, powered=True),
                Stage(None, None, still, hold, powered=True),
            ]


def _down(system: int, mode: int, sub: int) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, modes.AUTO, sub)
    return [
        Stage(message, messages.DO_SET_MODE, in_mode_or_down(mode), own, _MODE_US),
        Stage(None, None, down, own),
    ]


PX4 = Flavour("px4", 12, modes.NAMES, stages)
