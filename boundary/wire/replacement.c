#include "replacement.h"

#include "digest.h"
#include "flat.h"

rt_refusal rt_open_replacement(const rt_flight *flight, rt_bytes document, rt_replacement *found) {
    rt_verified opened;
    rt_cursor body;
    rt_after after;
    rt_refusal refusal = rt_open_document(flight, document, &RT_REPLACEMENT, RT_DUTY_MISSION, &opened, &body);
    if (refusal != NULL) return refusal;
    bool whole = rt_take_struct(&body, 4) && rt_take_octets(&body, &after.flight) && rt_take_octets(&body, &after.supersedes) &&
                 rt_take_int(&body, &after.kept) && rt_take_mission(&body, opened.payload, &found->mission);
    if (!whole) return "malformed";
    if (!rt_same(after.flight, flight->flight)) return "other-flight";
    found->supersedes = after.supersedes;
    found->kept = after.kept;
    found->key = opened.key;
    rt_digest(RT_DOMAIN("mission"), opened.payload, found->digest);
    refusal = rt_check_bundle(flight->bundle, &found->mission, opened.key, flight->vehicle, rt_latest_utc_us(flight), &after);
    if (refusal != NULL) return refusal;
    if (found->mission.issued_at_us > rt_latest_utc_us(flight)) return "issued-in-future";
    return found->mission.invocation_count == 0 ? "no-step" : NULL;
}

/* The same conditions, independent of their source position. */
static bool same_clauses(rt_list a, rt_list b) {
    rt_clause one, other;
    if (a.count != b.count) return false;
    while (rt_next_clause(&a, &one) && rt_next_clause(&b, &other))
        if (!rt_same(one.text, other.text) || !rt_same_list(one.code, other.code)) return false;
    return true;
}

static bool same_links(rt_list a, rt_list b) {
    rt_link one, other;
    if (a.count != b.count) return false;
    while (rt_next_link(&a, &one) && rt_next_link(&b, &other))
        if (one.skill != other.skill || !rt_same_list(one.arguments, other.arguments) || one.limit_us != other.limit_us || !rt_same(one.text, other.text))
            return false;
    return true;
}

static bool same_contract(const rt_contract *a, const rt_contract *b) {
    return rt_same(a->name, b->name) && rt_same_list(a->parameters, b->parameters) && a->motion.kind == b->motion.kind &&
           a->motion.altitude == b->motion.altitude && a->motion.speed == b->motion.speed && a->motion.time == b->motion.time &&
           a->motion.lowest == b->motion.lowest && a->motion.facing == b->motion.facing &&
           a->timing_class == b->timing_class && a->deadline_us == b->deadline_us && a->validity_us == b->validity_us &&
           rt_same_list(a->phases, b->phases) && a->duration_us == b->duration_us && a->grace_us == b->grace_us &&
           same_clauses(a->require, b->require) && same_clauses(a->assume, b->assume) && same_clauses(a->maintain, b->maintain) &&
           same_links(a->fallback, b->fallback) && a->energy == b->energy && rt_same_list(a->record, b->record) && rt_same_list(a->reads, b->reads) &&
           rt_same_list(a->emits, b->emits);
}

/* The content of an invocation without its name, its time of issue and its source position; `phases` masks the phases in which it is
   valid. */
static bool same_step(const rt_invocation *a, const rt_invocation *b, uint64_t phases) {
    return a->step == b->step && a->phase == b->phase && a->skill == b->skill && a->source == b->source && a->role == b->role &&
           rt_same_list(a->arguments, b->arguments) && ((uint64_t)a->phases & phases) == ((uint64_t)b->phases & phases) &&
           a->on_inadmissible == b->on_inadmissible && same_contract(&a->contract, &b->contract) && a->plan.kind == b->plan.kind &&
           rt_same_list(a->plan.path, b->plan.path) && a->plan.altitude == b->plan.altitude && a->plan.speed == b->plan.speed &&
           rt_same_list(a->plan.heights, b->plan.heights) && rt_same_list(a->plan.headings, b->plan.headings) &&
           rt_same(a->text, b->text);
}

/* The first `kept` steps are the same, in phases of the same names. */
static rt_refusal check_kept(const rt_mission *old, const rt_mission *new, int64_t kept) {
    rt_invocation before, after;
    int64_t phases = 0; /* the size up to the last kept step */
    if (kept < 0 || kept > old->invocation_count || kept > new->invocation_count) return "other-steps";
    for (uint32_t step = 0; step < kept; step++) {
        rt_invocation_at(old, step, &before);
        if (before.phase >= phases) phases = before.phase < RT_MAX_PHASES ? before.phase + 1 : RT_MAX_PHASES;
    }
    rt_list old_names = old->phases, new_names = new->phases;
    for (int64_t phase = 0; phase < phases; phase++) {
        rt_bytes one, other;
        bool was = rt_next_text(&old_names, &one), is = rt_next_text(&new_names, &other);
        if (was != is || (was && !rt_same(one, other))) return "other-steps";
    }
    uint64_t mask = phases >= 64 ? UINT64_MAX : ((uint64_t)1 << phases) - 1;
    for (uint32_t step = 0; step < kept; step++) {
        rt_invocation_at(old, step, &before);
        rt_invocation_at(new, step, &after);
        if (!same_step(&before, &after, mask)) return "other-steps";
    }
    return NULL;
}

rt_refusal rt_fit_replacement(const rt_replacement *found, const rt_bundle *bundle, int64_t released) {
    if (!rt_same(found->supersedes, (rt_bytes){bundle->mission_digest, RT_DIGEST_BYTES})) return "superseded";
    if (found->kept < released) return "already-released";
    rt_refusal refusal = check_kept(&bundle->mission, &found->mission, found->kept);
    return refusal != NULL ? refusal : rt_check_set_aside(found->key, bundle, (uint32_t)found->kept);
}

void rt_replace(rt_replacement *found, rt_bundle *bundle) {
    memcpy(found->mission.invocations, bundle->mission.invocations, (size_t)found->kept * sizeof(rt_bytes));
    bundle->mission = found->mission;
    memcpy(bundle->mission_digest, found->digest, RT_DIGEST_BYTES);
    bundle->mission_key = found->key;
}

rt_refusal rt_check_set_aside(const rt_key *key, const rt_bundle *bundle, uint32_t first) {
    return rt_check_proposer(key, &bundle->policy, &bundle->mission, first, rt_names(key->sources, rt_sources[RT_SOURCE_OPERATOR]), 0);
}
