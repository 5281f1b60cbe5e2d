#include "session.h"

#include "wire/cancellation.h"
#include "wire/recall.h"

/* numbers of section 4.1: the last step that a request must pass for its id to be used, and others */
enum { INTEGRITY = 1, AUTHORITY = 3, STATE = 6, ADMITTED = 8 };
enum { HOLD = 1, REPLAN = 3 }; /* OnInadmissible */

static void know(rt_in_force *in_force, uint32_t first) {
    const rt_mission *mission = &in_force->bundle.mission;
    rt_invocation invocation;
    for (uint32_t step = first; step < mission->invocation_count && in_force->known_count < RT_MAX_KNOWN; step++) {
        rt_invocation_at(mission, step, &invocation);
        in_force->known[in_force->known_count++] = invocation.invocation_id;
    }
}

rt_refusal rt_session_begin(rt_session *session, rt_bytes data, const rt_root *root, rt_bytes vehicle,
                            const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *now) {
    rt_in_force *in_force = &session->in_force;
    rt_bundle *bundle = &in_force->bundle;
    rt_invocation invocation;
    rt_refusal refused = rt_open_bundle(data, root, vehicle, now->utc_us, bundle);
    if (refused == NULL) refused = rt_prepare(&bundle->policy, &in_force->prepared);
    if (refused == NULL) refused = rt_prepare_mission(&bundle->mission, &in_force->prepared);
    if (refused == NULL && (bundle->policy.contingency_count == 0 || bundle->mission.invocation_count == 0)) refused = "malformed";
    if (refused != NULL) return refused;
    in_force->root = root;
    in_force->vehicle = vehicle;
    memcpy(in_force->flight, flight, RT_FLIGHT_BYTES);
    in_force->recalled = in_force->cancelled = false;
    in_force->issued_at_us = bundle->mission.issued_at_us;
    for (uint32_t step = 0; step < bundle->mission.invocation_count; step++) {
        rt_invocation_at(&bundle->mission, step, &invocation);
        in_force->received_us[step] = now->monotonic_us;
        if (invocation.issued_at_us < in_force->issued_at_us) in_force->issued_at_us = invocation.issued_at_us;
    }
    memcpy(in_force->missions[0], bundle->mission_digest, RT_DIGEST_BYTES);
    in_force->mission_count = 1;
    in_force->approvals.count = in_force->replaced_count = in_force->known_count = 0;
    know(in_force, 0);
    memset(session->consumed, 0, sizeof session->consumed);
    session->kept[0].step = session->kept[1].step = session->latest = session->allowed = -1;
    return NULL;
}

bool rt_is_consumed(const rt_session *session, int64_t step) {
    return step >= 0 && (session->consumed[step / 8] >> step % 8 & 1) != 0;
}

static void consume(rt_session *session, int64_t step) {
    session->consumed[step / 8] = (uint8_t)(session->consumed[step / 8] | 1 << step % 8);
}

/* The steps from `first` on are new, and unused. */
static void forget_steps(rt_session *session, int64_t first) {
    for (int64_t step = first; step < RT_MAX_INVOCATIONS; step++)
        session->consumed[step / 8] = (uint8_t)(session->consumed[step / 8] & ~(1 << step % 8));
    for (uint32_t at = 0; at < 2; at++)
        if (session->kept[at].step >= first) session->kept[at].step = -1;
}

rt_prepared_invocation *rt_step_at(rt_session *session, int64_t step) {
    rt_kept_invocation *kept = session->kept;
    for (uint32_t at = 0; at < 2; at++)
        if (kept[at].step == step)
            return &kept[at].invocation;
    rt_kept_invocation *older = kept[0].step <= kept[1].step ? &kept[0] : &kept[1];
    older->step = step;
    rt_prepare_invocation(&session->in_force.bundle.mission, (uint32_t)step, &session->in_force.prepared, &older->invocation);
    return &older->invocation;
}

rt_status rt_turn_of(const rt_session *session, int64_t kind, int64_t step, int64_t link) {
    if (kind == RT_CONTINGENCY_LINK)
        return step == -1 && link >= 0 && link < session->in_force.bundle.policy.contingency_count ? RT_DECIDED : RT_UNKNOWN_STEP;
    const rt_mission *mission = &session->in_force.bundle.mission;
    if (step < 0 || step >= mission->invocation_count)
        return RT_UNKNOWN_STEP;
    if (kind == RT_FALLBACK_LINK) {
        rt_invocation invocation;
        rt_invocation_at(mission, (uint32_t)step, &invocation);
        if (link < RT_DEGRADE_LINK || link >= (int64_t)invocation.contract.fallback.count)
            return RT_UNKNOWN_STEP;
        /* the step that may fly keeps its chain while a later one is requested and not admitted */
        return step == session->latest || step == session->allowed ? RT_DECIDED : RT_NOT_CURRENT;
    }
    if (kind != RT_STEP || link != -1)
        return RT_UNKNOWN_STEP;
    bool passed_over = step < session->latest && !rt_is_consumed(session, step);
    return rt_called_off(session) || passed_over || step > session->latest + 1 ? RT_NOT_CURRENT : RT_DECIDED;
}

/* Whether an answer leaves the id unused. A deferred step may be requested again until its deadline, and so may a step whose mission
   says to hold. */
static bool may_ask_again(const rt_invocation *invocation, const rt_decision *decision) {
    bool waits = invocation->on_inadmissible == HOLD || invocation->on_inadmissible == REPLAN;
    if (decision->outcome == RT_FALLBACK) return waits && decision->reason != RT_NO_SLACK;
    return decision->outcome == RT_DEFER;
}

void rt_decide_step(rt_session *session, int64_t step, const rt_state *state, const rt_context *context, const rt_now *now,
                    rt_decision *decision) {
    rt_prepared_invocation *invocation = rt_step_at(session, step);
    rt_decide(invocation, state, context, now, decision);
    if (decision->outcome != RT_DENY && step > session->latest)
        session->latest = step;
    if (decision->outcome == RT_ALLOW && step > session->allowed)
        session->allowed = step;
    if (decision->step > AUTHORITY && !may_ask_again(&invocation->invocation, decision))
        consume(session, step);
}

bool rt_session_give_back(rt_session *session, int64_t step) {
    if (step != session->latest || !rt_is_consumed(session, step)) return false;
    session->consumed[step / 8] = (uint8_t)(session->consumed[step / 8] & ~(1 << step % 8));
    if (session->allowed >= step) session->allowed = step - 1;
    return true;
}

/* The link of a chain of this number, which exists. */
static rt_link link_at(rt_list chain, int64_t number) {
    rt_link link;
    do
        rt_next_link(&chain, &link);
    while (number-- > 0);
    return link;
}

void rt_decide_link(rt_session *session, int64_t kind, int64_t step, int64_t number, rt_bytes binding, const rt_state *state,
                    const rt_now *now, rt_decision *decision) {
    const rt_in_force *in_force = &session->in_force;
    rt_bytes bound = {in_force->bundle.policy_digest, RT_DIGEST_BYTES};
    rt_prepared_invocation *invocation = kind == RT_CONTINGENCY_LINK ? NULL : rt_step_at(session, step);
    if (invocation != NULL)
        bound = invocation->invocation.binding;
    *decision = (rt_decision){RT_DENY, RT_BINDING_MISMATCH, INTEGRITY, RT_NO_CLAUSE, RT_NO_TARGET, now->monotonic_us};
    if (!rt_same(binding, bound))
        return;
    *decision = (rt_decision){RT_FALLBACK, RT_STATE_VIOLATED, STATE, RT_NO_CLAUSE, RT_NO_TARGET, now->monotonic_us};
    int64_t target = RT_NO_TARGET;
    if (invocation != NULL && number == RT_DEGRADE_LINK) {
        target = rt_choose_degrade(invocation, state, now);
    } else {
        rt_link link = invocation == NULL ? in_force->bundle.policy.contingency[number]
                                          : link_at(invocation->invocation.contract.fallback, number);
        if (rt_link_admissible(&link, &in_force->prepared, state, now, invocation == NULL ? RT_NO_PHASE : invocation->phase))
            target = number;
    }
    if (target != RT_NO_TARGET)
        *decision = (rt_decision){RT_ALLOW, RT_ADMITTED, ADMITTED, RT_NO_CLAUSE, target, now->monotonic_us + RT_LINK_VALID_US};
}

/* ---------------------------------------------------------------- documents */

static rt_refusal take_approval(rt_in_force *in_force, const rt_flight *flight, rt_bytes document, int64_t decided, rt_taken *taken) {
    rt_answered answered;
    rt_refusal refused = rt_open_approval(flight, document, &answered);
    if (refused != NULL) return refused;
    if (answered.step < decided) return "already-decided";
    refused = rt_add_answer(&in_force->approvals, &answered, &flight->now);
    if (refused != NULL) return refused;
    taken->step = answered.step;
    taken->role = answered.role;
    taken->granted = answered.granted;
    taken->expires_us = answered.expires_us;
    return NULL;
}

static bool is_known(const rt_in_force *in_force, rt_bytes id) {
    for (uint32_t at = 0; at < in_force->known_count; at++)
        if (rt_same(in_force->known[at], id)) return true;
    return false;
}

static rt_refusal take_replacement(rt_in_force *in_force, const rt_flight *flight, rt_bytes document, int64_t released, rt_taken *taken) {
    rt_replacement *found = &in_force->arriving;
    rt_bundle *bundle = &in_force->bundle;
    const rt_mission *old = &bundle->mission, *new = &found->mission;
    rt_invocation invocation;
    if (in_force->mission_count > RT_MAX_REPLACEMENTS) return "too-many";
    rt_refusal refused = rt_open_replacement(flight, document, found);
    if (refused == NULL) refused = rt_fit_replacement(found, bundle, released);
    if (refused != NULL) return refused;
    uint32_t kept = (uint32_t)found->kept; /* at most as many as either mission has, so they fit */
    for (uint32_t step = kept; step < new->invocation_count; step++) {
        rt_invocation_at(new, step, &invocation);
        if (is_known(in_force, invocation.invocation_id)) return "id-seen";
    }
    if (rt_prepare_mission(new, &in_force->prepared) != NULL) return "malformed";
    /* no flight reaches these limits: a document of 256 KiB cannot contain 2,048 steps, and the number of documents is bounded */
    if (in_force->known_count + new->invocation_count - kept > RT_MAX_KNOWN) return "too-many";
    for (uint32_t step = kept; step < old->invocation_count; step++) {
        rt_invocation_at(old, step, &invocation);
        in_force->replaced[in_force->replaced_count++] = invocation.raw;
    }
    uint32_t steps = new->invocation_count;
    rt_replace(found, bundle);
    know(in_force, kept);
    for (uint32_t step = kept; step < steps; step++) in_force->received_us[step] = flight->now.monotonic_us;
    memcpy(in_force->missions[in_force->mission_count++], found->digest, RT_DIGEST_BYTES);
    rt_keep_answers(&in_force->approvals, &bundle->mission);
    taken->step = kept;
    return NULL;
}

/* Whether the last requested step may still be replaced: no frame of it was sent, and its id is not used. */
static bool is_replaceable(const rt_session *session) {
    const rt_mission *mission = &session->in_force.bundle.mission;
    rt_invocation invocation;
    if (session->latest <= session->allowed || session->latest >= mission->invocation_count || rt_is_consumed(session, session->latest))
        return false;
    rt_invocation_at(mission, (uint32_t)session->latest, &invocation);
    return invocation.on_inadmissible == REPLAN;
}

void rt_take_document(rt_session *session, rt_bytes document, const rt_now *now, int64_t released, rt_taken *taken) {
    rt_in_force *in_force = &session->in_force;
    const rt_flight flight = {
        in_force->root, in_force->vehicle, {in_force->flight, RT_FLIGHT_BYTES}, *now, &in_force->bundle,
        (const uint8_t(*)[RT_DIGEST_BYTES])in_force->missions, in_force->mission_count, in_force->replaced, in_force->replaced_count};
    const rt_artefact *kind;
    int64_t decided = session->latest + rt_is_consumed(session, session->latest);
    int64_t asked = session->latest + !is_replaceable(session);
    int64_t current = session->latest > 0 ? session->latest : 0;
    *taken = (rt_taken){RT_OF_UNKNOWN, NULL, -1, -1, -1, 0};
    taken->refused = rt_kind_of(document, &kind);
    if (taken->refused != NULL) return;
    const rt_bytes names[] = {RT_APPROVAL.name, RT_RECALL.name, RT_REPLACEMENT.name, RT_CANCELLATION.name};
    for (taken->kind = RT_OF_APPROVAL; !rt_same(kind->name, names[taken->kind - 1]); taken->kind++) {}
    if (in_force->recalled) {
        taken->refused = "recalled";
    } else if (in_force->cancelled && taken->kind != RT_OF_RECALL) {
        taken->refused = "cancelled";
    } else if (taken->kind == RT_OF_APPROVAL) {
        taken->refused = take_approval(in_force, &flight, document, decided > 0 ? decided : 0, taken);
    } else if (taken->kind == RT_OF_RECALL) {
        taken->refused = rt_open_recall(&flight, document, in_force->issued_at_us);
        in_force->recalled = taken->refused == NULL;
    } else if (taken->kind == RT_OF_CANCELLATION) {
        taken->refused = rt_open_cancellation(&flight, document, (uint32_t)current);
        in_force->cancelled = taken->refused == NULL;
    } else {
        taken->refused = take_replacement(in_force, &flight, document, released > asked ? released : asked, taken);
        if (taken->refused == NULL) forget_steps(session, taken->step);
    }
}
