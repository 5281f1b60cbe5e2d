#include "parts.h"

/* Valid from the moment of issue to its end, both included. */
bool rt_step_freshness(rt_case *one, rt_decision *decision) {
    const rt_invocation *invocation = &one->invocation->invocation;
    int64_t issued = invocation->issued_at_us, end = issued + invocation->contract.validity_us, utc = one->now.utc_us,
            error = one->now.error_us;
    if (one->context->consumed) return rt_found(decision, RT_REPLAYED, RT_NO_CLAUSE);
    if (issued <= utc - error && utc + error <= end) return true;
    if (issued > utc + error) return rt_found(decision, RT_ISSUED_IN_FUTURE, RT_NO_CLAUSE);
    return rt_found(decision, utc - error > end ? RT_EXPIRED : RT_CLOCK_UNCERTAIN, RT_NO_CLAUSE);
}

/* Deferred while one of its phases is still to come, denied when none is. Before the first, all are to come. */
bool rt_step_phase(rt_case *one, rt_decision *decision) {
    int64_t current = rt_max(one->context->phase, -1) + 1;
    uint64_t coming = current > 63 ? 0 : (uint64_t)one->invocation->invocation.phases << 1 >> current;
    return (coming & 1) || rt_found(decision, coming ? RT_PHASE_NOT_REACHED : RT_PHASE_PASSED, RT_NO_CLAUSE);
}

/* A release still to come gains nothing. */
bool rt_step_timing(rt_case *one, rt_decision *decision) {
    int64_t spare = one->invocation->invocation.contract.deadline_us - one->context->remaining_us;
    return rt_max(one->now.monotonic_us - one->released_us, 0) <= spare || rt_found(decision, RT_NO_SLACK, RT_NO_CLAUSE);
}

/* The earliest of deadline, end of validity and the moment when something that was read is stale. */
int64_t rt_valid_until(const rt_case *one) {
    const rt_prepared_invocation *invocation = one->invocation;
    const rt_contract *contract = &invocation->invocation.contract;
    int64_t now = one->now.monotonic_us;
    int64_t left = rt_min(one->released_us - now, 0) + contract->deadline_us;
    left = rt_min(left, invocation->invocation.issued_at_us + contract->validity_us - one->now.utc_us - one->now.error_us);
    left = rt_min(left, invocation->rests_us);
    for (int64_t slot = 0; slot < one->policy->slots; slot++) {
        int64_t fresh = invocation->policy->stale_us[slot] - one->state->ages[slot];
        if (rt_reads(&invocation->reads, slot) && one->state->known[slot] && fresh >= 0) left = rt_min(left, fresh);
    }
    return now + left;
}
