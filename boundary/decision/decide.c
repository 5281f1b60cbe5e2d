#include "parts.h"

bool rt_found(rt_decision *decision, int64_t reason, int64_t clause) {
    decision->reason = reason;
    decision->outcome = rt_outcome_of[reason];
    decision->clause = clause;
    return false;
}

static bool same_link(const rt_link *one, const rt_link *other) {
    return one->skill == other->skill && rt_same_list(one->arguments, other->arguments) && one->limit_us == other->limit_us &&
           rt_same(one->text, other->text) && one->source == other->source && one->start == other->start &&
           one->end == other->end;
}

bool rt_same_clause(const rt_clause *one, const rt_clause *other) {
    return rt_same(one->text, other->text) && one->source == other->source && one->start == other->start &&
           one->end == other->end && rt_same_list(one->code, other->code);
}

static bool same_rule(const rt_rule *one, const rt_rule *other) {
    return one->kind == other->kind && rt_same_list(one->skills, other->skills) && rt_same_list(one->roles, other->roles) &&
           rt_same_list(one->sources, other->sources) && one->has_when == other->has_when &&
           (!one->has_when || rt_same_clause(&one->when, &other->when)) && one->approver == other->approver &&
           one->within_us == other->within_us && one->has_target == other->has_target &&
           (!one->has_target || same_link(&one->target, &other->target)) && rt_same(one->text, other->text) &&
           one->source == other->source && one->start == other->start && one->end == other->end && one->second == other->second;
}

/* Equal rules have equal candidates. */
int64_t rt_rule_number(const rt_prepared_invocation *invocation, uint32_t rule) {
    const rt_rule *rules = invocation->policy->policy->rules;
    uint32_t at = invocation->rule_count;
    while (at > 0 && !same_rule(&rules[invocation->rules[at - 1]], &rules[rule])) at--;
    return at > 0 ? invocation->rules[at - 1] : rule;
}

/* The number of the rule whose target flies: the first rule with this target. */
int64_t rt_degrade_number(const rt_prepared_invocation *invocation, uint32_t rule) {
    const rt_rule *rules = invocation->policy->policy->rules;
    for (uint32_t at = 0; at < invocation->rule_count; at++) {
        uint32_t other = invocation->rules[at];
        if (rules[other].kind == RT_DEGRADE && same_link(&rules[other].target, &rules[rule].target))
            return rt_rule_number(invocation, other);
    }
    return rule;
}

void rt_begin_case(rt_prepared_invocation *invocation, const rt_state *state, const rt_context *context, const rt_now *now,
                   rt_case *one) {
    one->invocation = invocation;
    invocation->planner.along = invocation->along; /* here, because it may have been copied */
    one->policy = invocation->policy->policy;
    one->context = context;
    one->state = state;
    rt_situate(invocation->policy, state, now, &one->now);
    one->here = rt_here(&one->now);
    one->at = (rt_environment){&one->now, invocation->arguments, invocation->phase, &one->here, false, 0};
    one->released_us = context ? context->released_us : 0;
}

/* The steps of design 4.1; each returns whether it passes. */

static bool step_integrity(rt_case *one, rt_decision *decision) {
    const rt_context *context = one->context;
    if (!rt_same(context->binding, one->invocation->invocation.binding))
        return rt_found(decision, RT_BINDING_MISMATCH, RT_NO_CLAUSE);
    if (!rt_same(context->vehicle, one->policy->vehicle.identity)) return rt_found(decision, RT_WRONG_VEHICLE, RT_NO_CLAUSE);
    if (context->policy_version != one->policy->version) return rt_found(decision, RT_POLICY_VERSION, RT_NO_CLAUSE);
    return !one->invocation->misfit || rt_found(decision, RT_ARGUMENT_RANGE, RT_NO_CLAUSE);
}

/* Checks the validity, from the moment of issue to its end, both included. */
static bool step_freshness(rt_case *one, rt_decision *decision) {
    const rt_invocation *invocation = &one->invocation->invocation;
    int64_t issued = invocation->issued_at_us, end = issued + invocation->contract.validity_us, utc = one->now.utc_us,
            error = one->now.error_us;
    if (one->context->consumed) return rt_found(decision, RT_REPLAYED, RT_NO_CLAUSE);
    if (issued <= utc - error && utc + error <= end) return true;
    if (issued > utc + error) return rt_found(decision, RT_ISSUED_IN_FUTURE, RT_NO_CLAUSE);
    return rt_found(decision, utc - error > end ? RT_EXPIRED : RT_CLOCK_UNCERTAIN, RT_NO_CLAUSE);
}

/* The timing classes that a source may use: an agent may not request reflexes, and a reflex may only react. */
static bool may_use(int64_t source, int64_t timing_class) {
    if (source == RT_SOURCE_REFLEX) return timing_class == RT_REFLEX;
    return timing_class == RT_TACTICAL || (timing_class == RT_SEMANTIC && source != RT_SOURCE_ONBOARD);
}

static bool step_authority(rt_case *one, rt_decision *decision) {
    const rt_prepared_invocation *invocation = one->invocation;
    int64_t doubt = RT_NO_CLAUSE, permit = RT_NO_CLAUSE; /* the first forbid that is unknown, the first permit */
    bool permitted = false;
    if (!may_use(invocation->invocation.source, invocation->invocation.contract.timing_class))
        return rt_found(decision, RT_CLASS_NOT_PERMITTED, RT_NO_CLAUSE);
    for (uint32_t at = 0; at < invocation->rule_count; at++) {
        uint16_t number = invocation->rules[at];
        const rt_rule *rule = &one->policy->rules[number];
        if (rule->kind == RT_PERMIT) {
            if (permit == RT_NO_CLAUSE) permit = number;
            permitted = permitted || rt_matches(rule, &one->at) == RT_TRUE;
        } else if (rule->kind == RT_FORBID) {
            rt_truth truth = rt_matches(rule, &one->at);
            if (truth == RT_TRUE) return rt_found(decision, RT_FORBIDDEN, rt_rule_number(invocation, number));
            if (truth == RT_UNKNOWN && doubt == RT_NO_CLAUSE) doubt = number;
        }
    }
    if (!permitted && permit == RT_NO_CLAUSE) return rt_found(decision, RT_NOT_PERMITTED, RT_NO_CLAUSE);
    if (!permitted) return rt_found(decision, RT_OUT_OF_SCOPE, rt_rule_number(invocation, (uint32_t)permit));
    return doubt == RT_NO_CLAUSE || rt_found(decision, RT_FORBID_UNKNOWN, rt_rule_number(invocation, (uint32_t)doubt));
}

static bool is_about(const rt_approval *answer, uint16_t rule) { return answer->rule == rule || answer->rule == RT_EVERY_RULE; }

static bool in_time(const rt_approval *answer, uint16_t rule, int64_t role, int64_t end) {
    return is_about(answer, rule) && answer->role == role && answer->monotonic_us <= end;
}

/* When enough grants had arrived by `end`, of one role or of two people: the earliest moment; false if there are not enough. */
static bool granted(const rt_context *context, const rt_rule *rule, uint16_t number, int64_t end, int64_t *when) {
    bool found = false;
    for (uint32_t i = 0; i < context->approval_count; i++) {
        const rt_approval *first = &context->approvals[i];
        if (!in_time(first, number, rule->approver, end)) continue;
        for (uint32_t j = 0; j < context->approval_count; j++) {
            const rt_approval *other = rule->second == -1 ? first : &context->approvals[j];
            if (rule->second != -1 && (!in_time(other, number, rule->second, end) || other->person == first->person)) continue;
            int64_t at = rt_max(first->monotonic_us, other->monotonic_us);
            *when = found ? rt_min(*when, at) : at;
            found = true;
        }
    }
    return found;
}

static bool step_confirmation(rt_case *one, rt_decision *decision) {
    const rt_context *context = one->context;
    int64_t doubt = RT_NO_CLAUSE, when = 0;
    for (uint32_t at = 0; at < one->invocation->rule_count; at++) {
        uint16_t number = one->invocation->rules[at];
        const rt_rule *rule = &one->policy->rules[number];
        if (rule->kind != RT_CONFIRM || rt_matches(rule, &one->at) == RT_FALSE) continue;
        int64_t end = context->released_us + rule->within_us;
        for (uint32_t i = 0; i < context->approval_count; i++) {
            const rt_approval *answer = &context->approvals[i];
            if (is_about(answer, number) && !answer->granted && (answer->role == rule->approver || answer->role == rule->second))
                return rt_found(decision, RT_APPROVAL_REFUSED, rt_rule_number(one->invocation, number));
        }
        if (granted(context, rule, number, end, &when)) one->released_us = rt_max(one->released_us, when);
        else if (one->now.monotonic_us > end)
            return rt_found(decision, RT_APPROVAL_TIMED_OUT, rt_rule_number(one->invocation, number));
        else if (doubt == RT_NO_CLAUSE) doubt = number;
    }
    return doubt == RT_NO_CLAUSE || rt_found(decision, RT_AWAITING_APPROVAL, rt_rule_number(one->invocation, (uint32_t)doubt));
}

/* Deferred while one of the invocation's phases is still to come, denied when none is left. Before the first phase, all are to come. */
static bool step_phase(rt_case *one, rt_decision *decision) {
    int64_t current = rt_max(one->context->phase, -1) + 1;
    uint64_t coming = current > 63 ? 0 : (uint64_t)one->invocation->invocation.phases << 1 >> current;
    return (coming & 1) || rt_found(decision, coming ? RT_PHASE_NOT_REACHED : RT_PHASE_PASSED, RT_NO_CLAUSE);
}

/* A later release does not help. */
static bool step_timing(rt_case *one, rt_decision *decision) {
    int64_t spare = one->invocation->invocation.contract.deadline_us - one->context->remaining_us;
    return rt_max(one->now.monotonic_us - one->released_us, 0) <= spare || rt_found(decision, RT_NO_SLACK, RT_NO_CLAUSE);
}

/* The first clause of a list that is not true everywhere: the first false one fails, else the first unknown one is reported. */
typedef struct {
    int64_t reason, clause; /* of the first that is unknown */
    bool doubt;
} tally;

/* Count a condition; false if it certainly fails. */
static bool holds(tally *of, rt_truth truth, int64_t clause) {
    truth = rt_everywhere(truth);
    if (truth == RT_UNKNOWN && !of->doubt) {
        of->doubt = true;
        of->clause = clause;
    }
    return truth != RT_FALSE;
}

/* The number of a contract's own clause, `at` of its list; of equal clauses, that of the last. */
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

/* Whether no clause of a list is false; the first unknown one is reported. */
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

static bool step_state(rt_case *one, rt_decision *decision) {
    const rt_contract *contract = &one->invocation->invocation.contract;
    tally of = {RT_STATE_UNKNOWN, RT_NO_CLAUSE, false};
    return all_hold(one, contract->require, &one->at, &of, RT_STATE_VIOLATED, decision) &&
           all_hold(one, contract->assume, &one->at, &of, RT_STATE_VIOLATED, decision) && told(&of, decision);
}

static bool step_safety(rt_case *one, rt_decision *decision) {
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
    rt_truth charge = rt_charge_suffices(&invocation->contract, vehicle, one->invocation->asked, rt_slot(&one->now, vehicle->battery),
                                         rt_slot(&one->now, vehicle->drain), &volume);
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

/* The earliest of deadline, end of validity and the moment when a value that was read becomes stale. */
static int64_t valid_until(const rt_case *one) {
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

void rt_decide(rt_prepared_invocation *invocation, const rt_state *state, const rt_context *context, const rt_now *now,
               rt_decision *decision) {
    static const struct {
        int64_t number;
        bool (*passes)(rt_case *one, rt_decision *decision);
    } steps[] = {
        {1, step_integrity}, {2, step_freshness}, {3, step_authority}, {3, step_confirmation},
        {4, step_phase},     {5, step_timing},    {6, step_state},     {7, step_safety},
    };
    rt_case one;
    rt_begin_case(invocation, state, context, now, &one);
    *decision = (rt_decision){RT_DENY, RT_BINDING_MISMATCH, 0, RT_NO_CLAUSE, RT_NO_TARGET, now->monotonic_us};
    for (size_t at = 0; at < sizeof steps / sizeof *steps; at++) {
        decision->step = steps[at].number;
        if (!steps[at].passes(&one, decision)) {
            if (decision->outcome == RT_FALLBACK) decision->target = rt_fallback(&one);
            return;
        }
    }
    decision->step = 8;
    rt_found(decision, RT_ADMITTED, RT_NO_CLAUSE);
    decision->valid_until_us = valid_until(&one);
}
