#include "frames.h"
#include "mavlink/parameters.h"

#define HOME_MOVES 10000    /* mm */
#define STANDS_US 3000000LL /* us */
#define NEAR_LEVEL 3000     /* mm */

void rt_gate_open(rt_gate *gate, const rt_command *command, int64_t not_after_us) {
    gate->open = gate->started = true;
    gate->command = *command;
    gate->not_after_us = not_after_us;
    gate->begun = gate->let_out = false;
    gate->leg = -1;
    rt_payload_open(&gate->payload, command, gate->system);
    rt_gate_prepared(gate);
    if (!gate->settled_known || command->kind == RT_CLIMB) {
        gate->settled_known = gate->home_known;
        gate->settled_amsl = gate->home_amsl;
    }
}

void rt_gate_close(rt_gate *gate) {
    gate->open = false;
    rt_payload_close(&gate->payload);
}

void rt_gate_prepare(rt_gate *gate, const rt_preparation *preparation) {
    gate->prepared_count = preparation->count;
    gate->prepared_us = preparation->not_after_us;
    for (uint32_t at = 0; at < preparation->count; at++) {
        memcpy(gate->prepared[at].name, preparation->writes[at].name, RT_NAME_OCTETS);
        gate->prepared[at].value = preparation->writes[at].value;
    }
}

void rt_gate_prepared(rt_gate *gate) { gate->prepared_count = 0; }

bool rt_gate_stands(const rt_gate *gate, int64_t now_us) {
    int64_t oldest = gate->armed_us < gate->stands_us ? gate->armed_us : gate->stands_us;
    return oldest > (now_us > STANDS_US ? now_us - STANDS_US : 0) && !gate->armed && !gate->open;
}

static bool is_bytewise(const rt_gate *gate) { return gate->autopilot == RT_MAV_AUTOPILOT_PX4; }

void rt_gate_observe(rt_gate *gate, rt_bytes octets, int64_t now_us) {
    rt_frame heard;
    rt_setting told;
    if (!rt_read_frame(octets, &heard))
        return;
    if (heard.component != RT_MAV_COMP_ID_AUTOPILOT1) {
        if (heard.message == RT_MSG_HEARTBEAT && gate->system != 0 && heard.system == gate->system)
            rt_payload_hear(&gate->payload, &heard);
        return;
    }
    if (heard.message == RT_MSG_HEARTBEAT) {
        uint8_t autopilot = heard.payload[RT_HEARTBEAT_AUTOPILOT], kind = heard.payload[RT_HEARTBEAT_TYPE];
        bool known = autopilot == RT_MAV_AUTOPILOT_PX4 || autopilot == RT_MAV_AUTOPILOT_ARDUPILOTMEGA;
        bool vehicle = kind < 64 && (RT_VEHICLES >> kind & 1) != 0; /* not a ground station, gimbal or companion */
        if (gate->system == 0 && known && vehicle) {
            gate->system = heard.system;
            gate->autopilot = autopilot;
            gate->kind = kind;
        }
        if (heard.system == gate->system && autopilot == gate->autopilot && kind == gate->kind) {
            gate->armed = (heard.payload[RT_HEARTBEAT_BASE_MODE] & RT_MAV_MODE_FLAG_SAFETY_ARMED) != 0;
            gate->armed_us = now_us;
        }
    } else if (heard.system != gate->system) {
        return;
    } else if (heard.message == RT_MSG_GLOBAL_POSITION_INT) {
        gate->here_known = true;
        gate->here.latitude = rt_i32(&heard, RT_GLOBAL_POSITION_INT_LAT);
        gate->here.longitude = rt_i32(&heard, RT_GLOBAL_POSITION_INT_LON);
        gate->above_home = rt_i32(&heard, RT_GLOBAL_POSITION_INT_RELATIVE_ALT);
        int64_t home = (int64_t)rt_i32(&heard, RT_GLOBAL_POSITION_INT_ALT) - gate->above_home;
        int64_t moved = home - gate->settled_amsl;
        if (!gate->settled_known || (moved <= HOME_MOVES && moved >= -HOME_MOVES)) {
            gate->home_known = true;
            gate->home_amsl = home;
        }
    } else if (heard.message == RT_MSG_EXTENDED_SYS_STATE) {
        bool down = heard.payload[RT_EXTENDED_SYS_STATE_LANDED_STATE] == RT_MAV_LANDED_STATE_ON_GROUND;
        gate->stands_us = down ? now_us : 0;
    } else if (heard.message == RT_MSG_PARAM_VALUE && rt_setting_of(&heard, is_bytewise(gate), &told)) {
        static const uint8_t fence_type[RT_NAME_OCTETS] = "FENCE_TYPE";
        if (memcmp(told.name, fence_type, RT_NAME_OCTETS) == 0) {
            gate->types_known = true;
            gate->types = told.value; /* 0 if it is not a number */
        }
    }
}

static bool is_prepared(const rt_gate *gate, const rt_setting *setting, int64_t now_us) {
    if (!setting->is_number || now_us > gate->prepared_us)
        return false;
    for (uint32_t at = 0; at < gate->prepared_count; at++)
        if (gate->prepared[at].value == setting->value && memcmp(gate->prepared[at].name, setting->name, RT_NAME_OCTETS) == 0)
            return true;
    return false;
}

/* Whether the vehicle is close enough to a point of the path for the next leg to begin. */
static bool is_at(const rt_gate *gate, const rt_waypoint *point) {
    bool level = gate->command.heights.count == 0 || rt_within(gate->above_home - point->height, -NEAR_LEVEL, NEAR_LEVEL);
    return level && gate->here_known && rt_is_near(gate->here, (rt_point){point->latitude, point->longitude});
}

static rt_refusal refuse_motion(rt_gate *gate, const rt_frame *frame, int64_t now_us) {
    rt_point point = {0, 0};
    rt_waypoint last = {0, 0, 0, 0}, next = {0, 0, 0, 0};
    if (!gate->open)
        return "frame/no-session";
    if (!rt_carries_out(frame, &gate->command, gate->autopilot, gate->home_known, gate->home_amsl))
        return "frame/not-covered";
    if (!gate->begun && now_us > gate->not_after_us)
        return "frame/late";
    if (rt_point_of(frame, &point)) {
        bool has_last = rt_waypoint_at(&gate->command, gate->leg, &last);
        bool there = !has_last || is_at(gate, &last); /* else it would cut the corner */
        bool has_next = rt_waypoint_at(&gate->command, gate->leg + 1, &next);
        if (has_last && rt_leads_to(frame, &last, gate->home_known, gate->home_amsl)) {
            /* or once more to the present target */
        } else if (there && has_next && rt_leads_to(frame, &next, gate->home_known, gate->home_amsl)) {
            gate->leg++;
        } else {
            return "frame/out-of-order";
        }
    }
    gate->begun = gate->let_out = true;
    return NULL;
}

static bool is_for_autopilot(const rt_frame *frame) {
    return !frame->has_target || frame->target_component == RT_MAV_COMP_ID_AUTOPILOT1;
}

/* Whether the addressee is the autopilot, or of a command also a camera or a gimbal of the vehicle. */
static bool is_for(const rt_gate *gate, const rt_frame *frame) {
    const bool payload = frame->message == RT_MSG_COMMAND_LONG && rt_payload_has(&gate->payload, frame->target_component);
    return frame->target_system == gate->system && (is_for_autopilot(frame) || payload);
}

static rt_refusal refuse_payload(rt_gate *gate, const rt_frame *frame, int64_t now_us) {
    rt_refusal refused = rt_payload_refuse(&gate->payload, frame, now_us, gate->autopilot, gate->home_known, gate->home_amsl);
    gate->let_out = gate->let_out || refused == NULL;
    return refused;
}

/* Why no permit could allow a frame. */
static rt_refusal refuse_always(const rt_gate *gate, const rt_frame *frame) {
    if (frame->system != gate->system || frame->component != RT_MAV_COMP_ID_ONBOARD_COMPUTER)
        return "frame/not-ours";
    if (frame->has_target && !is_for(gate, frame) && (frame->target_system != gate->system || !rt_asks_camera(frame)))
        return "frame/wrong-target";
    return rt_is_forced_arming(frame) ? "frame/forced-arming" : NULL;
}

/* Why a frame is refused; `*carries` if it passes and carries out a command. */
static rt_refusal refuse(rt_gate *gate, rt_bytes octets, int64_t now_us, bool *carries) {
    rt_frame frame;
    rt_setting setting;
    /* 1. exactly one frame, from us, to the autopilot that was heard, or to a camera beside it, and to nobody else */
    if (!rt_read_frame(octets, &frame))
        return "frame/not-one-frame";
    if (gate->system == 0) /* a vehicle may wait for a first message; it only learns our ids */
        return rt_is_greeting(&frame) && frame.component == RT_MAV_COMP_ID_ONBOARD_COMPUTER ? NULL : "frame/no-vehicle";
    /* 2. never, even with a permit */
    rt_refusal refused = refuse_always(gate, &frame);
    if (refused != NULL)
        return refused;
    /* 3. always, or before the flight */
    if (rt_is_housekeeping(&frame))
        return NULL;
    if (gate->chain->over)
        return "frame/session-over";
    if (rt_is_payload(&frame)) {
        *carries = true;
        return refuse_payload(gate, &frame, now_us);
    }
    if (!is_for_autopilot(&frame))
        return "frame/wrong-target";
    bool sets = frame.message == RT_MSG_PARAM_SET && rt_setting_of(&frame, is_bytewise(gate), &setting);
    if (sets && is_prepared(gate, &setting, now_us))
        return rt_gate_stands(gate, now_us) ? NULL : "frame/not-down";
    if (rt_is_of_fence(&frame, gate->types_known, gate->types))
        return gate->started || gate->armed ? "frame/after-start" : NULL;
    if (sets)
        return "frame/not-listed";
    /* 4. what is permitted now */
    *carries = true;
    return refuse_motion(gate, &frame, now_us);
}

rt_refusal rt_gate_seal(rt_gate *gate, rt_bytes frame, int64_t now_us, uint8_t *out, uint32_t *size) {
    bool carries = false;
    rt_refusal refused = refuse(gate, frame, now_us, &carries);
    const uint32_t whole = (uint32_t)rt_min(frame.size, RT_LARGEST_FRAME - RT_SIGNATURE); /* which no frame exceeds */
    *size = 0;
    if (refused != NULL) {
        rt_chain_stop(gate->chain, frame);
        return refused;
    }
    if (carries) rt_chain_leave(gate->chain, frame);
    memcpy(out, frame.at, whole);
    *size = gate->signs ? rt_sign_frame(&gate->signer, out, whole, now_us) : whole;
    return NULL;
}

/* Why a frame is not signed ahead for a command: the rules of the gate, as if it were open for the command. */
static rt_refusal refuse_ahead(const rt_gate *gate, const rt_command *command, rt_bytes octets) {
    rt_frame frame;
    rt_point point = {0, 0};
    rt_waypoint first = {0, 0, 0, 0};
    if (!rt_read_frame(octets, &frame))
        return "frame/not-one-frame";
    if (gate->system == 0)
        return "frame/no-vehicle";
    rt_refusal refused = refuse_always(gate, &frame);
    if (refused != NULL)
        return refused;
    if (!is_for_autopilot(&frame))
        return "frame/wrong-target";
    if (!rt_carries_out(&frame, command, gate->autopilot, gate->home_known, gate->home_amsl))
        return "frame/not-covered";
    if (!rt_point_of(&frame, &point))
        return NULL;
    bool is_first = rt_waypoint_at(command, 0, &first) &&
                    rt_leads_to(&frame, &first, gate->home_known, gate->home_amsl); /* the others wait until the vehicle is there */
    return is_first ? NULL : "frame/out-of-order";
}

rt_refusal rt_gate_sign_ahead(rt_gate *gate, const rt_command *command, rt_bytes frame, int64_t now_us, uint8_t *out) {
    uint8_t octets[RT_LARGEST_FRAME] = {0};
    rt_refusal refused = refuse_ahead(gate, command, frame);
    if (refused != NULL)
        return refused;
    const uint32_t whole = (uint32_t)rt_min(frame.size, RT_LARGEST_FRAME - RT_SIGNATURE); /* which no frame exceeds */
    if (gate->signs) {
        memcpy(octets, frame.at, whole);
        if (rt_sign_ahead(&gate->signer, octets, whole, now_us) == 0)
            return "frame/too-many-ahead";
        memcpy(out, octets + whole, RT_SIGNATURE);
        rt_chain_sign_ahead(gate->chain, frame);
        gate->let_out = true;
    }
    return NULL;
}
