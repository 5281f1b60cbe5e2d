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

/* Rules that are the same are candidates alike. */
int64_t rt_rule_number(const rt_prepared_invocation *invocation, uint32_t rule) {
    const rt_rule *rules = invocation->policy->policy->rules;
    uint32_t at = invocation->rule_count;
    while (at > 0 && !same_rule(&rules[invocation->rules[at - 1]], &rules[rule])) at--;
    return at > 0 ? invocation->rules[at - 1] : rule;
}

/* The number of the rule whose target flies: that of the first rule with this very target. */
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
    invocation->planner.along = invocation->along; /* here, for it may have been copied */
    one->policy = invocation->policy->policy;
    one->context = context;
    one->state = state;
    rt_situate(invocation->policy, state, now, &one->now);
    one->here = rt_here(&one->now);
    one->at = (rt_environment){&one->now, invocation->arguments, invocation->phase, &one->here, false, 0};
    one->released_us = context ? context->released_us : 0;
}

void rt_decide(rt_prepared_invocation *invocation, const rt_state *state, const rt_context *context, const rt_now *now,
               rt_decision *decision) {
    static const struct {
        int64_t number;
        bool (*passes)(rt_case *one, rt_decision *decision);
    } steps[] = {
        {1, rt_step_integrity}, {2, rt_step_freshness}, {3, rt_step_authority}, {3, rt_step_confirmation},
        {4, rt_step_phase},     {5, rt_step_timing},    {6, rt_step_state},     {7, rt_step_safety},
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
    decision->valid_until_us = rt_valid_until(&one);
}
