#include "../parts.h"

#define RT_MAX_POSITION_ERROR (1 << 20)
#define RT_MAX_REACTION 60000000

static bool check_sources(const rt_signal *signal) {
    const uint32_t least = signal->kind == RT_POSITION ? 2 : 1, most = signal->kind == RT_ENUMERATION ? 1 : 2;
    rt_list left = signal->sources;
    rt_signal_source source;
    while (rt_next_source(&left, &source))
        if (!rt_within(source.fields.count, least, most) || !rt_within(source.numerator, 1, RT_MAX_VALUE) ||
            !rt_within(source.denominator, 1, RT_MAX_VALUE))
            return false;
    return true;
}

/* Every slot must have exactly one owner. */
bool rt_check_signals(const rt_policy *policy) {
    rt_slots owned = {{0, 0}};
    if (!rt_within(policy->slots, 0, RT_MAX_SLOTS)) return false;
    for (uint32_t at = 0; at < policy->signal_count; at++) {
        const rt_signal *signal = &policy->signals[at];
        if (!rt_within(signal->kind, RT_NUMBER, RT_POSITION) || !rt_within(signal->stale_us, 1, RT_MAX_STALE) ||
            !check_sources(signal))
            return false;
        int64_t most = policy->slots - (signal->kind == RT_POSITION) - 1;
        if (!rt_within(signal->slot, 0, most)) return false;
        for (int64_t slot = signal->slot; slot <= signal->slot + (signal->kind == RT_POSITION); slot++) {
            if (rt_reads(&owned, slot)) return false;
            rt_add_slot(&owned, slot);
        }
    }
    for (int64_t slot = 0; slot < policy->slots; slot++)
        if (!rt_reads(&owned, slot)) return false;
    return true;
}

static bool is_signal(const rt_policy *policy, int64_t slot, int64_t kind) {
    if (slot == -1) return true;
    for (uint32_t at = 0; at < policy->signal_count; at++)
        if (policy->signals[at].slot == slot) return policy->signals[at].kind == kind;
    return false;
}

static bool check_speeds(const rt_speeds *speeds) {
    const int64_t kept[7] = {speeds->cruise,   speeds->climb,        speeds->descent, speeds->landing,
                             speeds->homeward, speeds->acceleration, speeds->air};
    for (int at = 0; at < 7; at++)
        if (!rt_within(kept[at], 1, RT_MAX_SPEED)) return false;
    return rt_within(speeds->wind, 0, RT_MAX_SPEED) && rt_within(speeds->landing_below, 0, RT_HIGHEST) &&
           rt_within(speeds->flight_us, 1, RT_MAX_DURATION);
}

/* Local time is known from the first moment of a time zone to its last. */
static bool check_offsets(const rt_vehicle *vehicle) {
    rt_list left = vehicle->offsets;
    const bool zoned = left.count > 0;
    int64_t before = -1, moment, offset;
    if ((vehicle->time_zone.size > 0) != zoned || (vehicle->time_zone_data.size > 0) != zoned) return false;
    if (!zoned) return true;
    if (vehicle->utc_offset_us || left.count % 2 == 0 || left.count < 3 || left.count / 2 > RT_MAX_OFFSETS) return false;
    while (rt_next_int(&left, &moment)) {
        if (!rt_within(moment, 0, RT_MAX_VALUE) || moment <= before) return false;
        before = moment;
        if (rt_next_int(&left, &offset) && !rt_within(offset, -RT_DAY, RT_DAY)) return false;
    }
    return true;
}

static bool check_numbers(const rt_vehicle *v) {
    return rt_within(v->home_within, 0, RT_MAX_COORDINATE) && rt_within(v->speed, 1, RT_MAX_SPEED) &&
           rt_within(v->climb, 1, RT_MAX_SPEED) && rt_within(v->position_error, 0, RT_MAX_POSITION_ERROR) &&
           rt_within(v->endurance_us, 1, RT_MAX_DURATION) && rt_within(v->reserve, 0, RT_FULL) &&
           rt_within(v->return_altitude, 0, RT_HIGHEST) && rt_within(v->utc_offset_us, -RT_DAY, RT_DAY) &&
           rt_within(v->braking, 0, RT_MAX_SPEED) && rt_within(v->reaction_us, 0, RT_MAX_REACTION) && check_offsets(v) && rt_check_servos(v) &&
           !(v->braking && (v->north == -1 || v->east == -1 || v->down == -1)) && (!v->has_speeds || check_speeds(&v->speeds));
}

static bool is(rt_bytes text, const char *word, uint32_t size) {
    return text.size == size && memcmp(text.at, word, size) == 0;
}

/* The signals in `without` are in order and nothing reads them; clauses are left out only because of them. */
static bool check_without(const rt_policy *policy) {
    rt_list names = policy->vehicle.without, left = policy->left_out;
    rt_bytes before = {NULL, 0}, name;
    rt_left_out out;
    for (bool first = true; rt_next_text(&names, &name); first = false, before = name) {
        if (!first && rt_compare(before, name) >= 0) return false;
        for (uint32_t at = 0; at < policy->signal_count; at++)
            if (rt_same(policy->signals[at].name, name)) return false;
    }
    while (rt_next_left_out(&left, &out)) {
        if (policy->vehicle.without.count == 0) return false;
        if (is(out.part, "require", 7) || is(out.part, "assume", 6) || is(out.part, "maintain", 8)) {
            if (!rt_within(out.skill, 0, (int64_t)policy->contract_count - 1)) return false;
        } else if (!(is(out.part, "forbid", 6) || is(out.part, "confirm", 7) || is(out.part, "degrade", 7)) || out.skill != -1) {
            return false;
        }
    }
    return true;
}

static bool check_vehicle(const rt_policy *policy) {
    const rt_vehicle *v = &policy->vehicle;
    return check_numbers(v) && check_without(policy) && is_signal(policy, v->position, RT_POSITION) &&
           is_signal(policy, v->height, RT_NUMBER) && is_signal(policy, v->battery, RT_NUMBER) &&
           is_signal(policy, v->north, RT_NUMBER) && is_signal(policy, v->east, RT_NUMBER) &&
           is_signal(policy, v->down, RT_NUMBER);
}

/* Each monitor reads only earlier ones, so that one pass evaluates all of them; also returns what each reads. */
static bool check_monitors(const rt_policy *policy, rt_prepared_policy *prepared) {
    for (uint32_t at = 0; at < policy->monitor_count; at++) {
        const rt_monitor *monitor = &policy->monitors[at];
        const rt_scope scope = {prepared, {NULL, NULL, 0}, NULL, at, false};
        const bool looks_back = monitor->kind == RT_FOR_LAST || monitor->kind == RT_WITHIN_LAST;
        bool monitored;
        if (!rt_within(monitor->kind, RT_FOR_LAST, RT_FALLING)) return false;
        if (!rt_within(monitor->window_us, looks_back, looks_back ? RT_MAX_WINDOW : 0) ||
            !rt_code_fits(monitor->when.code, &scope))
            return false;
        prepared->monitor_reads[at] = (rt_slots){{0, 0}};
        rt_read_code(prepared, monitor->when.code, &prepared->monitor_reads[at], &monitored);
    }
    return true;
}

static bool check_phases(const rt_policy *policy) {
    for (uint32_t at = 1; at < policy->phase_count; at++)
        for (uint32_t before = 0; before < at; before++)
            if (rt_same(policy->phases[at], policy->phases[before])) return false;
    return true;
}

/* Whether numbers are distinct, ascending indexes of `count` things. */
static bool ascending(rt_list list, int64_t count) {
    int64_t before = -1, value;
    while (rt_next_int(&list, &value)) {
        if (value <= before || value >= count) return false;
        before = value;
    }
    return true;
}

static bool check_rule(const rt_rule *rule, const rt_policy *policy, const rt_prepared_policy *prepared) {
    const rt_scope scope = {prepared, rule->skills, NULL, policy->monitor_count, true};
    const int64_t roles = policy->role_count;
    if (!rt_within(rule->kind, RT_FORBID, RT_DEGRADE) || !ascending(rule->skills, policy->contract_count) ||
        !ascending(rule->roles, roles))
        return false;
    if (!ascending(rule->sources, RT_SOURCE_REFLEX + 1) || (rule->has_when && !rt_code_fits(rule->when.code, &scope)))
        return false;
    if (rule->kind == RT_CONFIRM)
        return rt_within(rule->approver, 0, roles - 1) && rt_within(rule->second, -1, roles - 1) &&
               rt_within(rule->within_us, 1, RT_MAX_DURATION);
    return rule->second == -1 && (rule->kind != RT_DEGRADE || (rule->has_target && rt_check_link(&rule->target, policy)));
}

static bool check_rules(const rt_policy *policy, const rt_prepared_policy *prepared) {
    uint64_t keys = 0;
    for (uint32_t at = 0; at < policy->rule_count; at++) {
        const rt_rule *rule = &policy->rules[at];
        keys += (uint64_t)(rule->skills.count ? rule->skills.count : 1) * (rule->roles.count ? rule->roles.count : 1);
        if (keys > RT_MAX_RULE_KEYS || !check_rule(rule, policy, prepared)) return false;
    }
    return true;
}

static bool zones_exist(rt_list zones, const rt_policy *policy) {
    int64_t zone;
    while (rt_next_int(&zones, &zone))
        if (!rt_within(zone, 0, (int64_t)policy->zone_count - 1)) return false;
    return true;
}

/* Its signals were checked before. */
bool rt_check_policy(const rt_policy *policy, rt_prepared_policy *prepared) {
    if (!check_vehicle(policy) || !rt_check_zones(policy, prepared)) return false;
    for (uint32_t at = 0; at < policy->set_count; at++)
        if (policy->sets[at].count > RT_MAX_MEMBERS) return false;
    if (!check_phases(policy) || !check_monitors(policy, prepared)) return false;
    for (uint32_t at = 0; at < policy->contract_count; at++)
        if (!rt_check_contract(&policy->contracts[at], prepared, prepared->cells[at])) return false;
    for (uint32_t at = 0; at < policy->contract_count; at++)
        if (!rt_check_chain(policy->contracts[at].fallback, policy)) return false;
    for (uint32_t at = 0; at < policy->contingency_count; at++)
        if (!rt_check_link(&policy->contingency[at], policy)) return false;
    return check_rules(policy, prepared) &&
           (!policy->has_airspace ||
            (zones_exist(policy->airspace.inside, policy) && zones_exist(policy->airspace.outside, policy))) &&
           rt_within(policy->without_evidence, 0, 1) && rt_within(policy->silence_us, 1, RT_MAX_SILENCE) &&
           rt_within(policy->after_silence, 0, 1);
}
