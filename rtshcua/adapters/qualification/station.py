"""A second ground station that takes the vehicle over in a simulation, with the frames of a pilot's ground station. Its
frames have their own system and component, and pass no gate, like those of any ground station. It is made only for a
simulation, with the user's confirmation. It sends no heartbeat, so that no loss of the real one is hidden.
"""

from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from rtshcua.adapters.qualification.observed import TakeoverKind
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.modes import PX4, CopterMode, Px4Mode

_SYSTEM: Final = 255
_COMPONENT: Final = dialect.MAV_COMP_ID_MISSIONPLANNER
_PAUSE: Final = 0.0  # of DO_PAUSE_CONTINUE


class GroundStation:
    """Sends to one autopilot."""

    def __init__(self, autopilot: int, system: int) -> None:
        self._autopilot = autopilot
        self._system = system
        self._codec = Codec(_SYSTEM, _COMPONENT)

    def takes_over(self, kind: TakeoverKind, home: tuple[int, int], seen: ObservedVehicle) -> list[bytes]:
        """The frames of a takeover; to a target: back home, at its present height."""
        match kind:
            case TakeoverKind.MODE:
                return self._sets(Px4Mode.RETURN if self._autopilot == PX4 else CopterMode.RTL)
            case TakeoverKind.PAUSE:
                return [self._codec.pack(self._pause())]
            case TakeoverKind.TARGET:
                return [self._codec.pack(self._target(home, seen))]

    def lands(self) -> list[bytes]:
        """The frames that land it where it is."""
        return self._sets(Px4Mode.LAND if self._autopilot == PX4 else CopterMode.LAND)

    def _sets(self, mode: Px4Mode | CopterMode) -> list[bytes]:
        return [self._codec.pack(messages.set_mode(self._system, mode))]

    def _pause(self) -> Any:
        """The pause command: PX4's ground stations send a reposition without a place, ArduPilot's the pause command."""
        if self._autopilot == PX4:
            return messages.stop_here(self._system)
        return messages.command(self._system, dialect.MAV_CMD_DO_PAUSE_CONTINUE, _PAUSE)

    def _target(self, home: tuple[int, int], seen: ObservedVehicle) -> Any:
        if self._autopilot == PX4:
            return messages.reposition_amsl(self._system, *home, seen.amsl(seen.height) / 1_000, 0)
        return messages.position_target(self._system, *home, seen.height / 1_000)
