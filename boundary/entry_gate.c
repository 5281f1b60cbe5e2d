/* The interface of enforcement/ and mavlink/ for the tests: one gate and one signed link. */
#include "decision/parts.h"
#include "enforcement/frames.h"
#include "mavlink/parameters.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT void rt_test_gate_begin(void);
EXPORT void rt_test_gate_open(int64_t kind, int64_t altitude, int64_t speed, const uint8_t *path, uint32_t size, uint32_t count,
                              const int64_t *projection, int64_t not_after_us);
EXPORT void rt_test_gate_levels(const uint8_t *heights, uint32_t heights_size, uint32_t heights_count, const uint8_t *headings,
                                uint32_t headings_size, uint32_t headings_count);
EXPORT void rt_test_gate_payload(const uint8_t *const lists[4], const uint32_t sizes[4], const uint32_t counts[4],
                                 const int64_t *projection, int64_t speed);
EXPORT bool rt_test_is_payload(uint32_t command);
EXPORT bool rt_test_may_be_emitted(int64_t command, int64_t addressee);
EXPORT uint32_t rt_test_nearest_bits(int64_t numerator, int64_t denominator);
EXPORT void rt_test_gate_close(void);
EXPORT void rt_test_gate_observe(const uint8_t *frame, uint32_t size, int64_t now_us);
EXPORT const char *rt_test_gate_seal(const uint8_t *frame, uint32_t size, int64_t now_us, uint8_t *out, uint32_t *sealed);
EXPORT const char *rt_test_gate_sign_ahead(const uint8_t *frame, uint32_t size, int64_t now_us);
EXPORT void rt_test_link_begin(const uint8_t *key, int64_t timestamp, const int64_t *streams, uint32_t count, int64_t utc_us,
                               int64_t monotonic_us, uint8_t id);
EXPORT uint32_t rt_test_link_sign(uint8_t *frame, uint32_t size, int64_t now_us);
EXPORT int rt_test_link_accept(const uint8_t *frame, uint32_t size, int64_t now_us);
EXPORT uint32_t rt_test_link_sign_ahead(uint8_t *frame, uint32_t size, int64_t now_us);
EXPORT int64_t rt_test_link_signed_up_to(void);

static rt_gate gate;
static rt_command last; /* the command that it was opened for */
static rt_list heights, headings;
static rt_command step; /* what the next one sends to payload */
static rt_policy policy;
static rt_chain chain;
static rt_signed_link link;

void rt_test_gate_begin(void) {
    memset(&gate, 0, sizeof gate);
    gate.chain = &chain;
}

bool rt_test_is_payload(uint32_t command) {
    rt_frame frame;
    memset(&frame, 0, sizeof frame);
    frame.message = RT_MSG_COMMAND_LONG;
    frame.payload[RT_COMMAND_LONG_COMMAND] = (uint8_t)command;
    frame.payload[RT_COMMAND_LONG_COMMAND + 1] = (uint8_t)(command >> 8);
    return rt_is_payload(&frame);
}

bool rt_test_may_be_emitted(int64_t command, int64_t addressee) { return rt_may_be_emitted(command, addressee); }

uint32_t rt_test_nearest_bits(int64_t numerator, int64_t denominator) { return rt_nearest_bits(numerator, denominator); }

/* What the next command sends to payload: its emissions, its arguments, its path, and the free servo outputs. */
void rt_test_gate_payload(const uint8_t *const lists[4], const uint32_t sizes[4], const uint32_t counts[4],
                          const int64_t *projection, int64_t speed) {
    rt_invocation invocation;
    rt_list read[4];
    for (uint32_t at = 0; at < 4; at++) read[at] = (rt_list){lists[at], lists[at] + sizes[at], counts[at]};
    memset(&invocation, 0, sizeof invocation);
    invocation.contract.emits = read[0];
    invocation.arguments = read[1];
    invocation.plan.path = read[2];
    policy.vehicle.servos = read[3];
    policy.vehicle.speed = speed;
    policy.projection = (rt_projection){projection[0], projection[1], projection[2], projection[3]};
    memset(&step, 0, sizeof step);
    rt_payload_of(&invocation, &policy, &step);
}

void rt_test_gate_open(int64_t kind, int64_t altitude, int64_t speed, const uint8_t *path, uint32_t size, uint32_t count,
                       const int64_t *projection, int64_t not_after_us) {
    rt_command command = step;
    command.token = 1;
    command.kind = kind;
    command.altitude = altitude;
    command.speed = speed;
    command.path = (rt_list){path, path + size, count};
    command.heights = heights;
    command.headings = headings;
    command.projection = (rt_projection){projection[0], projection[1], projection[2], projection[3]};
    last = command;
    memset(&step, 0, sizeof step);
    rt_gate_open(&gate, &command, not_after_us);
}

/* Of the command that it is opened for next. */
void rt_test_gate_levels(const uint8_t *heights_at, uint32_t heights_size, uint32_t heights_count, const uint8_t *headings_at,
                         uint32_t headings_size, uint32_t headings_count) {
    heights = (rt_list){heights_at, heights_at + heights_size, heights_count};
    headings = (rt_list){headings_at, headings_at + headings_size, headings_count};
}

void rt_test_gate_close(void) { rt_gate_close(&gate); }

void rt_test_gate_observe(const uint8_t *frame, uint32_t size, int64_t now_us) {
    rt_gate_observe(&gate, (rt_bytes){frame, size}, now_us);
}

const char *rt_test_gate_seal(const uint8_t *frame, uint32_t size, int64_t now_us, uint8_t *out, uint32_t *sealed) {
    return rt_gate_seal(&gate, (rt_bytes){frame, size}, now_us, out, sealed);
}

const char *rt_test_gate_sign_ahead(const uint8_t *frame, uint32_t size, int64_t now_us) {
    uint8_t out[RT_SIGNATURE];
    return rt_gate_sign_ahead(&gate, &last, (rt_bytes){frame, size}, now_us, out);
}

void rt_test_link_begin(const uint8_t *key, int64_t timestamp, const int64_t *streams, uint32_t count, int64_t utc_us,
                        int64_t monotonic_us, uint8_t id) {
    rt_stream known[RT_MOST_STREAMS];
    for (uint32_t at = 0; at < count; at++)
        known[at] = (rt_stream){(uint8_t)streams[4 * at], (uint8_t)streams[4 * at + 1], (uint8_t)streams[4 * at + 2], streams[4 * at + 3]};
    rt_signed_link_begin(&link, key, timestamp, known, count, utc_us, monotonic_us, id);
}

uint32_t rt_test_link_sign(uint8_t *frame, uint32_t size, int64_t now_us) { return rt_sign_frame(&link, frame, size, now_us); }

int rt_test_link_accept(const uint8_t *frame, uint32_t size, int64_t now_us) {
    return (int)rt_accept_frame(&link, (rt_bytes){frame, size}, now_us);
}

uint32_t rt_test_link_sign_ahead(uint8_t *frame, uint32_t size, int64_t now_us) { return rt_sign_ahead(&link, frame, size, now_us); }

int64_t rt_test_link_signed_up_to(void) { return rt_signed_up_to(&link); }
