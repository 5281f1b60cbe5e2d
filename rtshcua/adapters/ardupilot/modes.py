"""ArduCopter's flight modes: `custom_mode` is the mode's number."""

GUIDED = 4
RETURN = 6
LAND = 9
HOLD = 17  # BRAKE: LOITER obeys the throttle stick, which an onboard computer does not have

NAMES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    GUIDED: "GUIDED",
    5: "LOITER",
    RETURN: "RTL",
    7: "CIRCLE",
    LAND: "LAND",
    16: "POSHOLD",
    HOLD: "BRAKE",
    21: "SMART_RTL",
}
