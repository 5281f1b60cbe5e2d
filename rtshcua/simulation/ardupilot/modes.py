"""ArduCopter's modes: `custom_mode` is the mode's number."""

from rtshcua.simulation.modes import Mode, ModeTable

_BASE = 1 | 8 | 16 | 64
"""Custom, guided, stabilize, manual: ArduCopter tells all of them in every mode once it has a position."""

MODES = ModeTable(
    numbers={
        Mode.MANUAL: 0,
        Mode.ALTITUDE: 2,
        Mode.GUIDED: 4,
        Mode.LOITER: 5,
        Mode.RETURN: 6,
        Mode.LAND: 9,
        Mode.POSITION: 16,
        Mode.BRAKE: 17,
    },
    base=dict.fromkeys(Mode, _BASE),
    start=Mode.MANUAL,
    armable=frozenset({Mode.MANUAL, Mode.ALTITUDE, Mode.GUIDED, Mode.LOITER, Mode.POSITION}),
    names={
        Mode.MANUAL: "STABILIZE",
        Mode.ALTITUDE: "ALT_HOLD",
        Mode.GUIDED: "GUIDED",
        Mode.LOITER: "LOITER",
        Mode.RETURN: "RTL",
        Mode.LAND: "LAND",
        Mode.POSITION: "POSHOLD",
        Mode.BRAKE: "BRAKE",
    },
)
