/* What the tests call of the whole boundary: begin one, and make a call. */
#include "enforcement/calls.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT const char *rt_test_boundary_begin(const uint8_t *root, uint32_t root_size, const uint8_t *pin, uint32_t pin_size, const uint8_t *vehicle,
                                 uint32_t vehicle_size, const uint8_t *session_key, const uint8_t *link_key, const uint8_t *own_key, const uint8_t *log_key,
                                 const rt_preparation *settings, const rt_preparation *owed, const int64_t *now);
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
                          const rt_preparation *settings, const rt_preparation *owed, const int64_t *now) {
    memcpy(kept_root, root, root_size);
    memcpy(kept_vehicle, vehicle, vehicle_size);
    memcpy(keys.session, session_key, RT_KEY_BYTES);
    if (link_key != NULL) memcpy(keys.link, link_key, RT_KEY_BYTES);
    if (own_key != NULL) memcpy(keys.boundary, own_key, RT_KEY_BYTES);
    if (log_key != NULL) memcpy(keys.log, log_key, RT_KEY_BYTES);
    const rt_setup setup = {&keys, &kept, {kept_root, root_size}, {pin, pin_size}, {kept_vehicle, vehicle_size}, link_key != NULL, own_key != NULL,
                            log_key != NULL, settings, owed, {now[0], now[1], now[2]}};
    return rt_boundary_begin(&boundary, &setup);
}

uint32_t rt_test_boundary_call(const uint8_t *call, uint32_t size, int64_t own_us, uint8_t *out) {
    return rt_answer(&boundary, (rt_bytes){call, size}, own_us, out);
}
