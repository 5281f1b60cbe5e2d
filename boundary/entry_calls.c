/* The interface of the whole boundary for the tests: begin one, and make a call. */
#include "enforcement/calls.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT const char *rt_test_boundary_begin(const uint8_t *root, uint32_t root_size, const uint8_t *pin, uint32_t pin_size, const uint8_t *vehicle,
                                 uint32_t vehicle_size, const uint8_t *session_key, const uint8_t *link_key, const uint8_t *own_key, const uint8_t *log_key,
                                 const rt_preparation *settings, const rt_preparation *owed, const int64_t *now, int64_t stated_us);
EXPORT uint32_t rt_test_boundary_call(const uint8_t *call, uint32_t size, int64_t own_us, uint8_t *out);
EXPORT void rt_test_boundary_forget(void);

static rt_boundary boundary;
static rt_keys keys;
static rt_kept kept = {.floor_us = -1};
static uint8_t kept_root[RT_MAX_ROOT], kept_vehicle[256];

void rt_test_boundary_forget(void) {
    memset(&kept, 0, sizeof kept);
    kept.floor_us = -1;
}

const char *rt_test_boundary_begin(const uint8_t *root, uint32_t root_size, const uint8_t *pin, uint32_t pin_size, const uint8_t *vehicle,
                          uint32_t vehicle_size, const uint8_t *session_key, const uint8_t *link_key, const uint8_t *own_key, const uint8_t *log_key,
                          const rt_preparation *settings, const rt_preparation *owed, const int64_t *now, int64_t stated_us) {
    memcpy(kept_root, root, root_size);
    memcpy(kept_vehicle, vehicle, vehicle_size);
    memcpy(keys.session, session_key, RT_KEY_BYTES);
    if (link_key != NULL) memcpy(keys.link, link_key, RT_KEY_BYTES);
    if (own_key != NULL) memcpy(keys.boundary, own_key, RT_KEY_BYTES);
    if (log_key != NULL) memcpy(keys.log, log_key, RT_KEY_BYTES);
    const rt_setup setup = {&keys, &kept, {kept_root, root_size}, {pin, pin_size}, {kept_vehicle, vehicle_size}, link_key != NULL, own_key != NULL,
                            log_key != NULL, settings, owed, {now[0], now[1], now[2]}, stated_us,
                            {{(const uint8_t *)"library", 7}, {0}, RT_DEBUG_ENABLED, 0}};
    return rt_boundary_begin(&boundary, &setup);
}

uint32_t rt_test_boundary_call(const uint8_t *call, uint32_t size, int64_t own_us, uint8_t *out) {
    return rt_answer(&boundary, (rt_bytes){call, size}, own_us, out);
}

/* The clock alone. */
EXPORT void rt_test_clock_begin(const int64_t *machine, int64_t stated_us);
EXPORT void rt_test_clock_look(const int64_t *machine);
EXPORT void rt_test_clock_settle(int64_t now_us);
EXPORT bool rt_test_clock_asks(int64_t now_us);
EXPORT void rt_test_clock_challenge(int64_t number, int64_t now_us);
EXPORT void rt_test_clock_hear(const uint8_t *frame, uint32_t size, uint8_t link, int64_t vehicle_us, int64_t now_us);
EXPORT void rt_test_clock_now(int64_t now_us, int64_t *said);
EXPORT bool rt_test_bears_out(const int64_t *own, const int64_t *named);

static rt_clock test_clock;

static rt_now now_of(const int64_t *now) { return (rt_now){now[0], now[1], now[2]}; }

void rt_test_clock_begin(const int64_t *machine, int64_t stated_us) {
    const rt_now now = now_of(machine);
    rt_clock_begin(&test_clock, &now, stated_us);
}

void rt_test_clock_look(const int64_t *machine) {
    const rt_now now = now_of(machine);
    rt_clock_look(&test_clock, &now);
}

void rt_test_clock_settle(int64_t now_us) { rt_clock_settle(&test_clock, now_us); }

bool rt_test_clock_asks(int64_t now_us) { return rt_clock_asks(&test_clock, now_us); }

void rt_test_clock_challenge(int64_t number, int64_t now_us) { rt_clock_challenge(&test_clock, number, now_us); }

void rt_test_clock_hear(const uint8_t *frame, uint32_t size, uint8_t link, int64_t vehicle_us, int64_t now_us) {
    rt_clock_hear(&test_clock, (rt_bytes){frame, size}, link, vehicle_us, now_us);
}

/* Its source, the moment, and the expected number. */
void rt_test_clock_now(int64_t now_us, int64_t *said) {
    rt_now now;
    rt_clock_now(&test_clock, now_us, &now);
    said[0] = test_clock.source;
    said[1] = now.monotonic_us;
    said[2] = now.utc_us;
    said[3] = now.utc_error_us;
    said[4] = rt_clock_number(&test_clock);
}

bool rt_test_bears_out(const int64_t *own, const int64_t *named) {
    const rt_now by_us = now_of(own), by_them = now_of(named);
    return rt_bears_out(&by_us, &by_them);
}
