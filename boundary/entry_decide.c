/* The interface of decision/ for the tests and the bench: one policy, one mission, one step of it, and many situations at once. */
#include "decision/parts.h"

#define EXPORT __attribute__((visibility("default")))

/* The numbers of a query, followed by its values, which of them are known, ages and monitors. */
enum { SLOTS, MONITORS, MONOTONIC, UTC, ERROR, VERSION, CONSUMED, RELEASED, PHASE, REMAINING, BINDING, VEHICLE, APPROVALS, HEAD };
enum { OUTCOME, REASON, STEP, CLAUSE, TARGET, VALID, DEGRADES, LINKS, ANSWER };

EXPORT const char *rt_test_prepare_policy(const uint8_t *data, uint32_t size);
EXPORT const char *rt_test_prepare_mission(const uint8_t *data, uint32_t size);
EXPORT const char *rt_test_read_mission(const uint8_t *data, uint32_t size);
EXPORT void rt_test_prepare_step(uint32_t step);
EXPORT void rt_test_decide(const int64_t *asked, uint32_t count, int64_t *answers);
EXPORT uint32_t rt_test_candidates(void);
EXPORT uint32_t rt_test_along(uint32_t zone, const uint8_t *path, uint32_t size, uint32_t count, int64_t error);
EXPORT uint32_t rt_test_compared(uint32_t zone, int64_t y0, int64_t y1, int64_t error);
EXPORT uint32_t rt_test_exists(uint32_t zone, int64_t low, int64_t high, int64_t error);
EXPORT uint32_t rt_test_time_of_day(int64_t start, int64_t end, int64_t low, int64_t high, int64_t error);
EXPORT bool rt_test_home(const int64_t *numbers);
EXPORT int rt_test_words(const uint8_t *one, uint32_t size, const uint8_t *other, uint32_t other_size);
EXPORT void rt_test_again(const int64_t *asked, uint32_t times);

static rt_policy policy;
static rt_prepared_policy prepared;
static rt_mission mission;
static rt_prepared_invocation invocation;

const char *rt_test_prepare_policy(const uint8_t *data, uint32_t size) {
    rt_refusal refusal = rt_read_policy((rt_bytes){data, size}, &policy);
    return refusal ? refusal : rt_prepare(&policy, &prepared);
}

const char *rt_test_prepare_mission(const uint8_t *data, uint32_t size) {
    rt_refusal refusal = rt_read_mission((rt_bytes){data, size}, &mission);
    return refusal ? refusal : rt_prepare_mission(&mission, &prepared);
}

const char *rt_test_read_mission(const uint8_t *data, uint32_t size) { return rt_read_mission((rt_bytes){data, size}, &mission); }

void rt_test_prepare_step(uint32_t step) { rt_prepare_invocation(&mission, step, &prepared, &invocation); }

uint32_t rt_test_candidates(void) { return invocation.rule_count; }

/* Read one query; returns where the next begins. */
static const int64_t *take(const int64_t *at, rt_state *state, rt_context *context, rt_now *now, rt_approval approvals[8]) {
    static const uint8_t wrong[32];
    *now = (rt_now){at[MONOTONIC], at[UTC], at[ERROR]};
    *context = (rt_context){at[BINDING] ? invocation.invocation.binding : (rt_bytes){wrong, sizeof wrong},
                            at[VEHICLE] ? policy.vehicle.identity : (rt_bytes){wrong, 7},
                            at[VERSION],
                            at[CONSUMED],
                            at[RELEASED],
                            at[PHASE],
                            at[REMAINING],
                            approvals,
                            (uint32_t)at[APPROVALS]};
    state->slots = (uint32_t)at[SLOTS];
    state->monitor_count = (uint32_t)at[MONITORS];
    at += HEAD;
    for (uint32_t one = 0; one < context->approval_count; one++, at += 5)
        approvals[one] = (rt_approval){at[0], at[1], at[2], at[3], at[4]};
    for (uint32_t slot = 0; slot < state->slots; slot++) state->values[slot] = *at++;
    for (uint32_t slot = 0; slot < state->slots; slot++) state->known[slot] = *at++ != 0;
    for (uint32_t slot = 0; slot < state->slots; slot++) state->ages[slot] = *at++;
    for (uint32_t one = 0; one < state->monitor_count; one++) state->monitors[one] = (uint8_t)*at++;
    return at;
}

/* Each answer: the decision, the target of a degrade rule, and the links of the step (bits 0..7) and of the contingency (8..15) that
   may fly. */
void rt_test_decide(const int64_t *asked, uint32_t count, int64_t *answers) {
    rt_state state = {.slots = 0};
    rt_context context;
    rt_now now;
    rt_approval approvals[8];
    rt_decision decision;
    rt_link link;
    for (; count > 0; count--, answers += ANSWER) {
        asked = take(asked, &state, &context, &now, approvals);
        rt_decide(&invocation, &state, &context, &now, &decision);
        answers[OUTCOME] = decision.outcome;
        answers[REASON] = decision.reason;
        answers[STEP] = decision.step;
        answers[CLAUSE] = decision.clause;
        answers[TARGET] = decision.target;
        answers[VALID] = decision.valid_until_us;
        answers[DEGRADES] = rt_choose_degrade(&invocation, &state, &now);
        answers[LINKS] = 0;
        rt_list left = invocation.invocation.contract.fallback;
        for (int at = 0; rt_next_link(&left, &link); at++)
            answers[LINKS] |= (int64_t)rt_link_admissible(&link, &prepared, &state, &now, invocation.phase) << at;
        for (uint32_t at = 0; at < policy.contingency_count; at++)
            answers[LINKS] |= (int64_t)rt_link_admissible(&policy.contingency[at], &prepared, &state, &now, RT_NO_PHASE)
                              << (8 + at);
    }
}

/* Decide repeatedly, from a place that moves by 1 mm each time, so that no cache applies. */
void rt_test_again(const int64_t *asked, uint32_t times) {
    rt_state state = {.slots = 0};
    rt_context context;
    rt_now now;
    rt_approval approvals[8];
    rt_decision decision;
    (void)take(asked, &state, &context, &now, approvals);
    for (uint32_t at = 0; at < times; at++) {
        if (policy.vehicle.position >= 0) state.values[policy.vehicle.position] += at & 1 ? 1 : -1;
        rt_decide(&invocation, &state, &context, &now, &decision);
    }
}

uint32_t rt_test_along(uint32_t zone, const uint8_t *path, uint32_t size, uint32_t count, int64_t error) {
    return rt_zone_along(&prepared, zone, (rt_list){path, path + size, count}, error);
}

uint32_t rt_test_compared(uint32_t zone, int64_t y0, int64_t y1, int64_t error) { return rt_zone_compared(&prepared, zone, y0, y1, error); }

uint32_t rt_test_exists(uint32_t zone, int64_t low, int64_t high, int64_t error) {
    return rt_zone_exists(&policy.vehicle, &policy.zones[zone], low, high, error);
}

uint32_t rt_test_time_of_day(int64_t start, int64_t end, int64_t low, int64_t high, int64_t error) {
    return rt_time_of_day(&policy.vehicle, start, end, low, high, error);
}

/* charge, distance, low, high, asked, drain */
bool rt_test_home(const int64_t *n) { return rt_brings_home(&policy.vehicle, n[0], n[1], n[2], n[3], n[4], n[5]); }

int rt_test_words(const uint8_t *one, uint32_t size, const uint8_t *other, uint32_t other_size) {
    return rt_compare_words((rt_bytes){one, size}, (rt_bytes){other, other_size});
}
