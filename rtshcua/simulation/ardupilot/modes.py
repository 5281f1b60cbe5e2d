"""ArduCopter's modes: `custom_mode` is the mode's number."""

from rtshcua.simulation.modes import NEEDS_POSITION, Mode, ModeTable

_BASE, _GUIDED = 1 | 16 | 64, 8
"""Custom, stabilize and manual in every mode; guided in those that hold a place."""

MODES = ModeTable(
    numbers={
        Mode.MANUAL: 0,
        Mode.ALTITUDE: 2,
        Mode.MISSION: 3,
        Mode.GUIDED: 4,
        Mode.LOITER: 5,
        Mode.RETURN: 6,
        Mode.LAND: 9,
        Mode.POSITION: 16,
        Mode.BRAKE: 17,
    },
    base={mode: _BASE | (_GUIDED if mode in NEEDS_POSITION or mode is Mode.LAND else 0) for mode in Mode},
    start=Mode.MANUAL,
    armable=frozenset({Mode.MANUAL, Mode.ALTITUDE, Mode.GUIDED, Mode.LOITER, Mode.POSITION}),
    blind=_GUIDED,
    stands_by=True,
    names={
        Mode.MANUAL: "STABILIZE",
        Mode.ALTITUDE: "ALT_HOLD",
        Mode.MISSION: "AUTO",
        Mode.GUIDED: "GUIDED",
        Mode.LOITER: "LOITER",
        Mode.RETURN: "RTL",
        Mode.LAND: "LAND",
        Mode.POSITION: "POSHOLD",
        Mode.BRAKE: "BRAKE",
    },
)
