#!/bin/sh
# pymavlink 2.4.50: `mavutil.mode_string_v10` names PX4's Orbit, which flies by itself, as POSCTL, in which a person flies by hand.
# Expected: a name of its own, or UNKNOWN as it says for precision landing and for a takeoff by AUTO_READY.
# PX4 tells Orbit as main mode POSCTL (3) with sub mode 1 (px4_custom_mode.h: PX4_CUSTOM_SUB_MODE_POSCTL_ORBIT); the lookup
# by main mode and sub mode falls back to the main mode alone for modes that are flown by hand. A program that takes
# POSCTL for "the pilot has it" is wrong then.
# Seen: (3, 0) POSCTL, (3, 1) POSCTL, (4, 9) UNKNOWN, (4, 3) LOITER
. "$(dirname "$0")/run.inc"
packages pymavlink==2.4.50
python - <<'END'
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

seen = {}
for main, sub in ((3, 0), (3, 1), (4, 9), (4, 3)):
    custom_mode = main << 16 | sub << 24
    beat = common.MAVLink_heartbeat_message(2, common.MAV_AUTOPILOT_PX4, 0x81, custom_mode, 4, 3)
    seen[main, sub] = mavutil.mode_string_v10(beat)
print("pymavlink 2.4.50:", ", ".join(f"{mode} {name}" for mode, name in seen.items()))
assert seen == {(3, 0): "POSCTL", (3, 1): "POSCTL", (4, 9): "UNKNOWN", (4, 3): "LOITER"}, "it has changed"
END
