/* The interface of enforcement/ and mavlink/ for the tests: one gate and one signed link. */
#include "enforcement/frames.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT void rt_test_gate_begin(void);
EXPORT void rt_test_gate_open(int64_t kind, int64_t altitude, int64_t speed, const uint8_t *path, uint32_t size, uint32_t count,
                              const int64_t *projection, int64_t not_after_us);
EXPORT void rt_test_gate_levels(const uint8_t *heights, uint32_t heights_size, uint32_t heights_count, const uint8_t *headings,
                                uint32_t headings_size, uint32_t headings_count);
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
static rt_chain chain;
static rt_signed_link link;

void rt_test_gate_begin(void) {
    memset(&gate, 0, sizeof gate);
    gate.chain = &chain;
}

void rt_test_gate_open(int64_t kind, int64_t altitude, int64_t speed, const uint8_t *path, uint32_t size, uint32_t count,
                       const int64_t *projection, int64_t not_after_us) {
    rt_command command = {.token = 1, .kind = kind, .altitude = altitude, .speed = speed, .path = {path, path + size, count},
                          .heights = heights, .headings = headings,
                          .projection = {projection[0], projection[1], projection[2], projection[3]}};
    last = command;
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
