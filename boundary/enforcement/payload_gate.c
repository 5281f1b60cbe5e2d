#include "payload_gate.h"

#include "allow_list.h"
#include "mavlink/parameters.h"

#define DEGREES 10000000 /* in 1e-7 degree */
#define METRES 1000      /* in mm */
#define SECOND 1000000   /* in us */

static const uint32_t parameters[7] = {
    RT_COMMAND_LONG_PARAM1, RT_COMMAND_LONG_PARAM2, RT_COMMAND_LONG_PARAM3, RT_COMMAND_LONG_PARAM4,
    RT_COMMAND_LONG_PARAM5, RT_COMMAND_LONG_PARAM6, RT_COMMAND_LONG_PARAM7,
};

/* Nothing here moves or arms the vehicle, or changes what it may do. */
static bool is_listed(uint16_t command) {
    switch (command) {
    case RT_MAV_CMD_IMAGE_START_CAPTURE:
    case RT_MAV_CMD_IMAGE_STOP_CAPTURE:
    case RT_MAV_CMD_VIDEO_START_CAPTURE:
    case RT_MAV_CMD_VIDEO_STOP_CAPTURE:
    case RT_MAV_CMD_SET_CAMERA_MODE:
    case RT_MAV_CMD_SET_CAMERA_ZOOM:
    case RT_MAV_CMD_SET_CAMERA_FOCUS:
    case RT_MAV_CMD_DO_DIGICAM_CONTROL:
    case RT_MAV_CMD_DO_TRIGGER_CONTROL:
    case RT_MAV_CMD_DO_SET_CAM_TRIGG_DIST:
    case RT_MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW:
    case RT_MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE:
    case RT_MAV_CMD_DO_MOUNT_CONTROL:
    case RT_MAV_CMD_DO_SET_ROI_LOCATION:
    case RT_MAV_CMD_DO_SET_ROI_NONE:
    case RT_MAV_CMD_DO_GRIPPER:
    case RT_MAV_CMD_DO_WINCH:
    case RT_MAV_CMD_DO_SET_SERVO:
        return true;
    default:
        return false;
    }
}

bool rt_is_payload(const rt_frame *frame) {
    return frame->message == RT_MSG_COMMAND_LONG && is_listed(rt_u16(frame, RT_COMMAND_LONG_COMMAND));
}

/* ---------------------------------------------------------------- the commands of a step */

static uint32_t number_of(const rt_emission_parameter *parameter, rt_list arguments, const rt_policy *policy, rt_payload_frame *frame) {
    const uint32_t cell = (uint32_t)parameter->cell;
    int64_t latitude, longitude;
    switch (parameter->origin) {
    case RT_OF_ARGUMENT:
        return rt_nearest_bits(rt_int_at(arguments, cell), parameter->value);
    case RT_LATITUDE:
    case RT_LONGITUDE:
        rt_unproject(&policy->projection, rt_int_at(arguments, cell), rt_int_at(arguments, cell + 1), &latitude, &longitude);
        return rt_nearest_bits(parameter->origin == RT_LATITUDE ? latitude : longitude, DEGREES);
    case RT_HEIGHT:
        frame->has_height = true;
        frame->height = parameter->cell < 0 ? parameter->value : rt_int_at(arguments, cell);
        return rt_nearest_bits(frame->height, METRES);
    default:
        return (uint32_t)parameter->value;
    }
}

void rt_payload_of(const rt_invocation *invocation, const rt_policy *policy, rt_command *command) {
    const int64_t points = invocation->plan.path.count / 2;
    rt_list left = invocation->contract.emits;
    rt_emission emission;
    command->servos = policy->vehicle.servos;
    while (command->payload_count < RT_MAX_EMISSIONS && rt_next_emission(&left, &emission)) {
        rt_payload_frame *frame = &command->payload[command->payload_count++];
        rt_list numbers = emission.parameters;
        rt_emission_parameter parameter;
        for (uint32_t at = 0; at < 7 && rt_next_emission_parameter(&numbers, &parameter); at++)
            frame->numbers[at] = number_of(&parameter, invocation->arguments, policy, frame);
        frame->command = (uint16_t)emission.command;
        frame->addressee = (uint8_t)emission.addressee;
        frame->interval_us = emission.moment == RT_BY_DISTANCE ? emission.amount * SECOND / policy->vehicle.speed : emission.amount;
        frame->most = emission.moment == RT_AT_WAYPOINT ? points : emission.moment == RT_AT_TURN ? rt_max(points - 2, 0) : 1;
    }
}

/* ---------------------------------------------------------------- what may leave */

static void open_frame(rt_payload_gate *gate, const rt_payload_frame *frame) {
    if (gate->count > RT_MAX_EMISSIONS) return; /* there is room for one more than a contract has */
    memset(&gate->open[gate->count], 0, sizeof gate->open[0]);
    gate->open[gate->count++].frame = *frame;
}

void rt_payload_open(rt_payload_gate *gate, const rt_command *command, uint8_t system) {
    gate->count = 0;
    gate->servos = command->servos;
    for (uint32_t at = 0; at < command->payload_count && at < RT_MAX_EMISSIONS; at++) {
        const rt_payload_frame *pointing = &command->payload[at];
        if (pointing->command != RT_MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW)
            continue;
        const uint32_t keep = rt_nearest_bits(-1, 1);
        const rt_payload_frame control = {
            {rt_nearest_bits(system, 1), rt_nearest_bits(RT_MAV_COMP_ID_ONBOARD_COMPUTER, 1), keep, keep, 0, 0, pointing->numbers[6]},
            RT_MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, pointing->addressee, false, 0, 1, 0};
        open_frame(gate, &control);
        break;
    }
    for (uint32_t at = 0; at < command->payload_count && at < RT_MAX_EMISSIONS; at++)
        open_frame(gate, &command->payload[at]);
}

void rt_payload_close(rt_payload_gate *gate) { gate->count = 0; }

static bool is_camera(uint8_t component) {
    return component >= RT_MAV_COMP_ID_CAMERA && component <= RT_MAV_COMP_ID_CAMERA6;
}

static bool is_gimbal(uint8_t component) {
    return component == RT_MAV_COMP_ID_GIMBAL || (component >= RT_MAV_COMP_ID_GIMBAL2 && component <= RT_MAV_COMP_ID_GIMBAL6);
}

void rt_payload_hear(rt_payload_gate *gate, const rt_frame *heartbeat) {
    const uint8_t kind = heartbeat->payload[RT_HEARTBEAT_TYPE], component = heartbeat->component;
    if (gate->camera == 0 && kind == RT_MAV_TYPE_CAMERA && is_camera(component))
        gate->camera = component;
    if (gate->gimbal == 0 && kind == RT_MAV_TYPE_GIMBAL && is_gimbal(component))
        gate->gimbal = component;
}

bool rt_payload_has(const rt_payload_gate *gate, uint8_t component) {
    return component != 0 && (component == gate->camera || component == gate->gimbal);
}

/* The one that was heard, else the autopilot, which then has the payload itself. */
static uint8_t component_of(const rt_payload_gate *gate, uint8_t addressee) {
    uint8_t heard = addressee == RT_CAMERA ? gate->camera : addressee == RT_GIMBAL ? gate->gimbal : 0;
    return heard != 0 ? heard : RT_MAV_COMP_ID_AUTOPILOT1;
}

static bool same_number(uint32_t one, uint32_t other) {
    return one == other || (rt_is_nan(one) && rt_is_nan(other));
}

static bool same_numbers(const rt_frame *frame, const uint32_t numbers[7], uint32_t count) {
    for (uint32_t at = 0; at < count; at++)
        if (!same_number(rt_u32(frame, parameters[at]), numbers[at])) return false;
    return true;
}

static bool is_free(const rt_payload_gate *gate, uint32_t channel) {
    rt_list left = gate->servos;
    int64_t servo;
    while (rt_next_int(&left, &servo))
        if (channel == rt_nearest_bits(servo, 1)) return true;
    return false;
}

/* Whether a command is the declared one, to the bit, but for the height of home. */
static bool is_declared(const rt_payload_gate *gate, const rt_frame *frame, const rt_payload_frame *declared, uint8_t autopilot,
                        bool home_known, int64_t home_amsl) {
    int64_t found = 0;
    if (rt_u16(frame, RT_COMMAND_LONG_COMMAND) != declared->command) return false;
    if (declared->command == RT_MAV_CMD_DO_SET_SERVO && !is_free(gate, rt_u32(frame, RT_COMMAND_LONG_PARAM1))) return false;
    if (!declared->has_height || autopilot != RT_MAV_AUTOPILOT_PX4) return same_numbers(frame, declared->numbers, 7);
    if (!home_known || !same_numbers(frame, declared->numbers, 6)) return false;
    return rt_multiplied(rt_u32(frame, RT_COMMAND_LONG_PARAM7), 1000, &found) &&
           rt_within(found - home_amsl - declared->height, -RT_DATUM_MOVES, RT_DATUM_MOVES);
}

static bool passes(rt_sendings *sendings, uint8_t confirmation, int64_t now_us) {
    const rt_payload_frame *frame = &sendings->frame;
    if (confirmation != 0) {
        if (sendings->retries == 0) return false;
        sendings->retries--;
        return true;
    }
    if (frame->interval_us != 0 ? sendings->sent != 0 && now_us < sendings->last_us + frame->interval_us : sendings->sent >= frame->most)
        return false;
    sendings->sent++;
    sendings->last_us = now_us;
    sendings->retries = RT_RETRIES;
    return true;
}

/* The command that ends what a frame begins; false if it begins nothing that goes on. */
static bool ending_of(const rt_frame *frame, rt_ending *ending) {
    const uint32_t one = rt_u32(frame, RT_COMMAND_LONG_PARAM1), three = rt_u32(frame, RT_COMMAND_LONG_PARAM3),
                   four = rt_u32(frame, RT_COMMAND_LONG_PARAM4), seven = rt_u32(frame, RT_COMMAND_LONG_PARAM7);
    const uint32_t keep = rt_nearest_bits(-1, 1), give_back = rt_nearest_bits(-3, 1);
    const uint8_t to = frame->target_component;
    switch (rt_u16(frame, RT_COMMAND_LONG_COMMAND)) {
    case RT_MAV_CMD_IMAGE_START_CAPTURE:
        *ending = (rt_ending){RT_MAV_CMD_IMAGE_STOP_CAPTURE, {one, RT_NAN, RT_NAN, RT_NAN, 0, 0, RT_NAN}, to, 1 + RT_RETRIES};
        return three != rt_nearest_bits(1, 1);
    case RT_MAV_CMD_VIDEO_START_CAPTURE:
        *ending = (rt_ending){RT_MAV_CMD_VIDEO_STOP_CAPTURE, {one, three, RT_NAN, RT_NAN, 0, 0, RT_NAN}, to, 1 + RT_RETRIES};
        return true;
    case RT_MAV_CMD_DO_SET_CAM_TRIGG_DIST:
        *ending = (rt_ending){RT_MAV_CMD_DO_SET_CAM_TRIGG_DIST, {0, 0, 0, four, 0, 0, 0}, to, 1 + RT_RETRIES};
        return one != 0;
    case RT_MAV_CMD_DO_TRIGGER_CONTROL:
        *ending = (rt_ending){RT_MAV_CMD_DO_TRIGGER_CONTROL, {0, keep, keep, 0, 0, 0, 0}, to, 1 + RT_RETRIES};
        return one != 0 && one != keep && !rt_is_nan(one);
    case RT_MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE:
        *ending = (rt_ending){RT_MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, {give_back, give_back, keep, keep, 0, 0, seven}, to, 1 + RT_RETRIES};
        return one != give_back;
    default:
        return false;
    }
}

static void forget(rt_payload_gate *gate, uint32_t at) {
    for (; at + 1 < gate->ending_count && at + 1 < RT_MOST_ENDINGS; at++) gate->endings[at] = gate->endings[at + 1];
    if (gate->ending_count > 0) gate->ending_count--;
}

static bool same_ending(const rt_ending *one, const rt_ending *other) {
    for (uint32_t at = 0; at < 7; at++)
        if (!same_number(one->numbers[at], other->numbers[at])) return false;
    return one->command == other->command && one->component == other->component;
}

/* A command passed: what it begins may be ended, and what it ends has been. A first parameter of 0 ends all of a kind. */
static void begun(rt_payload_gate *gate, const rt_frame *frame) {
    const uint16_t command = rt_u16(frame, RT_COMMAND_LONG_COMMAND);
    const uint32_t one = rt_u32(frame, RT_COMMAND_LONG_PARAM1);
    rt_ending ending = {0};
    const bool begins = ending_of(frame, &ending);
    for (uint32_t at = RT_MOST_ENDINGS; at-- > 0;) {
        if (at >= gate->ending_count) continue;
        const rt_ending *each = &gate->endings[at];
        const bool ended = each->command == command && each->component == frame->target_component && (one == 0 || same_number(one, each->numbers[0]));
        if (begins ? same_ending(each, &ending) : ended) forget(gate, at);
    }
    if (!begins) return;
    if (gate->ending_count >= RT_MOST_ENDINGS) forget(gate, 0);
    if (gate->ending_count < RT_MOST_ENDINGS) gate->endings[gate->ending_count++] = ending;
}

rt_refusal rt_payload_refuse(rt_payload_gate *gate, const rt_frame *frame, int64_t now_us, uint8_t autopilot, bool home_known,
                             int64_t home_amsl) {
    rt_refusal found = "frame/not-covered";
    for (uint32_t at = 0; at < gate->count && at <= RT_MAX_EMISSIONS; at++) {
        rt_sendings *each = &gate->open[at];
        if (!is_declared(gate, frame, &each->frame, autopilot, home_known, home_amsl)) continue;
        if (frame->target_component != component_of(gate, each->frame.addressee)) {
            found = "frame/wrong-target";
        } else if (passes(each, frame->payload[RT_COMMAND_LONG_CONFIRMATION], now_us)) {
            begun(gate, frame);
            return NULL;
        } else {
            found = "frame/too-often";
        }
    }
    for (uint32_t at = 0; at < gate->ending_count && at < RT_MOST_ENDINGS; at++) {
        rt_ending *ending = &gate->endings[at];
        if (ending->command != rt_u16(frame, RT_COMMAND_LONG_COMMAND) || ending->component != frame->target_component ||
            !same_numbers(frame, ending->numbers, 7))
            continue;
        if (--ending->left == 0) forget(gate, at);
        return NULL;
    }
    return found;
}
