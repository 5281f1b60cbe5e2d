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
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    HOLD: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    23: "FOLLOW",
    27: "AUTO_RTL",
}
