"""PX4's modes: `custom_mode` is `main << 16 | sub << 24`."""

from rtshcua.simulation.modes import Mode, ModeTable

_AUTO = 4
_CUSTOM, _AUTO_FLAG, _GUIDED, _STABILIZE, _MANUAL = 1, 4, 8, 16, 64
_BY_PILOT = _CUSTOM | _STABILIZE | _MANUAL
_BY_ITSELF = _CUSTOM | _AUTO_FLAG | _GUIDED | _STABILIZE


def _number(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


MODES = ModeTable(
    numbers={
        Mode.MANUAL: _number(1),
        Mode.ALTITUDE: _number(2),
        Mode.POSITION: _number(3),
        Mode.ORBIT: _number(3, 1),
        Mode.TAKEOFF: _number(_AUTO, 2),
        Mode.LOITER: _number(_AUTO, 3),
        Mode.MISSION: _number(_AUTO, 4),
        Mode.RETURN: _number(_AUTO, 5),
        Mode.LAND: _number(_AUTO, 6),
        Mode.GUIDED: _number(6),
    },
    base={
        Mode.MANUAL: _BY_PILOT,
        Mode.ALTITUDE: _BY_PILOT,
        Mode.POSITION: _BY_PILOT,
        Mode.ORBIT: _CUSTOM | _STABILIZE,
        Mode.TAKEOFF: _BY_ITSELF,
        Mode.LOITER: _BY_ITSELF,
        Mode.MISSION: _BY_ITSELF,
        Mode.RETURN: _BY_ITSELF,
        Mode.LAND: _BY_ITSELF,
        Mode.GUIDED: _BY_ITSELF,
    },
    start=Mode.LOITER,
    armable=frozenset(Mode) - {Mode.RETURN, Mode.LAND},
    blind=0,
    stands_by=False,
    names={
        Mode.MANUAL: "Manual",
        Mode.ALTITUDE: "Altitude",
        Mode.POSITION: "Position",
        Mode.ORBIT: "Orbit",
        Mode.TAKEOFF: "Takeoff",
        Mode.LOITER: "Hold",
        Mode.MISSION: "Mission",
        Mode.RETURN: "Return",
        Mode.LAND: "Land",
        Mode.GUIDED: "Offboard",
    },
)


def number_of(main: int, sub: int) -> int | None:
    """The `custom_mode` that DO_SET_MODE asks for; None if PX4 has no such main mode."""
    if main not in {number >> 16 & 0xFF for number in MODES.numbers.values()}:
        return None
    return _number(main, sub & 0xFF if main == _AUTO else 0)
