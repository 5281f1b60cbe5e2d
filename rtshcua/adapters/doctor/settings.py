"""Parameters that make an autopilot act by itself in a flight, or keep it from arming, and what they say in words."""

from collections.abc import Mapping
from typing import Final, NamedTuple


class Setting(NamedTuple):
    """A parameter, what it is about, its values in words, and why some of them are worth a warning."""

    parameter: str
    about: str
    words: Mapping[float, str]
    warns: Mapping[float, str]


_LOST: Final[Mapping[float, str]] = {0: "nothing", 1: "hold", 2: "return", 3: "land", 5: "terminate", 6: "lockdown"}
_MOTORS_OFF: Final = "the motors stop in the air"

SETTINGS: Final[Mapping[str, tuple[Setting, ...]]] = {
    "px4": (
        Setting("NAV_DLL_ACT", "when the ground station is lost", _LOST, {5: _MOTORS_OFF, 6: _MOTORS_OFF}),
        Setting("NAV_RCL_ACT", "when the remote control is lost", _LOST, {5: _MOTORS_OFF, 6: _MOTORS_OFF}),
        Setting(
            "COM_LOW_BAT_ACT", "when the battery is low", {0: "warns only", 2: "land", 3: "return, then land"},
            {0: "the autopilot does nothing of its own about a battery that runs out"},
        ),
        Setting(
            "GF_ACTION", "at the fence",
            {0: "nothing", 1: "warns only", 2: "hold", 3: "return", 4: "terminate", 5: "land"},
            {0: "its fence is no second line of defence", 1: "its fence is no second line of defence", 4: _MOTORS_OFF},
        ),
        Setting(
            "COM_OBL_RC_ACT", "when offboard control is lost",
            {0: "position", 1: "altitude", 2: "stabilised", 3: "return", 4: "land", 5: "hold", 6: "terminate"},
            {6: _MOTORS_OFF},
        ),
        Setting("COM_DISARM_PRFLT", "seconds until it disarms on the ground", {}, {}),
    ),
    "ardupilot": (
        Setting(
            "FS_GCS_ENABLE", "when the ground station is lost",
            {0: "nothing", 1: "return", 2: "go on if in a mission", 3: "SmartRTL or return", 4: "SmartRTL or land",
             5: "land"},
            {},
        ),
        Setting(
            "FS_THR_ENABLE", "when the remote control is lost",
            {0: "nothing", 1: "return", 2: "go on if in a mission", 3: "land", 4: "SmartRTL or return",
             5: "SmartRTL or land"},
            {},
        ),
        Setting(
            "BATT_FS_LOW_ACT", "when the battery is low",
            {0: "warns only", 1: "land", 2: "return", 3: "SmartRTL or return", 4: "SmartRTL or land", 5: "terminate"},
            {0: "the autopilot does nothing of its own about a battery that runs out", 5: _MOTORS_OFF},
        ),
        Setting(
            "FS_EKF_ACTION", "when the estimator fails",
            {0: "reports only", 1: "land", 2: "altitude hold", 3: "land, even in a manual mode"},
            {0: "the autopilot flies on without knowing where it is"},
        ),
        Setting(
            "FENCE_ENABLE", "fence", {0: "off", 1: "on"}, {0: "its fence is off until a flight of ours switches it on"}
        ),
        Setting(
            "FENCE_ACTION", "at the fence",
            {0: "reports only", 1: "return or land", 2: "land", 3: "SmartRTL, return or land", 4: "brake or land",
             5: "SmartRTL or land"},
            {0: "its fence is no second line of defence"},
        ),
        Setting("ARMING_CHECK", "checks before arming", {0: "none", 1: "all"}, {0: "it arms whatever is wrong"}),
        Setting("ARMING_SKIPCHK", "checks left out before arming", {0: "none"}, {}),
        Setting("DISARM_DELAY", "seconds until it disarms on the ground", {}, {}),
    ),
}  # fmt: skip
