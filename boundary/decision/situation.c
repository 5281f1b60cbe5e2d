#include "parts.h"

/* A state or monitors of the wrong size are a fault of their producer, and none of their values are used. */
void rt_situate(const rt_prepared_policy *policy, const rt_state *state, const rt_now *now, rt_situation *situation) {
    int64_t slots = policy->policy->slots;
    uint32_t monitors = policy->policy->monitor_count;
    bool believed = state->slots == slots, said = state->monitor_count == monitors;
    situation->policy = policy;
    for (int64_t slot = 0; slot < slots; slot++) {
        int64_t value = state->values[slot], age = state->ages[slot], most = policy->most[slot];
        bool known = believed && state->known[slot] && rt_within(age, 0, policy->stale_us[slot]) && rt_within(value, -most, most);
        situation->slots[slot] = (rt_value){known ? rt_max(-most, rt_min(value, most)) : 0, known}; /* which is the value itself */
    }
    for (uint32_t at = 0; said && at < monitors; at++) {
        uint8_t truth = state->monitors[at];
        said = truth == RT_TRUE || truth == RT_FALSE || truth == RT_UNKNOWN;
    }
    for (uint32_t at = 0; at < monitors; at++) situation->monitors[at] = said ? state->monitors[at] : RT_UNKNOWN;
    situation->monotonic_us = now->monotonic_us;
    situation->utc_us = now->utc_us;
    situation->error_us = rt_max(now->utc_error_us, 0);
}

rt_value rt_slot(const rt_situation *situation, int64_t slot) {
    return slot < 0 ? (rt_value){0, false} : situation->slots[slot];
}
