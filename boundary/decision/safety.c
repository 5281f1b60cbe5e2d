#include "parts.h"

/* The first clause of a list that is not true everywhere: the first that is false fails, else the first unknown one is told. */
typedef struct {
    int64_t reason, clause; /* of the first that is unknown */
    bool doubt;
} tally;

/* Count a condition; false where it surely fails. */
static bool holds(tally *of, rt_truth truth, int64_t clause) {
    truth = rt_everywhere(truth);
    if (truth == RT_UNKNOWN && !of->doubt) {
        of->doubt = true;
        of->clause = clause;
    }
    return truth != RT_FALSE;
}

/* The number of a contract's own clause, `at` of its list; where several are the same, that of the last. */
static int64_t own_number(const rt_case *one, const rt_clause *clause) {
    const rt_contract *contract = &one->invocation->invocation.contract;
    const rt_list lists[3] = {contract->require, contract->assume, contract->maintain};
    int64_t number = one->policy->rule_count + one->policy->has_airspace, found = RT_NO_CLAUSE;
    rt_clause other = *clause;
    for (int at = 0; at < 3; at++) {
        rt_list left = lists[at];
        for (; rt_next_clause(&left, &other); number++)
            if (rt_same_clause(&other, clause)) found = number;
    }
    return found;
}

/* Whether no clause of a list is false; the first unknown one is told. */
static bool all_hold(const rt_case *one, rt_list clauses, const rt_environment *at, tally *of, int64_t reason,
                     rt_decision *decision) {
    rt_clause clause;
    while (rt_next_clause(&clauses, &clause)) {
        rt_truth truth = rt_evaluate(clause.code, at);
        if (truth != RT_TRUE && !holds(of, truth, own_number(one, &clause)))
            return rt_found(decision, reason, own_number(one, &clause));
    }
    return true;
}

static bool told(const tally *of, rt_decision *decision) {
    return !of->doubt || rt_found(decision, of->reason, of->clause);
}

bool rt_step_state(rt_case *one, rt_decision *decision) {
    const rt_contract *contract = &one->invocation->invocation.contract;
    tally of = {RT_STATE_UNKNOWN, RT_NO_CLAUSE, false};
    return all_hold(one, contract->require, &one->at, &of, RT_STATE_VIOLATED, decision) &&
           all_hold(one, contract->assume, &one->at, &of, RT_STATE_VIOLATED, decision) && told(&of, decision);
}

rt_truth rt_airspace_keeps(const rt_situation *situation, const rt_volume *volume, int64_t through_us) {
    const rt_airspace *airspace = &situation->policy->policy->airspace;
    rt_list inside = airspace->inside, outside = airspace->outside;
    rt_truth truth = RT_TRUE;
    int64_t zone;
    while (rt_next_int(&inside, &zone)) truth = rt_and(truth, rt_zone_holds(situation, (uint32_t)zone, volume, through_us));
    while (rt_next_int(&outside, &zone))
        truth = rt_and(truth, rt_not(rt_zone_holds(situation, (uint32_t)zone, volume, through_us)));
    return truth;
}

bool rt_step_safety(rt_case *one, rt_decision *decision) {
    rt_prepared_invocation *prepared = one->invocation;
    const rt_invocation *invocation = &prepared->invocation;
    const rt_vehicle *vehicle = &one->policy->vehicle;
    int64_t airspace = one->policy->rule_count;
    tally of = {RT_SAFETY_UNKNOWN, RT_NO_CLAUSE, false};
    if (invocation->plan.speed > vehicle->speed) return rt_found(decision, RT_ENVELOPE, RT_NO_CLAUSE);
    rt_volume volume = rt_plan_volume(&one->now, &prepared->planner);
    if (one->policy->has_airspace && !holds(&of, rt_airspace_keeps(&one->now, &volume, prepared->lasts_us), airspace))
        return rt_found(decision, RT_AIRSPACE, airspace);
    rt_environment over = {&one->now, prepared->arguments, prepared->phase, &volume, true, prepared->lasts_us};
    if (!all_hold(one, invocation->contract.maintain, &over, &of, RT_INVARIANT, decision)) return false;
    rt_truth charge =
        rt_charge_suffices(&invocation->contract, vehicle, one->invocation->asked, rt_slot(&one->now, vehicle->battery), &volume);
    if (!holds(&of, charge, RT_NO_CLAUSE)) return rt_found(decision, RT_ENERGY, RT_NO_CLAUSE);
    for (uint32_t at = 0; at < prepared->rule_count; at++) {
        const rt_rule *rule = &one->policy->rules[prepared->rules[at]];
        if (rule->kind != RT_DEGRADE) continue;
        rt_truth truth = rt_not(rt_matches(rule, &one->at));
        if (truth != RT_TRUE && !holds(&of, truth, rt_rule_number(prepared, prepared->rules[at])))
            return rt_found(decision, RT_DEGRADED, rt_rule_number(prepared, prepared->rules[at]));
    }
    return told(&of, decision);
}
