#include "boundary.h"

#include "evidence/note.h"
#include "wire/octets.h"

#define CLOCKS_PART_US 3000000LL

bool rt_is_apart(int64_t now_us, int64_t own_us) {
    return own_us >= 0 && (now_us > own_us + RT_APART_US || now_us < own_us - RT_APART_US);
}

int64_t rt_own_now(const rt_boundary *boundary, const rt_now *named, int64_t own_us, rt_now *now) {
    if (own_us < 0) {
        *now = *named;
        return RT_UTC_SHARED;
    }
    rt_clock_now(&boundary->clock, own_us, now);
    return boundary->clock.source;
}

/* Why a claimed time of day is not used for a decision: RT_DECIDED if it is. */
static uint8_t disowned(const rt_boundary *boundary, const rt_now *named, int64_t own_us) {
    rt_now own;
    int64_t source = rt_own_now(boundary, named, own_us, &own);
    if (source == RT_UTC_SHARED || rt_bears_out(&own, named)) return RT_DECIDED;
    return source == RT_UTC_UNKNOWN ? RT_CLOCK_UNKNOWN : RT_CLOCK_APART;
}

/* Once the time is known, keys that were accepted by an unverified clock are checked again. */
static bool is_dated(rt_boundary *boundary, int64_t own_us) {
    const rt_bundle *bundle = &boundary->session.in_force.bundle;
    rt_now own;
    if (boundary->dated || own_us < 0 || boundary->clock.source == RT_UTC_UNKNOWN) return true;
    rt_clock_now(&boundary->clock, own_us, &own);
    boundary->dated = own.utc_us < boundary->root.expires_at_us && rt_key_refusal(bundle->policy_key, boundary->vehicle, own.utc_us) == NULL &&
                      rt_check_proposer(bundle->mission_key, &bundle->policy, &bundle->mission, 0, false, own.utc_us) == NULL;
    return boundary->dated;
}

/* For a boundary with only the caller's clock. */
static bool keeps_time(rt_boundary *boundary, const rt_now *now) {
    if (now->utc_error_us > CLOCKS_PART_US)
        return true; /* a clock that does not know the time grants nothing in any case */
    int64_t ahead = now->utc_us - now->monotonic_us;
    if (!boundary->ahead_known) {
        boundary->ahead_known = true;
        boundary->ahead_us = ahead;
    }
    int64_t parted = ahead - boundary->ahead_us;
    return parted <= CLOCKS_PART_US && parted >= -CLOCKS_PART_US;
}

/* A request that was refused without a decision. */
static uint32_t undecided(rt_boundary *boundary, uint8_t status, rt_bytes request, uint8_t *out) {
    uint8_t digest[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, request);
    rt_sha256_end(&hash, digest);
    rt_chain_add(&boundary->chain, RT_TAG_UNDECIDED, (rt_bytes){&status, 1}, (rt_bytes){digest, sizeof digest});
    return rt_write_refusal(status, boundary->chain.digest, out);
}

/* An answer about a step that equals the previous one is counted and makes no entry. */
static void chain_decided(rt_boundary *boundary, rt_bytes request, const rt_decision *decision, int64_t consumed, bool permitted) {
    const rt_request *asked = &boundary->asked;
    const int64_t said[5] = {asked->step, decision->outcome, decision->reason, decision->clause, decision->target};
    uint8_t payload[14], *at = payload;
    rt_put(&at, (uint64_t)decision->outcome, 1);
    rt_put(&at, (uint64_t)decision->reason, 1);
    rt_put(&at, (uint64_t)decision->step, 1);
    rt_put(&at, (uint64_t)(decision->target > RT_DEGRADE_LINK ? decision->target : RT_DEGRADE_LINK), 2);
    rt_put(&at, (uint64_t)decision->valid_until_us, 8);
    rt_put(&at, (uint64_t)consumed, 1);
    bool again = false;
    if (asked->kind == RT_STEP) {
        again = boundary->answered && !permitted && memcmp(said, boundary->last, sizeof said) == 0;
        memcpy(boundary->last, said, sizeof said);
        boundary->answered = true;
    }
    if (again) rt_chain_repeat(&boundary->chain, (rt_bytes){payload, sizeof payload}, request);
    else rt_chain_add(&boundary->chain, RT_TAG_DECIDED, (rt_bytes){payload, sizeof payload}, request);
}

static uint32_t answer_step(rt_boundary *boundary, rt_bytes request, uint8_t *out) {
    const rt_request *asked = &boundary->asked;
    rt_session *session = &boundary->session;
    rt_prepared_invocation *step = rt_step_at(session, asked->step);
    rt_decision decision;
    rt_context context = {
        {asked->binding, RT_DIGEST_BYTES}, boundary->vehicle, boundary->version, rt_is_consumed(session, asked->step) ? 1 : 0,
        asked->released_us, asked->phase, asked->remaining_us, boundary->approvals, 0,
    };
    const rt_in_force *in_force = &session->in_force;
    context.approval_count = rt_answers_about(&in_force->approvals, &step->invocation, &asked->now, boundary->approvals);
    rt_decide_step(session, asked->step, &asked->state, &context, &asked->now, &decision);
    chain_decided(boundary, request, &decision, context.consumed, decision.outcome == RT_ALLOW);
    const uint8_t *evidence = boundary->chain.digest;
    if (decision.outcome != RT_ALLOW)
        return rt_write_answer(&decision, context.consumed, NULL, evidence, out);
    uint8_t sealed[RT_PERMIT_BYTES];
    rt_permit permit = {RT_STEP, asked->step, -1, boundary->serial, step->invocation.contract.fallback.count,
                        in_force->bundle.policy.contingency_count, decision.valid_until_us};
    boundary->serial += 1 + (uint64_t)permit.fallbacks + (uint64_t)permit.contingencies + RT_AGAIN;
    rt_seal_permit(&permit, boundary->executor.key, sealed);
    return rt_write_answer(&decision, context.consumed, sealed, evidence, out);
}

static uint32_t answer_link(rt_boundary *boundary, rt_bytes request, uint8_t *out) {
    const rt_request *asked = &boundary->asked;
    rt_decision decision;
    rt_bytes binding = {asked->binding, RT_DIGEST_BYTES};
    rt_decide_link(&boundary->session, asked->kind, asked->step, asked->link, binding, &asked->state, &asked->now, &decision);
    int64_t target = decision.target;
    decision.target = RT_NO_TARGET;
    chain_decided(boundary, request, &decision, 0, target != RT_NO_TARGET);
    const uint8_t *evidence = boundary->chain.digest;
    if (target == RT_NO_TARGET)
        return rt_write_answer(&decision, 0, NULL, evidence, out);
    uint8_t sealed[RT_PERMIT_BYTES];
    rt_permit permit = {asked->kind, asked->step, target, boundary->serial++, 0, 0, decision.valid_until_us};
    rt_seal_permit(&permit, boundary->executor.key, sealed);
    return rt_write_answer(&decision, 0, sealed, evidence, out);
}

uint32_t rt_enforce(rt_boundary *boundary, rt_bytes request, int64_t own_us, uint8_t *out) {
    rt_request *asked = &boundary->asked;
    const rt_policy *policy = &boundary->session.in_force.bundle.policy;
    if (!rt_read_request(request, policy->slots, policy->monitor_count, asked) || rt_is_apart(asked->now.monotonic_us, own_us))
        return undecided(boundary, RT_MALFORMED, request, out);
    int64_t now_us = asked->now.monotonic_us;
    /* a later release would move the deadline */
    if (now_us < boundary->now_us || now_us < asked->released_us || (own_us < 0 && !keeps_time(boundary, &asked->now)))
        return undecided(boundary, RT_MALFORMED, request, out);
    uint8_t clock = disowned(boundary, &asked->now, own_us);
    if (clock != RT_DECIDED) return undecided(boundary, clock, request, out);
    boundary->now_us = now_us;
    if (!is_dated(boundary, own_us)) boundary->executor.called_off = boundary->session.in_force.recalled = true;
    rt_status turn = rt_turn_of(&boundary->session, asked->kind, asked->step, asked->link);
    if (turn != RT_DECIDED)
        return undecided(boundary, (uint8_t)turn, request, out);
    if (asked->kind != RT_STEP)
        return answer_link(boundary, request, out);
    /* nor could anything be released before it was received */
    if (asked->released_us < boundary->session.in_force.received_us[asked->step])
        return undecided(boundary, RT_MALFORMED, request, out);
    return answer_step(boundary, request, out);
}

rt_refusal rt_boundary_begin(rt_boundary *boundary, const rt_setup *setup) {
    /* not all of it: most of a bundle's memory is never touched, and so needs none */
    boundary->loaded = boundary->opened = boundary->to_keep = false;
    boundary->bundle_size = boundary->document_size = boundary->document_count = 0;
    boundary->flights = boundary->challenges = 0;
    boundary->serial = 1;
    rt_issuer_begin(&boundary->issuer, setup->settings, setup->owed);
    memset(&boundary->executor, 0, sizeof boundary->executor);
    memset(&boundary->chain, 0, sizeof boundary->chain);
    boundary->executor.gate.chain = &boundary->chain;
    boundary->attests = false;
    boundary->keys = setup->keys;
    boundary->kept = setup->kept;
    boundary->vehicle = setup->vehicle;
    boundary->has_key = setup->has_key;
    boundary->has_log_key = setup->has_log_key;
    boundary->home = setup->home;
    rt_refusal refused = rt_open_root(setup->root, setup->pinned, setup->now.utc_us, &boundary->root);
    if (refused != NULL) return refused;
    rt_clock_begin(&boundary->clock, &setup->now, setup->stated_us);
    rt_gate *gate = &boundary->executor.gate;
    gate->signs = setup->signs;
    if (setup->signs)
        rt_signed_link_begin(&gate->signer, setup->keys->link, setup->kept->link_timestamp, setup->kept->streams,
                             (uint32_t)setup->kept->stream_count, setup->now.utc_us, setup->now.monotonic_us, 0);
    return NULL;
}

static void policy_name(const rt_boundary *boundary, uint8_t name[RT_DIGEST_BYTES]) {
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, boundary->session.in_force.bundle.policy.name);
    rt_sha256_end(&hash, name);
}

rt_refusal rt_load(rt_boundary *boundary, const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *named, int64_t own_us) {
    rt_now by_us; /* by our own time of day, whatever is claimed: by this machine's clock if it is not known */
    const int64_t source = rt_own_now(boundary, named, own_us, &by_us);
    const rt_now *now = &by_us;
    by_us.monotonic_us = named->monotonic_us;
    rt_session *session = &boundary->session;
    rt_executor *executor = &boundary->executor;
    rt_invocation invocation;
    if (boundary->loaded && executor->flies) return "flies";
    if (source != RT_UTC_SHARED && source != RT_UTC_UNKNOWN && by_us.utc_us >= boundary->root.expires_at_us) return "root-expired";
    boundary->dated = source != RT_UTC_UNKNOWN;
    boundary->loaded = boundary->opened = boundary->ahead_known = false;
    rt_refusal refused = rt_session_begin(session, (rt_bytes){boundary->bundle, boundary->bundle_size}, &boundary->root,
                                          boundary->vehicle, flight, now);
    if (refused != NULL) return refused;
    rt_bundle *bundle = &session->in_force.bundle;
    boundary->expires_us = 0;
    for (uint32_t step = 0; step < bundle->mission.invocation_count; step++) {
        rt_invocation_at(&bundle->mission, step, &invocation);
        int64_t expires_us = invocation.issued_at_us + invocation.contract.validity_us;
        if (expires_us > boundary->expires_us) boundary->expires_us = expires_us;
    }
    boundary->opened = rt_was_opened(boundary->kept, bundle->mission_digest);
    if (!boundary->opened) {
        uint8_t name[RT_DIGEST_BYTES];
        policy_name(boundary, name);
        const int64_t earliest_us = now->utc_us - now->utc_error_us; /* missions that may not have expired yet are not forgotten */
        refused = rt_may_open(boundary->kept, bundle->mission_digest, session->in_force.issued_at_us, boundary->expires_us, name, bundle->policy.version, earliest_us);
        if (refused != NULL) return refused;
        rt_open_mission(boundary->kept, bundle->mission_digest, boundary->expires_us, name, bundle->policy.version, earliest_us);
        boundary->to_keep = true;
    }
    memset(&boundary->chain, 0, sizeof boundary->chain);
    boundary->attests = boundary->answered = boundary->log_begun = false;
    rt_executor_begin(executor, boundary->keys->session, &bundle->policy, &bundle->mission, boundary->serial);
    boundary->version = bundle->policy.version;
    boundary->now_us = 0;
    boundary->document_count = 0;
    boundary->loaded = true;
    /* a mission that was opened before is brought down by the contingency, and no step of it begins again */
    executor->called_off = session->in_force.recalled = boundary->opened;
    return NULL;
}

bool rt_may_fly(const rt_boundary *boundary) {
    return boundary->loaded && (boundary->opened || boundary->executor.used_count > 0);
}

bool rt_give_back(rt_boundary *boundary) {
    if (!boundary->loaded || rt_may_fly(boundary)) return false;
    rt_forget_mission(boundary->kept, boundary->session.in_force.missions[0]);
    boundary->loaded = false;
    return true;
}

uint32_t rt_present(rt_boundary *boundary, const rt_now *now, int64_t released, int64_t own_us, uint8_t *out) {
    const uint8_t clock = disowned(boundary, now, own_us);
    rt_taken taken = {RT_OF_UNKNOWN, NULL, -1, -1, -1, 0};
    const rt_bytes document = {boundary->documents[boundary->document_count], boundary->document_size};
    if (now->monotonic_us < boundary->now_us) {
        taken.refused = "time-went-back";
    } else if (own_us < 0 && !keeps_time(boundary, now)) {
        taken.refused = "time-of-day-set";
    } else if (clock != RT_DECIDED) {
        taken.refused = clock == RT_CLOCK_UNKNOWN ? "clock-unknown" : "clock-apart";
    } else {
        boundary->now_us = now->monotonic_us;
        if (!is_dated(boundary, own_us)) boundary->session.in_force.recalled = true;
        rt_take_document(&boundary->session, document, now, released, &taken);
        boundary->executor.called_off = rt_called_off(&boundary->session);
        if (taken.refused == NULL && taken.kind == RT_OF_REPLACEMENT) boundary->document_count++;
    }
    if (taken.refused == NULL) {
        uint8_t payload[27], digest[RT_DIGEST_BYTES], *at = payload;
        rt_sha256 hash;
        rt_sha256_begin(&hash);
        rt_sha256_add(&hash, document);
        rt_sha256_end(&hash, digest);
        rt_put(&at, (uint64_t)taken.kind, 1);
        rt_put(&at, (uint64_t)taken.step, 2);
        rt_put(&at, (uint64_t)now->monotonic_us, 8);
        rt_put(&at, (uint64_t)now->utc_us, 8);
        rt_put(&at, (uint64_t)now->utc_error_us, 8);
        rt_chain_add(&boundary->chain, RT_TAG_DOCUMENT, (rt_bytes){payload, sizeof payload}, (rt_bytes){digest, sizeof digest});
    } else {
        rt_chain_decline(&boundary->chain, document);
    }
    boundary->document_size = 0;
    /* the caller makes the text from the slug */
    const char *slug = taken.refused == NULL ? "accepted" : taken.refused;
    const rt_bytes text = rt_words(slug);
    const rt_receipt receipt = {taken.kind, text, text, taken.step, taken.role, taken.granted, taken.expires_us,
                                {boundary->chain.digest, RT_DIGEST_BYTES}};
    return rt_write_receipt(&receipt, out);
}

/* The digest that the next session begins with. A session without a number is not stored. */
static void keep_session(rt_boundary *boundary) {
    if (boundary->attestation == 0) return;
    boundary->kept->session = boundary->attestation;
    memcpy(boundary->kept->session_digest, boundary->chain.digest, RT_DIGEST_BYTES);
    boundary->to_keep = true;
}

bool rt_attest(rt_boundary *boundary, int64_t session, const uint8_t before[RT_DIGEST_BYTES]) {
    const rt_in_force *in_force = &boundary->session.in_force;
    uint8_t payload[8 + RT_DIGEST_BYTES + RT_FLIGHT_BYTES], rest[RT_DIGEST_BYTES + 1], *at = payload;
    if (boundary->attests || !boundary->has_key) return false;
    rt_kept *kept = boundary->kept;
    if (kept->session > 0 && kept->session >= session - 1) {
        session = kept->session + 1;
        before = kept->session_digest;
    }
    memcpy(boundary->before, before, RT_DIGEST_BYTES);
    before = boundary->before;
    rt_put(&at, (uint64_t)session, 8);
    memcpy(at, before, RT_DIGEST_BYTES);
    memcpy(at + RT_DIGEST_BYTES, in_force->flight, RT_FLIGHT_BYTES);
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){boundary->bundle, boundary->bundle_size});
    rt_sha256_end(&hash, rest);
    rest[RT_DIGEST_BYTES] = 1; /* everything is enforced */
    rt_chain_add(&boundary->chain, RT_TAG_BEGIN, (rt_bytes){payload, sizeof payload}, (rt_bytes){rest, sizeof rest});
    boundary->attests = true;
    boundary->attestation = session;
    keep_session(boundary);
    return true;
}

uint32_t rt_attest_home(const rt_boundary *boundary, uint8_t *out) {
    if (!boundary->attests || boundary->home.mode.size == 0) return 0;
    const rt_attested_state state = {
        boundary->keys->boundary, boundary->has_log_key ? boundary->keys->log : NULL,
        boundary->executor.gate.signs ? boundary->keys->link : NULL, boundary->session.in_force.flight, boundary->chain.digest,
        boundary->kept->restarts,
    };
    return rt_sign_attestation(&boundary->home, &state, out);
}

rt_refusal rt_begin_log(rt_boundary *boundary, rt_bytes checkpoint, uint8_t signature[RT_SIGNATURE_BYTES]) {
    if (!boundary->has_log_key) return "no-log-key";
    if (boundary->log_begun) return "log-begun";
    if (!rt_begins_log(checkpoint, boundary->vehicle, boundary->session.in_force.flight)) return "not-its-log";
    rt_ed25519_sign(boundary->keys->log, &checkpoint, 1, signature);
    boundary->log_begun = true;
    return NULL;
}

uint32_t rt_attested(rt_boundary *boundary, const rt_now *named, int64_t own_us, bool final, uint8_t *out) {
    rt_now now;
    const int64_t source = rt_own_now(boundary, named, own_us, &now);
    if (!boundary->attests || boundary->chain.over) return 0;
    boundary->chain.over = final;
    if (final) keep_session(boundary);
    return rt_sign_statement(&boundary->chain, boundary->keys->boundary, boundary->session.in_force.flight, boundary->attestation,
                             boundary->before, source, &now, final, out);
}
