"""PX4's flight modes: `custom_mode` is `main << 16 | sub << 24`."""

AUTO = 4
SUB_TAKEOFF, SUB_LOITER, SUB_RETURN, SUB_LAND = 2, 3, 5, 6


def number(main: int, sub: int = 0) -> int:
    """The `custom_mode` of a main mode and its sub-mode."""
    return main << 16 | sub << 24


TAKEOFF = number(AUTO, SUB_TAKEOFF)
HOLD = number(AUTO, SUB_LOITER)
RETURN = number(AUTO, SUB_RETURN)
LAND = number(AUTO, SUB_LAND)

NAMES = {
    number(1): "Manual",
    number(2): "Altitude",
    number(3): "Position",
    number(3, 1): "Orbit",
    TAKEOFF: "Takeoff",
    HOLD: "Hold",
    number(AUTO, 4): "Mission",
    RETURN: "Return",
    LAND: "Land",
    number(AUTO, 8): "Follow",
    number(AUTO, 9): "Precision Land",
    number(5): "Acro",
    number(6): "Offboard",
    number(7): "Stabilized",
}
