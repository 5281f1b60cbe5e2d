/* Frama-C's Eva runs this: every function of decision/decide.h, for any code, in any situation, under any policy and step with numbers
   as decision/checks and wire/request ensure them. There are two rules and two contracts. */
#include "any.h"
#include "decision/parts.h"

#define COUNT 1000000

static uint8_t octets[64], path[64], places[64];
static rt_policy policy;
static rt_prepared_policy prepared;
static rt_prepared_invocation invocation;
static rt_state state;
static rt_approval approvals[2];

static int64_t value_of(const rt_list *list) {
    int64_t most = list->at == path || list->at == places ? RT_MAX_COORDINATE : RT_MAX_VALUE;
    return WITHIN(-most, most);
}

static rt_list list_at(const uint8_t *at) { return (rt_list){at, at + sizeof octets, SIZE(COUNT)}; }

static rt_bytes text(void) { return (rt_bytes){octets, SIZE(sizeof octets)}; }

/* The readers of wire/flat.c, which proof/flat.c covers, on checked data. */
bool rt_next_int(rt_list *list, int64_t *value) {
    if (list->count == 0) return false;
    list->count--;
    *value = value_of(list);
    return true;
}

int64_t rt_int_at(rt_list list, uint32_t index) { return value_of(&list); }

bool rt_holds(rt_list list, int64_t value) { return EITHER(); }

static rt_clause clause_of(void) { return (rt_clause){text(), WITHIN(INT64_MIN, INT64_MAX), WITHIN(INT64_MIN, INT64_MAX), WITHIN(INT64_MIN, INT64_MAX), list_at(octets)}; }

static rt_link link_of(void) { return (rt_link){WITHIN(0, 1), list_at(places), WITHIN(0, RT_MAX_DURATION), text(), WITHIN(INT64_MIN, INT64_MAX), WITHIN(INT64_MIN, INT64_MAX), WITHIN(INT64_MIN, INT64_MAX)}; }

bool rt_next_clause(rt_list *list, rt_clause *clause) {
    if (list->count == 0) return false;
    list->count--;
    *clause = clause_of();
    return true;
}

bool rt_next_link(rt_list *list, rt_link *link) {
    if (list->count == 0) return false;
    list->count--;
    *link = link_of();
    return true;
}

bool rt_next_parameter(rt_list *list, rt_parameter *parameter) {
    if (list->count == 0) return false;
    list->count--;
    ANY(*parameter);
    parameter->kind = WITHIN(RT_QUANTITY, RT_PLACE);
    parameter->cell = WITHIN(0, RT_MAX_CELLS - 1);
    return true;
}

static rt_contract contract_of(void) {
    rt_contract one;
    ANY(one);
    one.parameters = list_at(octets);
    one.motion = (rt_motion){WITHIN(RT_HOLD, RT_LAND), WITHIN(-1, RT_MAX_CELLS - 1), WITHIN(-1, RT_MAX_CELLS - 1), WITHIN(-1, RT_MAX_CELLS - 1),
                              WITHIN(-1, RT_MAX_CELLS - 1), WITHIN(RT_ALONG_LEGS, RT_INWARD)};
    one.timing_class = WITHIN(RT_SEMANTIC, RT_REFLEX);
    one.deadline_us = WITHIN(0, RT_MAX_DURATION), one.validity_us = WITHIN(0, RT_MAX_DURATION);
    one.duration_us = WITHIN(0, RT_MAX_DURATION), one.grace_us = WITHIN(0, RT_MAX_DURATION);
    one.require = one.assume = one.maintain = one.fallback = list_at(octets);
    one.energy = WITHIN(0, RT_FULL);
    return one;
}

static void vehicle_of(rt_vehicle *v) {
    v->identity = text();
    v->home_within = WITHIN(0, RT_MAX_COORDINATE);
    v->speed = WITHIN(1, RT_MAX_SPEED);
    v->climb = WITHIN(1, RT_MAX_SPEED);
    v->position_error = WITHIN(0, 1 << 20);
    v->endurance_us = WITHIN(1, RT_MAX_DURATION);
    v->reserve = WITHIN(0, RT_FULL);
    v->utc_offset_us = WITHIN(-RT_DAY, RT_DAY);
    v->position = EITHER() ? 0 : -1;
    v->height = EITHER() ? 2 : -1;
    v->battery = EITHER() ? 3 : -1;
    v->return_altitude = WITHIN(0, RT_HIGHEST);
    v->has_speeds = EITHER();
    rt_speeds *s = &v->speeds;
    s->cruise = WITHIN(1, RT_MAX_SPEED), s->climb = WITHIN(1, RT_MAX_SPEED), s->descent = WITHIN(1, RT_MAX_SPEED);
    s->landing = WITHIN(1, RT_MAX_SPEED), s->homeward = WITHIN(1, RT_MAX_SPEED), s->acceleration = WITHIN(1, RT_MAX_SPEED);
    s->air = WITHIN(1, RT_MAX_SPEED), s->wind = WITHIN(0, RT_MAX_SPEED), s->landing_below = WITHIN(0, RT_HIGHEST);
    s->flight_us = WITHIN(1, RT_MAX_DURATION);
    v->offsets = list_at(octets);
}

static void rule_of(rt_rule *rule) {
    rule->kind = WITHIN(RT_FORBID, RT_DEGRADE);
    rule->skills = rule->roles = rule->sources = list_at(octets);
    rule->has_when = EITHER();
    rule->when = clause_of();
    rule->approver = WITHIN(0, RT_MAX_ROLES - 1);
    rule->second = WITHIN(-1, RT_MAX_ROLES - 1);
    rule->within_us = WITHIN(1, RT_MAX_DURATION);
    rule->has_target = EITHER();
    rule->target = link_of();
    rule->text = text();
    rule->source = WITHIN(INT64_MIN, INT64_MAX), rule->start = WITHIN(INT64_MIN, INT64_MAX), rule->end = WITHIN(INT64_MIN, INT64_MAX);
}

static void policy_of(void) {
    policy.slots = RT_MAX_SLOTS;
    policy.monitor_count = RT_MAX_MONITORS;
    policy.rule_count = policy.contract_count = 2;
    policy.contingency_count = SIZE(RT_MAX_LINKS);
    policy.version = WITHIN(INT64_MIN, INT64_MAX);
    vehicle_of(&policy.vehicle);
    policy.contracts[0] = contract_of(), policy.contracts[1] = contract_of();
    rule_of(&policy.rules[0]), rule_of(&policy.rules[1]);
    policy.has_airspace = EITHER();
    policy.airspace.inside = policy.airspace.outside = list_at(octets);
    rt_zone *zone = policy.zones;
    zone->floor = WITHIN(RT_LOWEST, RT_HIGHEST), zone->ceiling = WITHIN(RT_LOWEST, RT_HIGHEST);
    zone->daily = zone->weekly = zone->dates = list_at(octets);
    FILL(policy.zones);
    policy.sets[0] = policy.tables[0] = list_at(octets);
    FILL(policy.sets);
    FILL(policy.tables);
    prepared.policy = &policy;
    for (uint32_t slot = 0; slot < RT_MAX_SLOTS; slot++) {
        prepared.stale_us[slot] = WITHIN(1, RT_MAX_STALE);
        prepared.most[slot] = slot < 2 ? RT_MAX_COORDINATE : RT_MAX_VALUE; /* the position */
    }
    prepared.zones[0] = (rt_prepared_zone){SIZE(RT_MAX_TOTAL_VERTICES), SIZE(RT_MAX_TOTAL_VERTICES), 1 + SIZE(255), SIZE(RT_MAX_STARTS),
                                           WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE), WITHIN(1, 2 * RT_MAX_COORDINATE + 1),
                                           WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE), WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE),
                                           WITHIN(1, RT_MAX_COORDINATE * RT_MAX_COORDINATE), WITHIN(1, RT_MAX_COORDINATE)};
    FILL(prepared.zones);
    const int32_t most = (int32_t)RT_MAX_COORDINATE;
    prepared.edges[0] = (rt_edge){Frama_C_interval(-most, most), Frama_C_interval(-most, most), Frama_C_interval(-most, most), Frama_C_interval(-most, most)};
    FILL(prepared.edges);
    ANY(prepared.entries);
    ANY(prepared.starts);
}

static void invocation_of(void) {
    rt_planner *planner = &invocation.planner;
    ANY(invocation.arguments);
    for (uint32_t at = 0; at < RT_MAX_CELLS; at++) invocation.arguments[at] = WITHIN(-RT_MAX_VALUE, RT_MAX_VALUE);
    ANY(invocation.along);
    for (uint32_t at = 0; at < RT_MAX_ZONES; at++) invocation.along[at] = (uint8_t)WITHIN(0, 7);
    invocation.policy = &prepared;
    invocation.invocation.issued_at_us = WITHIN(0, RT_MAX_VALUE);
    invocation.invocation.phases = WITHIN(0, INT64_MAX);
    invocation.invocation.source = WITHIN(RT_SOURCE_AGENT, RT_SOURCE_REFLEX);
    invocation.invocation.plan.speed = WITHIN(0, RT_MAX_SPEED);
    invocation.invocation.binding = text();
    invocation.invocation.contract = contract_of();
    invocation.misfit = EITHER();
    invocation.rules[0] = (uint16_t)WITHIN(0, 1), invocation.rules[1] = (uint16_t)WITHIN(0, 1);
    invocation.rule_count = SIZE(2);
    ANY(invocation.reads);
    invocation.phase = WITHIN(RT_NO_PHASE, RT_MAX_PHASE_NAMES);
    invocation.rests_us = WITHIN(0, RT_MAX_DURATION), invocation.lasts_us = WITHIN(0, RT_MAX_DURATION);
    invocation.asked = WITHIN(0, RT_MAX_SPEED);
    planner->kind = WITHIN(RT_HOLD, RT_LAND);
    planner->altitude = WITHIN(RT_LOWEST, RT_HIGHEST);
    planner->has_altitude = EITHER();
    planner->points = SIZE(RT_MAX_PATH);
    planner->x = WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE), planner->y = WITHIN(-RT_MAX_COORDINATE, RT_MAX_COORDINATE);
    planner->path = list_at(path);
    planner->heights = list_at(path);
    planner->first = WITHIN(RT_LOWEST, RT_HIGHEST), planner->low = WITHIN(RT_LOWEST, RT_HIGHEST), planner->high = WITHIN(RT_LOWEST, RT_HIGHEST);
    planner->farthest = WITHIN(0, 2 * RT_MAX_COORDINATE * RT_MAX_COORDINATE);
}

int main(void) {
    const rt_now now = {WITHIN(0, RT_MAX_VALUE), WITHIN(0, RT_MAX_VALUE), WITHIN(0, RT_MAX_VALUE)};
    rt_decision decision;
    ANY(octets);
    policy_of();
    invocation_of();
    state.slots = SIZE(RT_MAX_SLOTS);
    state.monitor_count = SIZE(RT_MAX_MONITORS);
    ANY(state.monitors);
    for (uint32_t slot = 0; slot < RT_MAX_SLOTS; slot++) {
        state.values[slot] = WITHIN(-RT_MAX_VALUE, RT_MAX_VALUE);
        state.ages[slot] = WITHIN(0, UINT32_MAX);
        state.known[slot] = EITHER();
    }
    ANY(approvals);
    for (uint32_t at = 0; at < 2; at++) approvals[at].monotonic_us = WITHIN(0, RT_MAX_VALUE);
    rt_context context = {text(), text(), WITHIN(INT64_MIN, INT64_MAX), WITHIN(0, 1), WITHIN(0, RT_MAX_VALUE), WITHIN(RT_START, UINT16_MAX),
                          WITHIN(0, RT_MAX_VALUE), approvals, SIZE(2)};
    switch (Frama_C_interval(0, 2)) {
    case 0: rt_decide(&invocation, &state, &context, &now, &decision); return decision.outcome;
    case 1: return rt_choose_degrade(&invocation, &state, &now) < 0;
    default: {
        rt_link link = link_of();
        return rt_link_admissible(&link, &prepared, &state, &now, WITHIN(RT_NO_PHASE, RT_MAX_PHASE_NAMES));
    }
    }
}
