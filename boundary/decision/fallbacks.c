/* Selects the link that flies after a refusal. */
#include "parts.h"

/* Whether a link that moves the vehicle stays in the airspace, or returns it home from outside. */
static rt_truth deepens_no_breach(const rt_link *link, const rt_situation *now, const rt_contract *contract) {
    const rt_policy *policy = now->policy->policy;
    rt_planner planner;
    rt_plan_link(policy, link, &planner);
    rt_volume volume = rt_plan_volume(now, &planner), still = rt_plan_volume(now, NULL);
    rt_truth along = rt_everywhere(rt_airspace_keeps(now, &volume, rt_longest(contract, &policy->vehicle, link->limit_us)));
    if (contract->motion.kind != RT_HOME) return along;
    rt_truth here = rt_everywhere(rt_airspace_keeps(now, &still, 0));
    return here == RT_FALSE ? RT_TRUE : here == RT_TRUE ? along : RT_UNKNOWN;
}

static bool admissible(const rt_link *link, const rt_situation *now, int64_t phase) {
    const rt_policy *policy = now->policy->policy;
    const rt_contract *contract = &policy->contracts[link->skill];
    rt_list left = link->arguments, require = contract->require;
    rt_volume here = rt_here(now);
    int64_t arguments[RT_MAX_CELLS] = {0};
    rt_clause clause;
    for (uint32_t cell = 0; cell < RT_MAX_CELLS && rt_next_int(&left, &arguments[cell]); cell++) {}
    rt_environment at = {now, arguments, phase, &here, false, 0};
    while (rt_next_clause(&require, &clause))
        if (rt_evaluate(clause.code, &at) != RT_TRUE) return false;
    if (!policy->has_airspace || contract->motion.kind == RT_HOLD || contract->motion.kind == RT_LAND) return true;
    return deepens_no_breach(link, now, contract) == RT_TRUE;
}

bool rt_link_admissible(const rt_link *link, const rt_prepared_policy *policy, const rt_state *state, const rt_now *now,
                        int64_t phase) {
    rt_situation situation;
    rt_situate(policy, state, now, &situation);
    return admissible(link, &situation, phase);
}

static int64_t degrade(const rt_case *one) {
    const rt_prepared_invocation *invocation = one->invocation;
    for (uint32_t at = 0; at < invocation->rule_count; at++) {
        uint16_t number = invocation->rules[at];
        const rt_rule *rule = &one->policy->rules[number];
        if (rule->kind == RT_DEGRADE && rt_matches(rule, &one->at) == RT_TRUE &&
            admissible(&rule->target, &one->now, invocation->phase))
            return -1 - rt_degrade_number(invocation, number);
    }
    return RT_NO_TARGET;
}

int64_t rt_fallback(const rt_case *one) {
    int64_t target = degrade(one);
    rt_list left = one->invocation->invocation.contract.fallback;
    rt_link link;
    for (int64_t number = 0; number < RT_MAX_LINKS && target == RT_NO_TARGET && rt_next_link(&left, &link); number++)
        if (admissible(&link, &one->now, one->invocation->phase)) target = number;
    return target;
}

int64_t rt_choose_degrade(rt_prepared_invocation *invocation, const rt_state *state, const rt_now *now) {
    rt_case one;
    rt_begin_case(invocation, state, NULL, now, &one);
    return degrade(&one);
}
