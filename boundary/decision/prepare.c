#include "parts.h"

static void scope_of(rt_prepared_policy *prepared) {
    const rt_policy *policy = prepared->policy;
    memset(prepared->cells, RT_NO_KIND, sizeof prepared->cells);
    for (uint32_t at = 0; at < policy->signal_count; at++) {
        const rt_signal *signal = &policy->signals[at];
        for (int64_t slot = signal->slot; slot <= signal->slot + (signal->kind == RT_POSITION); slot++) {
            prepared->kinds[slot] = (uint8_t)signal->kind;
            prepared->stale_us[slot] = signal->stale_us;
            prepared->most[slot] = signal->kind == RT_POSITION ? RT_MAX_COORDINATE : RT_MAX_VALUE;
        }
    }
}

static bool words_after(const void *of, uint16_t one, uint16_t other) {
    const rt_policy *policy = of;
    return rt_compare_words(policy->rules[one].text, policy->rules[other].text) > 0;
}

rt_refusal rt_prepare(const rt_policy *policy, rt_prepared_policy *prepared) {
    prepared->policy = policy;
    if (!rt_check_signals(policy)) return "malformed";
    scope_of(prepared);
    if (!rt_check_policy(policy, prepared)) return "malformed";
    for (uint32_t at = 0; at < policy->rule_count; at++) prepared->by_words[at] = (uint16_t)at;
    rt_sort(prepared->by_words, policy->rule_count, words_after, policy);
    return NULL;
}

rt_refusal rt_prepare_mission(const rt_mission *mission, rt_prepared_policy *policy) {
    return rt_check_mission(mission, policy) ? NULL : "malformed";
}

static bool speaks_of(rt_list list, int64_t value) {
    return list.count == 0 || rt_holds(list, value);
}

/* The slots that a clause reads: see _reads and rests_us in prepare.py. */
static void read_clauses(rt_list clauses, const rt_prepared_policy *policy, rt_slots *reads, bool *monitored) {
    rt_clause clause;
    while (rt_next_clause(&clauses, &clause)) rt_read_code(policy, clause.code, reads, monitored);
}

void rt_prepare_invocation(const rt_mission *mission, uint32_t step, const rt_prepared_policy *prepared,
                           rt_prepared_invocation *made) {
    const rt_policy *policy = prepared->policy;
    rt_invocation *invocation = &made->invocation;
    rt_invocation_at(mission, step, invocation);
    const rt_contract *contract = &invocation->contract;
    bool monitored = false;
    rt_list left = invocation->arguments;
    made->policy = prepared;
    for (uint32_t cell = 0; cell < RT_MAX_CELLS && rt_next_int(&left, &made->arguments[cell]); cell++) {}
    made->misfit = !rt_fits(invocation->arguments, contract);
    made->reads = (rt_slots){{0, 0}};
    read_clauses(contract->require, prepared, &made->reads, &monitored);
    read_clauses(contract->assume, prepared, &made->reads, &monitored);
    read_clauses(contract->maintain, prepared, &made->reads, &monitored);
    made->rule_count = 0;
    for (uint32_t at = 0; at < policy->rule_count; at++) {
        const rt_rule *rule = &policy->rules[at];
        if (!speaks_of(rule->skills, invocation->skill) || !speaks_of(rule->roles, invocation->role) ||
            !speaks_of(rule->sources, invocation->source))
            continue;
        if (rule->kind == RT_DEGRADE && rule->target.skill == invocation->skill) continue; /* it would refuse its own target */
        made->rules[made->rule_count++] = (uint16_t)at;
        if (rule->has_when) rt_read_code(prepared, rule->when.code, &made->reads, &monitored);
    }
    rt_read_where(&policy->vehicle, &made->reads);
    if (policy->vehicle.battery != -1) rt_add_slot(&made->reads, policy->vehicle.battery);
    rt_plan_step(policy, invocation, &made->planner);
    memset(made->along, 0, sizeof made->along);
    rt_bytes name = {NULL, 0};
    left = mission->phases;
    for (int64_t at = 0; at <= invocation->phase; at++) rt_next_text(&left, &name);
    made->phase = RT_NO_PHASE;
    for (uint32_t at = 0; at < policy->phase_count; at++)
        if (rt_same(policy->phases[at], name)) made->phase = at;
    made->rests_us = monitored ? RT_MAX_GAP : RT_MAX_DURATION;
    made->lasts_us = rt_longest(contract, &policy->vehicle, 0);
    made->asked = invocation->plan.speed;
    rt_invocation before;
    for (uint32_t each = 0; each < step; each++) {
        rt_invocation_at(mission, each, &before);
        if (made->asked == 0 || (before.plan.speed != 0 && before.plan.speed < made->asked)) made->asked = before.plan.speed;
    }
}
