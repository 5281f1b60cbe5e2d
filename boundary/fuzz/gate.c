/* libFuzzer target: frames to a gate, from either side, and permitted commands. The first octet says whether the link is signed; the
   first octet of each record is its kind. */
#include "world.h"

#include "wire/octets.h"

#define PATH 12     /* encodings of the coordinates of a path */
#define EMISSION 36 /* octets of a command to payload */

static rt_gate gate;
static rt_chain chain;

/* Within the bounds that the checks of a policy and a mission ensure for each number. */
static int64_t bounded(const uint8_t **at, int64_t low, int64_t high) { return low + (int64_t)(rt_take(at, 4) % (uint64_t)(high - low + 1)); }

static void permit(rt_bytes record, int64_t now_us) {
    static uint8_t path[PATH];
    rt_cursor cursor = {path, path + PATH};
    const uint8_t *at = record.at;
    int64_t value;
    if (record.size < 1 + 7 * 4 + PATH) return;
    rt_command command = {.kind = bounded(&at, 0, RT_LAND), .altitude = bounded(&at, -100000, 200000), .speed = bounded(&at, 0, 20000)};
    command.has_place = (*at++ & 1) != 0;
    command.projection = (rt_projection){bounded(&at, -900000000, 900000000), bounded(&at, -RT_HALF_TURN, RT_HALF_TURN), bounded(&at, 1, 32 << RT_SHIFT), bounded(&at, 1, 32 << RT_SHIFT)};
    memcpy(path, at, PATH);
    command.path.at = path;
    while (rt_take_int(&cursor, &value) && value >= -RT_MAX_COORDINATE && value <= RT_MAX_COORDINATE) {
        command.place[command.path.count++ % 2] = value;
        command.path.end = cursor.at;
    }
    if ((record.at[0] & 32) != 0) { /* coordinates are heights and headings too: the checks ensure their bounds, the gate needs none */
        command.heights = command.headings = command.path;
        command.heights.count = command.headings.count = command.path.count / 2;
    }
    for (at += PATH; record.at + record.size - at >= EMISSION && command.payload_count < RT_MAX_EMISSIONS; command.payload_count++) {
        rt_payload_frame *frame = &command.payload[command.payload_count];
        for (int number = 0; number < 7; number++) frame->numbers[number] = (uint32_t)rt_take(&at, 4);
        frame->command = (uint16_t)rt_take(&at, 2);
        frame->addressee = *at % 3;
        frame->has_height = (*at & 4) != 0;
        frame->most = *at++ >> 4;
        frame->interval_us = *at++ << 16;
        frame->height = bounded(&at, RT_LOWEST, RT_HIGHEST);
    }
    rt_gate_open(&gate, &command, now_us + 1000000);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0) return 0;
    rt_bytes left = {data + 1, (uint32_t)(size - 1)}, record;
    int64_t now_us = world_now.monotonic_us;
    memset(&gate, 0, sizeof gate);
    memset(&chain, 0, sizeof chain);
    gate.chain = &chain;
    gate.signs = (data[0] & 1) != 0;
    rt_signed_link_begin(&gate.signer, keys.link, 0, NULL, 0, world_now.utc_us, now_us, 0);
    while (next_record(&left, &record) && record.size > 0) {
        uint8_t *exact = malloc(record.size), *out = malloc(RT_LARGEST_FRAME);
        uint32_t sealed;
        memcpy(exact, record.at + 1, record.size - 1);
        rt_bytes frame = {exact, record.size - 1};
        now_us += (int64_t)(record.at[0] >> 3) << 16;
        switch (record.at[0] & 7) {
        case 0: permit(frame, now_us); break;
        case 1: rt_gate_close(&gate); break;
        case 2:
        case 3: rt_gate_observe(&gate, frame, now_us); break;
        case 4: (void)rt_accept_frame(&gate.signer, frame, now_us); break;
        default:
            if (rt_gate_seal(&gate, frame, now_us, out, &sealed) == NULL && (sealed == 0 || sealed > RT_LARGEST_FRAME)) abort();
        }
        free(exact);
        free(out);
    }
    return 0;
}
