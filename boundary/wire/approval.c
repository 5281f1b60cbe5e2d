#include "approval.h"

#include "digest.h"

/* Whether a rule may require this role's approval of an invocation, ignoring its condition. */
static bool confirms(const rt_rule *rule, const rt_invocation *invocation, int64_t role) {
    return rule->kind == RT_CONFIRM && (role == rule->approver || role == rule->second) &&
           (rule->skills.count == 0 || rt_holds(rule->skills, invocation->skill)) &&
           (rule->roles.count == 0 || rt_holds(rule->roles, invocation->role)) &&
           (rule->sources.count == 0 || rt_holds(rule->sources, invocation->source));
}

static void subject_of(const rt_invocation *invocation, int64_t granted, uint8_t subject[RT_DIGEST_BYTES]) {
    rt_list arguments = invocation->arguments;
    memset(subject, 0, RT_DIGEST_BYTES);
    if (granted) {
        memcpy(subject, invocation->invocation_id.at, RT_ID_BYTES); /* whose size was checked with its name */
        return;
    }
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_hash_int(&hash, invocation->skill);
    rt_sha256_add(&hash, (rt_bytes){arguments.at, (uint32_t)(arguments.end - arguments.at)});
    rt_sha256_end(&hash, subject);
}

static bool find(const rt_bytes *steps, uint32_t count, rt_bytes id, rt_invocation *found) {
    for (uint32_t step = 0; step < count; step++) {
        rt_read_invocation(steps[step], found);
        if (rt_same(found->invocation_id, id)) return true;
    }
    return false;
}

rt_refusal rt_open_approval(const rt_flight *flight, rt_bytes document, rt_answered *answered) {
    const rt_policy *policy = &flight->bundle->policy;
    const rt_mission *force = &flight->bundle->mission;
    rt_verified opened;
    rt_cursor body;
    rt_bytes said_flight, mission, id, binding, vehicle, role;
    int64_t granted, issued, expires;
    rt_refusal refusal = rt_open_document(flight, document, &RT_APPROVAL, RT_DUTY_APPROVAL, &opened, &body);
    if (refusal != NULL) return refusal;
    bool whole = rt_take_struct(&body, 9) && rt_take_octets(&body, &said_flight) && rt_take_octets(&body, &mission) &&
                 rt_take_octets(&body, &id) && rt_take_octets(&body, &binding) && rt_take_text(&body, &vehicle) && rt_take_text(&body, &role) &&
                 rt_take_int(&body, &granted) && rt_take_int(&body, &issued) && rt_take_int(&body, &expires);
    if (!whole || granted < 0 || granted > 1) return "malformed";
    if (!rt_same(vehicle, flight->vehicle)) return "wrong-vehicle";
    refusal = rt_speaker_refusal(opened.key, role, rt_sources[RT_SOURCE_OPERATOR], flight->vehicle, rt_latest_utc_us(flight));
    if (refusal == NULL) refusal = rt_check_times(flight, issued, expires);
    if (refusal != NULL) return refusal;
    if (!rt_same(said_flight, flight->flight)) return "other-flight";
    bool current = rt_same(mission, (rt_bytes){flight->bundle->mission_digest, RT_DIGEST_BYTES});
    if (!current && (granted || !rt_is_of_flight(flight, mission))) return "other-mission";
    rt_invocation named, about;
    bool there = find(force->invocations, force->invocation_count, id, &named);
    about = named;
    if (!there) {
        if (granted || !find(flight->replaced, flight->replaced_count, id, &named)) return "unknown-invocation";
        /* the last one that requests the same, because earlier ones may be decided already */
        uint8_t asked[RT_DIGEST_BYTES], asks[RT_DIGEST_BYTES];
        subject_of(&named, 0, asked);
        for (uint32_t step = force->invocation_count; step > 0 && !there; step--) {
            rt_invocation_at(force, step - 1, &about);
            subject_of(&about, 0, asks);
            there = memcmp(asked, asks, sizeof asks) == 0;
        }
        if (!there) return "unknown-invocation";
    }
    if (!rt_same(named.binding, binding)) return "binding-mismatch";
    int64_t number = 0;
    while (number < policy->role_count && !rt_same(policy->roles[number], role)) number++;
    bool asked_for = false;
    for (uint32_t rule = 0; rule < policy->rule_count && number < policy->role_count; rule++)
        asked_for = asked_for || confirms(&policy->rules[rule], &about, number);
    if (!asked_for) return "not-asked";
    subject_of(&about, granted, answered->subject);
    answered->step = about.step;
    answered->role = number;
    answered->person = rt_person(flight->root, opened.key);
    answered->granted = granted;
    answered->monotonic_us = flight->now.monotonic_us;
    answered->expires_us = expires;
    return NULL;
}

static bool counts(const rt_answered *answered, const rt_now *now) {
    return !answered->granted || now->utc_us + now->utc_error_us < answered->expires_us;
}

rt_refusal rt_add_answer(rt_approvals *approvals, const rt_answered *answered, const rt_now *now) {
    uint32_t at = 0;
    for (; at < approvals->count; at++) {
        const rt_answered *held = &approvals->held[at];
        if (memcmp(held->subject, answered->subject, RT_DIGEST_BYTES) != 0 || held->role != answered->role ||
            held->person != answered->person || held->granted != answered->granted)
            continue;
        if (counts(held, now)) return "already-answered";
        break;
    }
    if (at == RT_MAX_ANSWERS) return "too-many";
    approvals->held[at] = *answered;
    if (at == approvals->count) approvals->count++;
    return NULL;
}

void rt_keep_answers(rt_approvals *approvals, const rt_mission *mission) {
    uint32_t kept = 0;
    for (uint32_t at = 0; at < approvals->count; at++) {
        const rt_answered held = approvals->held[at];
        rt_invocation invocation;
        if (!held.granted || find(mission->invocations, mission->invocation_count, (rt_bytes){held.subject, RT_ID_BYTES}, &invocation))
            RT_AT(approvals->held, kept++) = held;
    }
    approvals->count = kept;
}

uint32_t rt_answers_about(const rt_approvals *approvals, const rt_invocation *invocation, const rt_now *now, rt_approval *out) {
    uint8_t subjects[2][RT_DIGEST_BYTES];
    uint32_t count = 0;
    for (int64_t granted = 0; approvals->count > 0 && granted < 2; granted++) subject_of(invocation, granted, subjects[granted]);
    for (uint32_t at = 0; at < approvals->count; at++) {
        const rt_answered *held = &approvals->held[at];
        if (memcmp(held->subject, subjects[held->granted], RT_DIGEST_BYTES) != 0 || !counts(held, now)) continue;
        out[count++ % RT_MAX_ANSWERS] = (rt_approval){RT_EVERY_RULE, held->role, held->granted, held->monotonic_us, held->person};
    }
    return count;
}
