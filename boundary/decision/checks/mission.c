#include "../parts.h"

/* Whether a text has the form of a name in the language. */
static bool is_name(rt_bytes name) {
    bool begins = true; /* the beginning of a part, where a digit or the end is not allowed */
    for (uint32_t at = 0; at < name.size; at++) {
        uint8_t c = name.at[at], letter = c | 0x20;
        bool digit = c >= '0' && c <= '9';
        if (c == '.' ? begins : digit ? begins : !(c == '_' || (letter >= 'a' && letter <= 'z'))) return false;
        begins = c == '.';
    }
    return !begins;
}

/* The mission's phases in which a contract may be used. */
static uint64_t phases_of(const rt_contract *contract, const rt_mission *mission) {
    rt_list left = mission->phases;
    rt_bytes name;
    uint64_t found = 0;
    for (int at = 0; rt_next_text(&left, &name); at++)
        if (contract->phases.count == 0 || rt_names(contract->phases, name)) found |= (uint64_t)1 << at;
    return found;
}

static bool check_phases(const rt_mission *mission) {
    rt_list left = mission->phases;
    rt_bytes name;
    if (left.count > RT_MAX_PHASES) return false;
    while (rt_next_text(&left, &name))
        if (!is_name(name) || rt_names(left, name)) return false;
    return true;
}

/* Whether a clause has the text of a rule or the airspace: a log identifies what decided by its text. */
static bool worded(const rt_prepared_policy *prepared, rt_bytes text) {
    const rt_policy *policy = prepared->policy;
    uint32_t low = 0, high = policy->rule_count;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        int found = rt_compare_words(policy->rules[prepared->by_words[middle]].text, text);
        if (found == 0) return true;
        if (found < 0) low = middle + 1;
        else high = middle;
    }
    return policy->has_airspace && rt_compare_words(policy->airspace.text, text) == 0;
}

static bool none_worded(const rt_prepared_policy *prepared, rt_list clauses) {
    rt_clause clause;
    while (rt_next_clause(&clauses, &clause))
        if (worded(prepared, clause.text)) return false;
    return true;
}

/* The heights and headings of a path. Rules and clauses judge the arguments, so no height is outside of them. */
static bool check_levels(const rt_plan *plan, const rt_motion *motion, rt_list arguments) {
    rt_list heights = plan->heights, headings = plan->headings;
    const uint32_t points = plan->path.count / 2;
    int64_t value, lowest = motion->lowest == -1 ? plan->altitude : rt_int_at(arguments, (uint32_t)motion->lowest);
    if (heights.count > 0 ? motion->lowest == -1 || heights.count != points : lowest > plan->altitude) return false;
    while (rt_next_int(&heights, &value))
        if (!rt_within(value, rt_max(lowest, RT_LOWEST), plan->altitude)) return false;
    if ((headings.count > 0) != (motion->facing != RT_ALONG_LEGS) || (headings.count > 0 && headings.count != points)) return false;
    while (rt_next_int(&headings, &value))
        if (!rt_within(value, RT_ALONG, RT_FULL_TURN - 1)) return false;
    return true;
}

/* The plan must match the arguments: the path that is checked is the path that is flown. */
static bool check_plan(const rt_plan *plan, const rt_motion *motion, rt_list arguments, const rt_projection *projection) {
    rt_list path = plan->path;
    int64_t x, y, altitude = motion->altitude == -1 ? 0 : rt_int_at(arguments, (uint32_t)motion->altitude);
    int64_t speed = motion->speed == -1 ? 0 : rt_int_at(arguments, (uint32_t)motion->speed);
    if (plan->kind != motion->kind || !rt_within(plan->speed, 0, RT_MAX_SPEED) ||
        !rt_within(plan->altitude, RT_LOWEST, RT_HIGHEST))
        return false;
    if (plan->altitude != altitude || plan->speed != speed || path.count % 2 || path.count / 2 > RT_MAX_PATH) return false;
    while (rt_next_int(&path, &x) && rt_next_int(&path, &y)) {
        if (!rt_within(x, -RT_MAX_COORDINATE, RT_MAX_COORDINATE) || !rt_within(y, -RT_MAX_COORDINATE, RT_MAX_COORDINATE))
            return false;
        if (!rt_check_place(projection, x, y)) return false;
    }
    return check_levels(plan, motion, arguments);
}

/* The path leads where the arguments say, because rules and clauses judge the arguments. */
static bool leads_right(const rt_invocation *one, const rt_prepared_policy *policy) {
    rt_list path = one->plan.path;
    uint32_t cell;
    int64_t zone;
    switch (one->plan.kind) {
    case RT_COVER:
        zone = rt_int_at(one->arguments, (uint32_t)rt_first_cell(&one->contract, RT_ZONE));
        if (!rt_within(zone, 0, policy->policy->declared - 1)) return path.count > 0; /* the decision refuses these */
        return path.count > 0 && rt_zone_along(policy, (uint32_t)zone, path, 0) == RT_TRUE;
    case RT_FLY:
        cell = (uint32_t)rt_first_cell(&one->contract, RT_PLACE);
        return path.count == 2 && rt_int_at(path, 0) == rt_int_at(one->arguments, cell) &&
               rt_int_at(path, 1) == rt_int_at(one->arguments, cell + 1);
    case RT_HOME:
        return path.count == 2 && rt_int_at(path, 0) == 0 && rt_int_at(path, 1) == 0;
    default:
        return path.count == 0;
    }
}

/* Whether the legs of a path are compared with at most `*left` edges, from which they are subtracted. */
static bool few_compared(const rt_prepared_policy *prepared, rt_list path, int64_t *left) {
    const rt_policy *policy = prepared->policy;
    int64_t x, y0, y1;
    if (!rt_next_int(&path, &x) || !rt_next_int(&path, &y0)) return true;
    for (; rt_next_int(&path, &x) && rt_next_int(&path, &y1); y0 = y1) {
        for (uint32_t zone = 0; zone < policy->zone_count; zone++)
            *left -= 1 + (int64_t)rt_zone_compared(prepared, zone, y0, y1, policy->vehicle.position_error);
        if (*left < 0) return false;
    }
    return true;
}

/* The decision refuses arguments that are out of range, so that the refusal is recorded. */
static bool check_invocation(const rt_invocation *one, const rt_prepared_policy *prepared, int64_t *compared) {
    const rt_policy *policy = prepared->policy;
    rt_list left = one->arguments;
    uint8_t cells[RT_MAX_CELLS];
    int64_t argument;
    if (!rt_within(one->skill, 0, (int64_t)policy->contract_count - 1) ||
        !rt_within(one->role, 0, (int64_t)policy->role_count - 1))
        return false;
    if (!rt_within(one->source, RT_SOURCE_AGENT, RT_SOURCE_REFLEX) || !rt_within(one->on_inadmissible, 0, 3) ||
        !rt_within(one->issued_at_us, 0, RT_MAX_VALUE))
        return false;
    if (!rt_tightens(&one->contract, &policy->contracts[one->skill]) || !rt_check_contract(&one->contract, prepared, cells))
        return false;
    if (left.count != rt_cells(&one->contract)) return false;
    while (rt_next_int(&left, &argument))
        if (!rt_within(argument, -RT_MAX_VALUE, RT_MAX_VALUE)) return false;
    return check_plan(&one->plan, &one->contract.motion, one->arguments, &policy->projection) &&
           few_compared(prepared, one->plan.path, compared) && leads_right(one, prepared);
}

static bool id_after(const void *of, uint16_t one, uint16_t other) {
    const rt_bytes *ids = of;
    return rt_compare(ids[one], ids[other]) > 0;
}

bool rt_check_mission(const rt_mission *mission, rt_prepared_policy *prepared) {
    const rt_policy *policy = prepared->policy;
    rt_scratch *scratch = &prepared->scratch;
    int64_t compared = RT_MAX_COMPARED;
    rt_invocation one;
    if (!rt_same(mission->policy, policy->name) || mission->policy_version != policy->version ||
        !rt_same(mission->vehicle, policy->vehicle.identity))
        return false;
    if (!is_name(mission->name) || !check_phases(mission)) return false;
    for (uint32_t step = 0; step < mission->invocation_count; step++) {
        rt_invocation_at(mission, step, &one);
        if (one.step != step || !rt_within(one.phase, 0, (int64_t)mission->phases.count - 1)) return false;
        if (one.phases < 0 || ((uint64_t)one.phases & ~phases_of(&one.contract, mission))) return false;
        if (!none_worded(prepared, one.contract.require) || !none_worded(prepared, one.contract.assume) ||
            !none_worded(prepared, one.contract.maintain))
            return false;
        if (!check_invocation(&one, prepared, &compared)) return false;
        scratch->ids[step] = one.invocation_id;
        scratch->order[step] = (uint16_t)step;
    }
    rt_sort(scratch->order, mission->invocation_count, id_after, scratch->ids);
    for (uint32_t at = 1; at < mission->invocation_count; at++)
        if (rt_same(scratch->ids[scratch->order[at]], scratch->ids[scratch->order[at - 1]])) return false;
    return true;
}
