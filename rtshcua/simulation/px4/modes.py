"""The modes of PX4 that the simulated vehicle has."""

from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import PX4_NAMES, Px4Mode
from rtshcua.simulation.modes import Mode, ModeTable

_AUTO, _ = Px4Mode.HOLD.parameters
_ORBITS = enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | enums.MAV_MODE_FLAG_STABILIZE_ENABLED
_BY_PILOT = _ORBITS | enums.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
_BY_ITSELF = _ORBITS | enums.MAV_MODE_FLAG_AUTO_ENABLED | enums.MAV_MODE_FLAG_GUIDED_ENABLED

MODES = ModeTable(
    numbers={
        Mode.MANUAL: Px4Mode.MANUAL,
        Mode.ALTITUDE: Px4Mode.ALTITUDE,
        Mode.POSITION: Px4Mode.POSITION,
        Mode.ORBIT: Px4Mode.ORBIT,
        Mode.TAKEOFF: Px4Mode.TAKEOFF,
        Mode.LOITER: Px4Mode.HOLD,
        Mode.MISSION: Px4Mode.MISSION,
        Mode.RETURN: Px4Mode.RETURN,
        Mode.LAND: Px4Mode.LAND,
        Mode.GUIDED: Px4Mode.OFFBOARD,
    },
    base=dict.fromkeys(Mode, _BY_ITSELF)
    | dict.fromkeys((Mode.MANUAL, Mode.ALTITUDE, Mode.POSITION), _BY_PILOT)
    | {Mode.ORBIT: _ORBITS},
    start=Mode.LOITER,
    armable=frozenset(Mode) - {Mode.RETURN, Mode.LAND},
    blind=0,
    stands_by=False,
    names=PX4_NAMES,
)


def number_of(main: int, sub: int) -> int | None:
    """The `custom_mode` that DO_SET_MODE asks for; None if PX4 has no such main mode."""
    if main not in {number >> 16 & 0xFF for number in MODES.numbers.values()}:
        return None
    return main << 16 | (sub & 0xFF if main == _AUTO else 0) << 24
