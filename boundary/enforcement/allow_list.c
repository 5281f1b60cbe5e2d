#include "allow_list.h"
#include "mavlink/parameters.h"

#define AREAS 4 /* a bit of FENCE_TYPE */
#define GROUND_STATION 255
#define ROUNDING 2       /* mm, mm/s */
#define NEAR 449         /* 1e-7 degree of latitude */
#define YAW_ROUNDING 100 /* 1e-6 radian */
#define CAMERA_CAPTURE_STATUS 262
#define CAMERA_IMAGE_CAPTURED 263

static const uint32_t parameters[] = {
    RT_COMMAND_LONG_PARAM1, RT_COMMAND_LONG_PARAM2, RT_COMMAND_LONG_PARAM3, RT_COMMAND_LONG_PARAM4,
    RT_COMMAND_LONG_PARAM5, RT_COMMAND_LONG_PARAM6, RT_COMMAND_LONG_PARAM7,
};

/* ---------------------------------------------------------------- housekeeping */

static bool is_own(const rt_frame *frame) {
    return frame->payload[RT_HEARTBEAT_TYPE] == RT_MAV_TYPE_ONBOARD_CONTROLLER &&
           frame->payload[RT_HEARTBEAT_AUTOPILOT] == RT_MAV_AUTOPILOT_INVALID && frame->payload[RT_HEARTBEAT_BASE_MODE] == 0;
}

/* Whether the parameters of a COMMAND_LONG from number `first` (from 1) on are 0. */
static bool are_zero(const rt_frame *frame, uint32_t first) {
    for (uint32_t at = first - 1; at < 7; at++)
        if (!rt_is_zero(rt_u32(frame, parameters[at])))
            return false;
    return true;
}

bool rt_is_housekeeping(const rt_frame *frame) {
    uint16_t number;
    switch (frame->message) {
    case RT_MSG_HEARTBEAT:
        return is_own(frame);
    case RT_MSG_COMMAND_LONG:
        number = rt_u16(frame, RT_COMMAND_LONG_COMMAND);
        if (number == RT_MAV_CMD_RUN_PREARM_CHECKS)
            return are_zero(frame, 1);
        return number == RT_MAV_CMD_SET_MESSAGE_INTERVAL || number == RT_MAV_CMD_REQUEST_MESSAGE;
    case RT_MSG_PARAM_REQUEST_READ:
    case RT_MSG_PARAM_REQUEST_LIST:
    case RT_MSG_MISSION_REQUEST:
    case RT_MSG_MISSION_REQUEST_LIST:
    case RT_MSG_MISSION_REQUEST_INT:
    case RT_MSG_MISSION_ACK:
    case RT_MSG_TIMESYNC:
    case RT_MSG_LOG_REQUEST_LIST:
    case RT_MSG_STATUSTEXT:
        return true;
    default:
        return false;
    }
}

bool rt_asks_camera(const rt_frame *frame) {
    if (frame->message != RT_MSG_COMMAND_LONG || !frame->has_target || frame->target_component < RT_MAV_COMP_ID_CAMERA ||
        frame->target_component > RT_MAV_COMP_ID_CAMERA6)
        return false;
    if (rt_u16(frame, RT_COMMAND_LONG_COMMAND) != RT_MAV_CMD_REQUEST_MESSAGE || !are_zero(frame, 3))
        return false;
    uint32_t about = rt_u32(frame, RT_COMMAND_LONG_PARAM1);
    return rt_is_whole(about, CAMERA_IMAGE_CAPTURED) || (rt_is_whole(about, CAMERA_CAPTURE_STATUS) && are_zero(frame, 2));
}

bool rt_is_greeting(const rt_frame *frame) {
    if (frame->system == GROUND_STATION)
        return false;
    if (frame->message == RT_MSG_COMMAND_LONG) /* the number of HEARTBEAT is 0 */
        return rt_u16(frame, RT_COMMAND_LONG_COMMAND) == RT_MAV_CMD_REQUEST_MESSAGE && are_zero(frame, 1);
    return frame->message == RT_MSG_HEARTBEAT && is_own(frame);
}

static bool is_named(const rt_frame *frame, const char *name) {
    uint8_t filled[RT_NAME_OCTETS] = {0};
    for (uint32_t at = 0; name[at] != 0; at++)
        filled[at] = (uint8_t)name[at];
    return memcmp(filled, frame->payload + RT_PARAM_SET_PARAM_ID, RT_NAME_OCTETS) == 0;
}

bool rt_is_of_fence(const rt_frame *frame, bool types_known, uint32_t types) {
    const uint8_t *payload = frame->payload;
    uint16_t number;
    int64_t before = 0;
    switch (frame->message) {
    case RT_MSG_PARAM_SET:
        if (is_named(frame, "FENCE_ENABLE"))
            return rt_is_whole(rt_u32(frame, RT_PARAM_SET_PARAM_VALUE), 1);
        if (!is_named(frame, "FENCE_TYPE") || !types_known || !rt_cut(types, &before))
            return false;
        return rt_is_whole(rt_u32(frame, RT_PARAM_SET_PARAM_VALUE), before | AREAS);
    case RT_MSG_MISSION_COUNT:
        return payload[RT_MISSION_COUNT_MISSION_TYPE] == RT_MAV_MISSION_TYPE_FENCE;
    case RT_MSG_MISSION_CLEAR_ALL:
        return payload[RT_MISSION_CLEAR_ALL_MISSION_TYPE] == RT_MAV_MISSION_TYPE_FENCE;
    case RT_MSG_MISSION_ITEM_INT: /* `current` must be 0: 2 and 3 are ArduPilot's encodings of "go there now" */
        number = rt_u16(frame, RT_MISSION_ITEM_INT_COMMAND);
        return payload[RT_MISSION_ITEM_INT_MISSION_TYPE] == RT_MAV_MISSION_TYPE_FENCE &&
               payload[RT_MISSION_ITEM_INT_CURRENT] == 0 && number >= RT_MAV_CMD_NAV_FENCE_RETURN_POINT &&
               number <= RT_MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION;
    default:
        return false;
    }
}

bool rt_setting_of(const rt_frame *frame, bool bytewise, rt_setting *setting) {
    uint32_t name, value, kind;
    if (frame->message == RT_MSG_PARAM_SET) {
        name = RT_PARAM_SET_PARAM_ID, value = RT_PARAM_SET_PARAM_VALUE, kind = RT_PARAM_SET_PARAM_TYPE;
    } else if (frame->message == RT_MSG_PARAM_VALUE) {
        name = RT_PARAM_VALUE_PARAM_ID, value = RT_PARAM_VALUE_PARAM_VALUE, kind = RT_PARAM_VALUE_PARAM_TYPE;
    } else {
        return false;
    }
    memcpy(setting->name, frame->payload + name, RT_NAME_OCTETS);
    setting->value = 0;
    setting->is_number = rt_bits_of(rt_u32(frame, value), frame->payload[kind], bytewise, &setting->value);
    return true;
}

/* ---------------------------------------------------------------- motion */

bool rt_is_forced_arming(const rt_frame *frame) {
    if (frame->message == RT_MSG_COMMAND_LONG)
        return rt_u16(frame, RT_COMMAND_LONG_COMMAND) == RT_MAV_CMD_COMPONENT_ARM_DISARM &&
               !rt_is_zero(rt_u32(frame, RT_COMMAND_LONG_PARAM2));
    if (frame->message == RT_MSG_COMMAND_INT)
        return rt_u16(frame, RT_COMMAND_INT_COMMAND) == RT_MAV_CMD_COMPONENT_ARM_DISARM &&
               !rt_is_zero(rt_u32(frame, RT_COMMAND_INT_PARAM2));
    return false;
}

static bool is_about(uint32_t metres, int64_t millimetres, int64_t within) {
    int64_t found = 0;
    if (!rt_multiplied(metres, 1000, &found))
        return false;
    return found - millimetres <= within && millimetres - found <= within;
}

static bool travels(const rt_command *command) { return command->kind == RT_FLY || command->kind == RT_COVER; }

static bool is_speed(uint32_t metres_per_second, const rt_command *command) {
    return command->speed > 0 && is_about(metres_per_second, command->speed, ROUNDING);
}

/* Whether a yaw in radians, from -pi to pi, is a heading in 1/100 degree. */
static bool is_heading(uint32_t yaw, int64_t heading) {
    int64_t found = 0, turned = heading <= RT_FULL_TURN / 2 ? heading : heading - RT_FULL_TURN;
    int64_t wanted = rt_floor(turned * 1745329252, 10000000); /* 1e-6 radian */
    return rt_multiplied(yaw, 1000000, &found) && found - wanted <= YAW_ROUNDING && wanted - found <= YAW_ROUNDING;
}

bool rt_leads_to(const rt_frame *frame, const rt_waypoint *point, bool home_known, int64_t home_amsl) {
    rt_point there = {0, 0};
    bool along = point->heading == RT_ALONG;
    if (!rt_point_of(frame, &there) || there.latitude != point->latitude || there.longitude != point->longitude)
        return false;
    if (frame->message == RT_MSG_COMMAND_INT) {
        uint32_t yaw = rt_u32(frame, RT_COMMAND_INT_PARAM4);
        return home_known && is_about(rt_u32(frame, RT_COMMAND_INT_Z), home_amsl + point->height, RT_DATUM_MOVES) &&
               (along ? rt_is_nan(yaw) : is_heading(yaw, point->heading));
    }
    uint32_t mask = rt_u16(frame, RT_SET_POSITION_TARGET_GLOBAL_INT_TYPE_MASK);
    return is_about(rt_u32(frame, RT_SET_POSITION_TARGET_GLOBAL_INT_ALT), point->height, ROUNDING) &&
           (along ? mask == RT_POSITION_ONLY
                  : mask == RT_POSITION_AND_YAW &&
                        is_heading(rt_u32(frame, RT_SET_POSITION_TARGET_GLOBAL_INT_YAW), point->heading));
}

static bool leads_there(const rt_frame *frame, const rt_command *command, bool home_known, int64_t home_amsl) {
    rt_way way = rt_way_of(command);
    rt_waypoint point = {0, 0, 0, 0};
    while (rt_next_waypoint(command, &way, &point))
        if (rt_leads_to(frame, &point, home_known, home_amsl))
            return true;
    return false;
}

/* Parameters 2 and 3 of DO_SET_MODE for a kind of motion; -1 if there are none. */
static void mode_of(uint8_t autopilot, int64_t kind, int64_t mode[2]) {
    static const int8_t px4[][2] = {
        [RT_HOLD] = {-1, -1}, [RT_CLIMB] = RT_PX4_HOLD, [RT_FLY] = {-1, -1}, [RT_COVER] = {-1, -1},
        [RT_HOME] = RT_PX4_RETURN, [RT_LAND] = RT_PX4_LAND,
    };
    static const int8_t copter[][2] = {
        [RT_HOLD] = RT_COPTER_BRAKE, [RT_CLIMB] = RT_COPTER_GUIDED, [RT_FLY] = RT_COPTER_GUIDED,
        [RT_COVER] = RT_COPTER_GUIDED, [RT_HOME] = RT_COPTER_RTL, [RT_LAND] = RT_COPTER_LAND,
    };
    const int8_t *found = autopilot == RT_MAV_AUTOPILOT_PX4 ? px4[kind] : copter[kind];
    mode[0] = found[0];
    mode[1] = found[1];
}

static bool is_long(const rt_frame *frame, const rt_command *command, uint8_t autopilot, bool home_known, int64_t home_amsl) {
    uint32_t p[8];
    int64_t mode[2];
    for (uint32_t at = 0; at < 7; at++)
        p[at + 1] = rt_u32(frame, parameters[at]);
    switch (rt_u16(frame, RT_COMMAND_LONG_COMMAND)) {
    case RT_MAV_CMD_DO_SET_MODE:
        mode_of(autopilot, command->kind, mode);
        return mode[0] >= 0 && rt_is_whole(p[1], RT_MAV_MODE_FLAG_CUSTOM_MODE_ENABLED) && rt_is_whole(p[2], mode[0]) &&
               rt_is_whole(p[3], mode[1]) && are_zero(frame, 4);
    case RT_MAV_CMD_COMPONENT_ARM_DISARM:
        return command->kind == RT_CLIMB && rt_is_whole(p[1], 1) && are_zero(frame, 2);
    case RT_MAV_CMD_NAV_TAKEOFF:
        if (command->kind != RT_CLIMB)
            return false;
        if (autopilot == RT_MAV_AUTOPILOT_PX4) /* it climbs at a finite place, turned to a finite heading */
            return rt_is_nan(p[4]) && rt_is_nan(p[5]) && rt_is_nan(p[6]) && (rt_is_nan(p[1]) || rt_is_zero(p[1])) &&
                   rt_is_zero(p[2]) && rt_is_zero(p[3]) && home_known &&
                   is_about(p[7], home_amsl + command->altitude, RT_DATUM_MOVES);
        for (uint32_t at = 1; at <= 6; at++)
            if (!rt_is_zero(p[at]))
                return false;
        return is_about(p[7], command->altitude, ROUNDING);
    case RT_MAV_CMD_DO_CHANGE_SPEED:
        return travels(command) && rt_is_whole(p[1], RT_SPEED_TYPE_GROUNDSPEED) && rt_is_whole(p[3], -1) &&
               is_speed(p[2], command) && are_zero(frame, 4);
    default:
        return false;
    }
}

/* Change to Hold, or only act in Hold, which overrides no pilot who chose another mode. */
static bool is_reposition(const rt_frame *frame) {
    uint32_t flags = rt_u32(frame, RT_COMMAND_INT_PARAM2);
    return rt_u16(frame, RT_COMMAND_INT_COMMAND) == RT_MAV_CMD_DO_REPOSITION &&
           frame->payload[RT_COMMAND_INT_FRAME] == RT_MAV_FRAME_GLOBAL &&
           (rt_is_whole(flags, RT_MAV_DO_REPOSITION_FLAGS_CHANGE_MODE) || rt_is_zero(flags));
}

/* DO_REPOSITION without place, height and heading: PX4 brakes, and stays where it stops. */
static bool is_stop(const rt_frame *frame) {
    return is_reposition(frame) && rt_i32(frame, RT_COMMAND_INT_X) == RT_NO_PLACE &&
           rt_i32(frame, RT_COMMAND_INT_Y) == RT_NO_PLACE && rt_is_nan(rt_u32(frame, RT_COMMAND_INT_Z)) &&
           rt_is_nan(rt_u32(frame, RT_COMMAND_INT_PARAM4)) && rt_is_whole(rt_u32(frame, RT_COMMAND_INT_PARAM1), -1) &&
           rt_is_zero(rt_u32(frame, RT_COMMAND_INT_PARAM3));
}

/* A circle's radius would be another manoeuvre. */
static bool repositions(const rt_frame *frame, const rt_command *command, bool home_known, int64_t home_amsl) {
    uint32_t speed = rt_u32(frame, RT_COMMAND_INT_PARAM1);
    return is_reposition(frame) && travels(command) && rt_is_zero(rt_u32(frame, RT_COMMAND_INT_PARAM3)) &&
           (command->speed != 0 ? is_speed(speed, command) : rt_is_whole(speed, -1)) &&
           leads_there(frame, command, home_known, home_amsl);
}

/* Fields that the mask excludes may have any value. */
static bool targets(const rt_frame *frame, const rt_command *command) {
    return frame->payload[RT_SET_POSITION_TARGET_GLOBAL_INT_COORDINATE_FRAME] == RT_MAV_FRAME_GLOBAL_RELATIVE_ALT_INT &&
           travels(command) && leads_there(frame, command, false, 0);
}

bool rt_carries_out(const rt_frame *frame, const rt_command *command, uint8_t autopilot, bool home_known, int64_t home_amsl) {
    bool px4 = autopilot == RT_MAV_AUTOPILOT_PX4;
    switch (frame->message) {
    case RT_MSG_COMMAND_LONG:
        return is_long(frame, command, autopilot, home_known, home_amsl);
    case RT_MSG_COMMAND_INT:
        if (px4 && command->kind == RT_HOLD)
            return is_stop(frame);
        return px4 && repositions(frame, command, home_known, home_amsl);
    case RT_MSG_SET_POSITION_TARGET_GLOBAL_INT:
        return !px4 && targets(frame, command);
    default:
        return false;
    }
}

bool rt_point_of(const rt_frame *frame, rt_point *point) {
    if (frame->message == RT_MSG_COMMAND_INT)
        *point = (rt_point){rt_i32(frame, RT_COMMAND_INT_X), rt_i32(frame, RT_COMMAND_INT_Y)};
    else if (frame->message == RT_MSG_SET_POSITION_TARGET_GLOBAL_INT)
        *point = (rt_point){rt_i32(frame, RT_SET_POSITION_TARGET_GLOBAL_INT_LAT_INT),
                            rt_i32(frame, RT_SET_POSITION_TARGET_GLOBAL_INT_LON_INT)};
    else
        return false;
    return point->latitude != RT_NO_PLACE || point->longitude != RT_NO_PLACE;
}

bool rt_is_near(rt_point here, rt_point point) {
    int64_t north = here.latitude - point.latitude;
    if (!rt_within(north, -NEAR, NEAR)) return false;
    /* The latitude of `point`, which is near that of `here`, so within 32 bits, and this within 2**23. */
    int64_t thousandths = rt_abs(here.latitude - north) / 10000, square = thousandths * thousandths;
    int64_t cosine = rt_floor((180000LL * 180000 - 4 * square) * (1LL << RT_SHIFT), 180000LL * 180000 + square);
    int64_t east = rt_floor(rt_east_of(here.longitude, point.longitude) * cosine, 1LL << RT_SHIFT);
    return rt_within(east, -NEAR, NEAR) && north * north + east * east <= NEAR * NEAR;
}
