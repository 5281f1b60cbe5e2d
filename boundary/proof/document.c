/* Frama-C's Eva runs this: every signed document of any octets, with any trust root and bundle in force. The results of wire/flat.c are
   any well-formed views. */
#include "reader.h"
#include "seal.h"
#include "wire/approval.h"
#include "wire/cancellation.h"
#include "wire/flat.h"
#include "wire/recall.h"
#include "wire/replacement.h"

static rt_root root;
static rt_bundle bundle;
static rt_replacement replacement;
static rt_approvals approvals;
static rt_approval told[RT_MAX_ANSWERS];
static uint8_t missions[1 + RT_MAX_REPLACEMENTS][RT_DIGEST_BYTES];
static rt_bytes replaced[64];

static rt_bytes text(void) { return (rt_bytes){view, SIZE(BYTES)}; }

static rt_list list(void) { return (rt_list){view, view + SIZE(BYTES), SIZE(UINT32_MAX)}; }

static int64_t number(void) { return WITHIN(INT64_MIN, INT64_MAX); }

static rt_contract contract(void) {
    rt_contract one;
    ANY(one);
    one.name = text();
    one.parameters = one.phases = one.require = one.assume = one.maintain = one.fallback = one.record = one.reads = list();
    return one;
}

static void mission_of(rt_mission *mission) {
    mission->payload = mission->before = mission->behind = text();
    mission->name = mission->vehicle = mission->policy = mission->policy_digest = text();
    mission->policy_version = number();
    mission->issued_at_us = number();
    mission->phases = list();
    mission->invocations[0] = text();
    FILL(mission->invocations);
    mission->invocation_count = SIZE(RT_MAX_INVOCATIONS);
}

/* Covered by proof/flat.c. */
bool rt_take_mission(rt_cursor *cursor, rt_bytes payload, rt_mission *mission) {
    mission_of(mission);
    return taken(cursor);
}

rt_refusal rt_read_mission(rt_bytes payload, rt_mission *mission) {
    mission_of(mission);
    return EITHER() ? "malformed" : NULL;
}

rt_refusal rt_read_policy(rt_bytes payload, rt_policy *policy) {
    rt_rule *rule = policy->rules;
    policy->name = policy->vehicle.identity = policy->roles[0] = text();
    FILL(policy->roles);
    policy->version = number();
    policy->role_count = SIZE(RT_MAX_ROLES);
    policy->rule_count = SIZE(RT_MAX_RULES);
    rule->kind = number(), rule->approver = number(), rule->second = number();
    rule->skills = rule->roles = rule->sources = list();
    FILL(policy->rules);
    return EITHER() ? "malformed" : NULL;
}

void rt_read_invocation(rt_bytes raw, rt_invocation *invocation) {
    ANY(*invocation);
    invocation->raw = invocation->content = invocation->invocation_id = invocation->text = invocation->binding = text();
    invocation->arguments = invocation->plan.path = invocation->plan.heights = invocation->plan.headings = list();
    invocation->contract = contract();
}

void rt_invocation_at(const rt_mission *mission, uint32_t step, rt_invocation *invocation) { rt_read_invocation(mission->invocations[step], invocation); }

static bool next(rt_list *of) {
    if (of->count == 0) return false;
    of->count--;
    return EITHER();
}

bool rt_next_text(rt_list *of, rt_bytes *item) {
    *item = text();
    return next(of);
}

bool rt_next_clause(rt_list *of, rt_clause *clause) {
    *clause = (rt_clause){text(), number(), number(), number(), list()};
    return next(of);
}

bool rt_next_link(rt_list *of, rt_link *link) {
    *link = (rt_link){number(), list(), number(), text(), number(), number(), number()};
    return next(of);
}

static bool take_list(rt_cursor *cursor, rt_list *of) {
    *of = list();
    return taken(cursor);
}
bool rt_take_texts(rt_cursor *cursor, rt_list *of) { return take_list(cursor, of); }
bool rt_take_octet_strings(rt_cursor *cursor, rt_list *of) { return take_list(cursor, of); }
bool rt_holds(rt_list of, int64_t value) { return EITHER(); }
bool rt_names(rt_list texts, rt_bytes name) { return EITHER(); }

static void root_of(void) {
    rt_key *key = root.keys;
    ANY(root);
    key->duty = WITHIN(0, RT_DUTIES - 1);
    key->public = key->person = text();
    key->roles = key->sources = key->vehicles = key->policies = list();
    key->has_expiry = EITHER(), key->development = EITHER();
    FILL(root.keys);
    root.key_count = SIZE(RT_MAX_KEYS);
    root.development = EITHER();
    root.revoked = list();
}

static const rt_key *any_key(void) { return &root.keys[SIZE(RT_MAX_KEYS - 1)]; }

static rt_answered answer(void) {
    rt_answered one;
    ANY(one);
    one.granted = WITHIN(0, 1);
    return one;
}

int main(void) {
    ANY(input);
    ANY(view);
    ANY(missions);
    root_of();
    (void)rt_read_policy(text(), &bundle.policy);
    mission_of(&bundle.mission);
    ANY(bundle.policy_digest);
    ANY(bundle.mission_digest);
    bundle.policy_key = bundle.mission_key = any_key();
    replaced[0] = text();
    FILL(replaced);
    approvals.held[0] = answer();
    FILL(approvals.held);
    approvals.count = SIZE(RT_MAX_ANSWERS);
    const rt_bytes document = {input, SIZE(BYTES)};
    const rt_now now = {WITHIN(0, RT_MAX_VALUE), WITHIN(0, RT_MAX_VALUE), WITHIN(0, RT_MAX_VALUE)};
    const rt_flight flight = {&root, text(), text(), now, &bundle, (const uint8_t(*)[RT_DIGEST_BYTES])missions, SIZE(1 + RT_MAX_REPLACEMENTS), replaced,
                              SIZE(64)};
    rt_answered answered;
    rt_invocation invocation;
    const rt_artefact *kind;
    switch (Frama_C_interval(0, 9)) {
    case 0: return rt_kind_of(document, &kind) != NULL;
    case 1: return rt_open_root(document, text(), number(), &root) != NULL;
    case 2: return rt_open_bundle(document, &root, text(), WITHIN(0, RT_MAX_VALUE), &bundle) != NULL;
    case 3: return rt_open_approval(&flight, document, &answered) != NULL;
    case 4: return rt_open_recall(&flight, document, number()) != NULL;
    case 5: return rt_open_cancellation(&flight, document, SIZE(UINT32_MAX)) != NULL;
    case 6: return rt_open_replacement(&flight, document, &replacement) != NULL;
    case 7:
        mission_of(&replacement.mission);
        replacement.supersedes = text();
        replacement.kept = number();
        replacement.key = any_key();
        if (rt_fit_replacement(&replacement, &bundle, number()) == NULL) return 1;
        replacement.kept = SIZE(RT_MAX_INVOCATIONS); /* as it fits */
        rt_replace(&replacement, &bundle);
        rt_keep_answers(&approvals, &bundle.mission);
        return 0;
    case 8:
        answered = answer();
        return rt_add_answer(&approvals, &answered, &now) != NULL;
    default:
        rt_read_invocation(document, &invocation);
        return (int)(rt_answers_about(&approvals, &invocation, &now, told) + rt_person(&root, any_key()));
    }
}
