"""What a pilot does to the vehicle past the link: with switches, with sticks, from a ground station of his own."""

from collections.abc import Callable, Iterator
from functools import partial
from math import nan

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation import faults
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.command import Command
from rtshcua.simulation.modes import Mode

Effect = tuple[int, Callable[[], object]]
"""A time, and what happens then."""
_STATION = (255, 190)
_EVERY_US = 100_000
"""How often the position of the sticks is looked at."""


def pilot_effects(fault: faults.PilotFault, a: Autopilot) -> Iterator[Effect]:
    """When a pilot does what, and what comes of it."""
    match fault:
        case faults.PilotMode(at_us, mode):
            if mode in a.flavour.modes.numbers:  # the switch has no position for another flavour's mode
                yield at_us, partial(a.vehicle.set_mode, mode)
        case faults.PilotPause(at_us):
            yield at_us, partial(_pause, a)
        case faults.PilotGoto(at_us, north_mm, east_mm, up_mm):
            yield at_us, partial(_send_to, a, north_mm, east_mm, up_mm)
        case faults.PilotSticks(at_us, for_us):
            for after_us in range(0, for_us, _EVERY_US):
                yield at_us + after_us, partial(a.flavour.on_sticks, a, _EVERY_US)
        case faults.Kill(at_us):
            yield at_us, a.vehicle.disarm


def _pause(a: Autopilot) -> None:
    if mavlink.MAV_CMD_DO_PAUSE_CONTINUE in a.flavour.commands:
        _command(a, mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0, None, None, nan)
    else:
        _command(a, mavlink.MAV_CMD_DO_REPOSITION, -1.0, None, None, nan)


def _send_to(a: Autopilot, north_mm: int, east_mm: int, up_mm: int) -> None:
    latitude, longitude = a.home.globe(north_mm / 1000, east_mm / 1000)
    amsl = (a.home.amsl_mm + up_mm) / 1000
    _command(a, mavlink.MAV_CMD_DO_REPOSITION, -1.0, float(latitude), float(longitude), amsl)


def _command(
    a: Autopilot, number: int, p1: float, latitude: float | None, longitude: float | None, amsl: float
) -> None:
    flags = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    frame = mavlink.MAV_FRAME_GLOBAL_INT
    a.flavour.commands[number](a, Command(number, p1, flags, 0.0, nan, latitude, longitude, amsl, frame, _STATION))


_AUTOMATIC = frozenset({Mode.TAKEOFF, Mode.LOITER, Mode.MISSION, Mode.RETURN, Mode.LAND, Mode.ORBIT})


def px4_sticks(a: Autopilot, _for_us: int) -> None:
    """COM_RC_OVERRIDE: sticks leave an automatic mode for Position, or for Altitude without a position."""
    vehicle = a.vehicle
    if vehicle.armed and vehicle.mode in _AUTOMATIC:
        vehicle.set_mode(Mode.POSITION if a.can_enter(Mode.POSITION) else Mode.ALTITUDE)


_REPOSITION_M_S = 1.25
"""Half of WPNAV_ACCEL, as `land_run_horizontal_control` takes it."""


def copter_sticks(a: Autopilot, for_us: int) -> None:
    """LAND_REPOSITION: moves it aside while it lands, and in the modes that the sticks fly."""
    vehicle = a.vehicle
    if vehicle.mode in (Mode.LOITER, Mode.POSITION) or vehicle.descends:
        vehicle.shift_east(_REPOSITION_M_S * for_us / 1_000_000)
