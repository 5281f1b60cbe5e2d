"""Numbers of the dialect that several parts of this package use, under the dialect's own names.

Commands, flags of modes, frames of reference, components (https://mavlink.io/en/messages/common.html). Modules
that may import pymavlink find the others there.
"""

from typing import Final

MAV_TYPE_GCS: Final = 6
#: quadrotor, coaxial, hexarotor, octorotor, tricopter, dodecarotor, decarotor
MULTIROTORS: Final = frozenset({2, 3, 13, 14, 15, 29, 35})
MAV_TYPE_ONBOARD_CONTROLLER: Final = 18
MAV_TYPE_GIMBAL: Final = 26
MAV_TYPE_CAMERA: Final = 30
#: vehicles; the other types (ground stations, trackers, gimbals, cameras, ...) are not vehicles
VEHICLES: Final = frozenset({*range(5), *range(7, 18), *range(19, 26), 28, 29, 35, 43, 45, 46, 47})

#: a battery that does not supply a motor
MAV_BATTERY_FUNCTION_AVIONICS: Final = 3
MAV_BATTERY_FUNCTION_PAYLOAD: Final = 4

MAV_AUTOPILOT_ARDUPILOTMEGA: Final = 3
MAV_AUTOPILOT_INVALID: Final = 8  # the autopilot field of a component without an autopilot
MAV_AUTOPILOT_PX4: Final = 12

MAV_COMP_ID_AUTOPILOT1: Final = 1
MAV_COMP_ID_TELEMETRY_RADIO: Final = 68
MAV_COMP_ID_CAMERA: Final = 100
MAV_COMP_ID_CAMERA6: Final = 105
MAV_COMP_ID_GIMBAL: Final = 154
MAV_COMP_ID_GIMBAL2: Final = 171
MAV_COMP_ID_GIMBAL6: Final = 175
MAV_COMP_ID_ONBOARD_COMPUTER: Final = 191

MAV_MODE_FLAG_CUSTOM_MODE_ENABLED: Final = 1
MAV_MODE_FLAG_AUTO_ENABLED: Final = 4
MAV_MODE_FLAG_GUIDED_ENABLED: Final = 8
MAV_MODE_FLAG_STABILIZE_ENABLED: Final = 16
MAV_MODE_FLAG_MANUAL_INPUT_ENABLED: Final = 64
MAV_MODE_FLAG_SAFETY_ARMED: Final = 128

MAV_LANDED_STATE_ON_GROUND: Final = 1
MAV_LANDED_STATE_IN_AIR: Final = 2
MAV_LANDED_STATE_TAKEOFF: Final = 3
MAV_LANDED_STATE_LANDING: Final = 4

MAV_FRAME_GLOBAL: Final = 0  # heights above mean sea level
MAV_FRAME_GLOBAL_RELATIVE_ALT: Final = 3
MAV_FRAME_GLOBAL_INT: Final = 5
MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: Final = 6  # heights above home

MAV_CMD_NAV_RETURN_TO_LAUNCH: Final = 20
MAV_CMD_NAV_LAND: Final = 21
MAV_CMD_NAV_TAKEOFF: Final = 22
MAV_CMD_DO_ORBIT: Final = 34
MAV_CMD_DO_SET_MODE: Final = 176
MAV_CMD_DO_CHANGE_SPEED: Final = 178
MAV_CMD_DO_SET_SERVO: Final = 183
MAV_CMD_DO_CHANGE_ALTITUDE: Final = 186
MAV_CMD_DO_REPOSITION: Final = 192
MAV_CMD_DO_PAUSE_CONTINUE: Final = 193
MAV_CMD_DO_SET_ROI_LOCATION: Final = 195
MAV_CMD_DO_SET_ROI_NONE: Final = 197
MAV_CMD_DO_DIGICAM_CONTROL: Final = 203
MAV_CMD_DO_MOUNT_CONTROL: Final = 205
MAV_CMD_DO_SET_CAM_TRIGG_DIST: Final = 206
MAV_CMD_DO_GRIPPER: Final = 211
MAV_CMD_DO_SET_MISSION_CURRENT: Final = 224
MAV_CMD_MISSION_START: Final = 300
MAV_CMD_COMPONENT_ARM_DISARM: Final = 400
MAV_CMD_RUN_PREARM_CHECKS: Final = 401  # reports why it would not arm, without an effect
MAV_CMD_SET_MESSAGE_INTERVAL: Final = 511
MAV_CMD_REQUEST_MESSAGE: Final = 512
MAV_CMD_SET_CAMERA_MODE: Final = 530
MAV_CMD_SET_CAMERA_ZOOM: Final = 531
MAV_CMD_SET_CAMERA_FOCUS: Final = 532
MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: Final = 1_000
MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: Final = 1_001
MAV_CMD_IMAGE_START_CAPTURE: Final = 2_000
MAV_CMD_IMAGE_STOP_CAPTURE: Final = 2_001
MAV_CMD_DO_TRIGGER_CONTROL: Final = 2_003
MAV_CMD_VIDEO_START_CAPTURE: Final = 2_500
MAV_CMD_VIDEO_STOP_CAPTURE: Final = 2_501
MAV_CMD_REQUEST_OPERATOR_CONTROL: Final = 32_100
MAV_CMD_DO_WINCH: Final = 42_600
MAV_CMD_NAV_FENCE_RETURN_POINT: Final = 5_000
MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: Final = 5_001
MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: Final = 5_002
MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: Final = 5_003
MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: Final = 5_004

MAV_DO_REPOSITION_FLAGS_CHANGE_MODE: Final = 1
SPEED_TYPE_GROUNDSPEED: Final = 1
MAV_MISSION_TYPE_FENCE: Final = 1
MAV_MISSION_TYPE_RALLY: Final = 2

#: POSITION_TARGET_TYPEMASK: velocity, acceleration, yaw and yaw rate are ignored
POSITION_ONLY: Final = 0x0DF8
#: the same, but for the yaw
POSITION_AND_YAW: Final = 0x09F8
#: INT32_MAX: in x and y of COMMAND_INT the equivalent of NaN in a float
NO_PLACE: Final = (1 << 31) - 1
