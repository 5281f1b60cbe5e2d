/* Frama-C's Eva runs this: the gate on any frame from either side, in any state, under any permitted command; and the signed link. */
#include "seal.h"
#include "enforcement/frames.h"

static uint8_t octets[RT_LARGEST_FRAME + 1], out[RT_LARGEST_FRAME], path[16];
static rt_gate gate;
static rt_chain chain;
static rt_preparation preparation;
static rt_invocation invocation;
static rt_policy policy;

/* The checks ensure these bounds for every coordinate of a path (decision/checks). */
bool rt_next_int(rt_list *list, int64_t *value) {
    if (list->count == 0) return false;
    list->count--;
    *value = WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE);
    return true;
}

/* The checks ensure these bounds for the numbers of a command to payload and its arguments. */
bool rt_next_emission(rt_list *list, rt_emission *emission) {
    if (list->count == 0) return false;
    list->count--;
    ANY(*emission);
    emission->amount = WITHIN(0, RT_MAX_DURATION);
    if (emission->moment == RT_BY_DISTANCE) emission->amount = WITHIN(1, RT_MAX_COORDINATE);
    emission->parameters.count = 7;
    return true;
}

bool rt_next_emission_parameter(rt_list *list, rt_emission_parameter *parameter) {
    if (list->count == 0) return false;
    list->count--;
    parameter->origin = WITHIN(RT_CONSTANT, RT_HEIGHT);
    parameter->cell = WITHIN(-1, RT_MAX_CELLS - 2);
    parameter->value = parameter->origin == RT_OF_ARGUMENT ? WITHIN(1, RT_MAX_DIVISOR) : WITHIN(RT_LOWEST, UINT32_MAX);
    return true;
}

int64_t rt_int_at(rt_list list, uint32_t index) { return WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE); }

void rt_chain_stop(rt_chain *of, rt_bytes frame) { read_all(frame); }
void rt_chain_sign_ahead(rt_chain *of, rt_bytes frame) { read_all(frame); }
void rt_chain_leave(rt_chain *of, rt_bytes frame) { read_all(frame); }

static void bound(rt_payload_frame *frame) {
    frame->has_height = EITHER();
    frame->height = WITHIN(RT_LOWEST, RT_HIGHEST);
    frame->interval_us = WITHIN(0, RT_MAX_DURATION);
}

static void begin(rt_command *command) {
    const int64_t factor = 32LL << RT_SHIFT;
    ANY(*command);
    command->kind = WITHIN(RT_HOLD, RT_LAND);
    command->altitude = WITHIN(RT_LOWEST, RT_HIGHEST);
    command->speed = WITHIN(0, RT_MAX_SPEED);
    command->path = (rt_list){path, path + sizeof path, SIZE(2 * RT_MAX_PATH)};
    command->heights = (rt_list){path, path + sizeof path, SIZE(RT_MAX_PATH)};
    command->headings = (rt_list){path, path + sizeof path, SIZE(RT_MAX_PATH)};
    command->has_place = EITHER();
    command->place[0] = WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE);
    command->place[1] = WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE);
    command->projection = (rt_projection){WITHIN(-900000000, 900000000), WITHIN(-RT_HALF_TURN, RT_HALF_TURN), WITHIN(1, factor), WITHIN(1, factor)};
    command->payload_count = SIZE(RT_MAX_EMISSIONS);
    for (uint32_t at = 0; at < RT_MAX_EMISSIONS; at++) bound(&command->payload[at]);
    command->servos = (rt_list){path, path + sizeof path, SIZE(RT_MAX_SERVOS)};
    ANY(gate);
    gate.payload.servos = command->servos;
    gate.payload.count = SIZE(1 + RT_MAX_EMISSIONS);
    gate.payload.ending_count = SIZE(RT_MOST_ENDINGS);
    for (uint32_t at = 0; at <= RT_MAX_EMISSIONS; at++) {
        bound(&gate.payload.open[at].frame);
        gate.payload.open[at].sent = WITHIN(0, RT_MAX_VALUE);
        gate.payload.open[at].last_us = WITHIN(0, RT_MAX_VALUE);
    }
    gate.chain = &chain;
    gate.command = *command;
    gate.signs = EITHER(), gate.open = EITHER(), gate.begun = EITHER(), gate.here_known = EITHER(), gate.started = EITHER();
    gate.armed = EITHER(), gate.types_known = EITHER(), gate.home_known = EITHER(), gate.settled_known = EITHER();
    gate.leg = WITHIN(-1, RT_MAX_PATH);
    gate.here = (rt_point){WITHIN(INT32_MIN, INT32_MAX), WITHIN(INT32_MIN, INT32_MAX)};
    gate.above_home = WITHIN(INT32_MIN, INT32_MAX);
    gate.home_amsl = WITHIN(-(1LL << 32), 1LL << 32);
    gate.settled_amsl = WITHIN(-(1LL << 32), 1LL << 32);
    gate.prepared_count = SIZE(RT_MAX_WRITES);
    for (uint32_t at = 0; at < RT_MAX_WRITES; at++) gate.prepared[at].is_number = EITHER();
}

static void begin_link(rt_signed_link *link, int64_t now_us) {
    const int64_t latest = (1LL << 48) + RT_MAX_VALUE;
    rt_stream streams[RT_MOST_STREAMS];
    uint8_t key[RT_KEY_BYTES];
    ANY(streams);
    ANY(key);
    for (uint32_t at = 0; at < RT_MOST_STREAMS; at++) streams[at].last = WITHIN(-1, latest);
    rt_signed_link_begin(link, key, WITHIN(0, latest), streams, SIZE(RT_MOST_STREAMS), WITHIN(0, RT_MAX_VALUE), now_us, 0);
    link->has_own = EITHER();
    link->ahead = WITHIN(0, latest);
    link->promised = WITHIN(0, latest);
    link->promised_us = WITHIN(0, RT_MAX_VALUE);
}

int main(void) {
    rt_command command;
    uint32_t size;
    int64_t now_us = WITHIN(0, RT_MAX_VALUE), later_us = WITHIN(0, RT_MAX_VALUE);
    ANY(octets);
    rt_bytes frame = {octets, SIZE(RT_LARGEST_FRAME)};
    begin(&command);
    begin_link(&gate.signer, now_us);
    switch (Frama_C_interval(0, 6)) {
    case 6:
        invocation.contract.emits.count = SIZE(RT_MAX_EMISSIONS);
        policy.vehicle.speed = WITHIN(1, RT_MAX_SPEED);
        policy.projection = command.projection;
        command.payload_count = 0;
        rt_payload_of(&invocation, &policy, &command);
        break;
    case 0: rt_gate_observe(&gate, frame, now_us); break;
    case 1: rt_gate_seal(&gate, frame, now_us, out, &size); break;
    case 2: return rt_accept_frame(&gate.signer, frame, later_us);
    case 3: rt_gate_sign_ahead(&gate, &command, frame, now_us, out); break;
    case 4:
        ANY(preparation);
        preparation.count = SIZE(RT_MAX_WRITES);
        rt_gate_prepare(&gate, &preparation);
        rt_gate_prepared(&gate);
        rt_gate_close(&gate);
        break;
    default: rt_gate_open(&gate, &command, now_us); return rt_gate_stands(&gate, now_us);
    }
    return 0;
}
