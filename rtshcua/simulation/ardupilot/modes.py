"""The modes of ArduCopter that the simulated vehicle has."""

from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import COPTER_NAMES, CopterMode
from rtshcua.simulation.modes import NEEDS_POSITION, Mode, ModeTable

_GUIDED = enums.MAV_MODE_FLAG_GUIDED_ENABLED
_BASE = (
    enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | enums.MAV_MODE_FLAG_STABILIZE_ENABLED
    | enums.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)
"""In every mode; guided in those that hold a place."""

MODES = ModeTable(
    numbers={
        Mode.MANUAL: CopterMode.STABILIZE,
        Mode.ALTITUDE: CopterMode.ALT_HOLD,
        Mode.MISSION: CopterMode.AUTO,
        Mode.GUIDED: CopterMode.GUIDED,
        Mode.LOITER: CopterMode.LOITER,
        Mode.RETURN: CopterMode.RTL,
        Mode.LAND: CopterMode.LAND,
        Mode.POSITION: CopterMode.POSHOLD,
        Mode.BRAKE: CopterMode.BRAKE,
    },
    base={mode: _BASE | (_GUIDED if mode in NEEDS_POSITION or mode is Mode.LAND else 0) for mode in Mode},
    start=Mode.MANUAL,
    armable=frozenset({Mode.MANUAL, Mode.ALTITUDE, Mode.GUIDED, Mode.LOITER, Mode.POSITION}),
    blind=_GUIDED,
    stands_by=True,
    names=COPTER_NAMES,
)
