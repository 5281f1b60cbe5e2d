#include "parts.h"

bool rt_step_integrity(rt_case *one, rt_decision *decision) {
    const rt_context *context = one->context;
    if (!rt_same(context->binding, one->invocation->invocation.binding))
        return rt_found(decision, RT_BINDING_MISMATCH, RT_NO_CLAUSE);
    if (!rt_same(context->vehicle, one->policy->vehicle.identity)) return rt_found(decision, RT_WRONG_VEHICLE, RT_NO_CLAUSE);
    if (context->policy_version != one->policy->version) return rt_found(decision, RT_POLICY_VERSION, RT_NO_CLAUSE);
    return !one->invocation->misfit || rt_found(decision, RT_ARGUMENT_RANGE, RT_NO_CLAUSE);
}

/* The timing classes that a source may use: an agent never reacts, a reflex does nothing else. */
static bool may_use(int64_t source, int64_t timing_class) {
    if (source == RT_SOURCE_REFLEX) return timing_class == RT_REFLEX;
    return timing_class == RT_TACTICAL || (timing_class == RT_SEMANTIC && source != RT_SOURCE_ONBOARD);
}

bool rt_step_authority(rt_case *one, rt_decision *decision) {
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

/* When grants that came by `end` were enough, of one role or of two people: the earliest moment; false where none were. */
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

bool rt_step_confirmation(rt_case *one, rt_decision *decision) {
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
