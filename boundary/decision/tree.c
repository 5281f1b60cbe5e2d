/* Checks that postfix code is well-formed. The bundle's code is untrusted. Every number is a sum of state slots and argument cells
   times factors, plus a constant; terms of a merged sum may cancel, so the bound applies to the merged sum. By that bound all factors
   together are at most 2**62 / RT_MAX_VALUE = 512. */
#include "parts.h"

#define RT_MOST_FACTORS (RT_MAX_MAGNITUDE / RT_MAX_VALUE)

typedef struct {
    bool truth;
    int16_t factors[RT_MAX_SLOTS + RT_MAX_CELLS];
    int64_t constant;
} sum;

static bool bounded(const sum *of) {
    int64_t all = 0;
    for (size_t at = 0; at < sizeof of->factors / sizeof *of->factors; at++) all += rt_abs(of->factors[at]);
    return all <= RT_MOST_FACTORS && rt_abs(of->constant) + all * RT_MAX_VALUE <= RT_MAX_MAGNITUDE;
}

/* Whether one sum plus or minus (`sign`) another is bounded; the result replaces the first. Both are bounded, so a factor of the result
   is within 1,024. */
static bool add(sum *one, const sum *other, int sign) {
    int64_t constant = sign * other->constant;
    if (constant > 0 ? one->constant > RT_MAX_MAGNITUDE - constant : one->constant < -RT_MAX_MAGNITUDE - constant) return false;
    one->constant += constant;
    for (size_t at = 0; at < sizeof one->factors / sizeof *one->factors; at++)
        one->factors[at] = (int16_t)(one->factors[at] + sign * other->factors[at]);
    return bounded(one);
}

static bool scale(sum *of, int64_t factor) {
    if (!rt_within(factor, -RT_MAX_VALUE, RT_MAX_VALUE)) return false;
    int64_t most = rt_abs(factor);
    if (most && rt_abs(of->constant) > RT_MAX_MAGNITUDE / most) return false;
    of->constant *= factor;
    for (size_t at = 0; at < sizeof of->factors / sizeof *of->factors; at++) {
        if (of->factors[at] && most > RT_MOST_FACTORS) return false;
        int64_t scaled = of->factors[at] ? of->factors[at] * factor : 0;
        if (rt_abs(scaled) > RT_MOST_FACTORS) return false;
        of->factors[at] = (int16_t)scaled;
    }
    return bounded(of);
}

/* Whether the parameter at an argument cell is of one of two kinds in every skill, of which there is at least one. */
static bool argument(const rt_scope *scope, int64_t cell, uint8_t kind, uint8_t other) {
    rt_list left = scope->skills;
    int64_t skill;
    if (!rt_within(cell, 0, RT_MAX_CELLS - 1)) return false;
    if (scope->own) return scope->own[cell] == kind || scope->own[cell] == other;
    while (rt_next_int(&left, &skill)) {
        uint8_t found = scope->policy->cells[skill][cell];
        if (found != kind && found != other) return false;
    }
    return scope->skills.count > 0;
}

/* Windows of a week lie within it, one after the other. */
bool rt_windows_fit(rt_list windows) {
    int64_t before = -1, moment;
    if (windows.count == 0 || windows.count % 2) return false;
    while (rt_next_int(&windows, &moment)) {
        if (moment <= before) return false;
        before = moment;
    }
    return before <= RT_WEEK;
}

static bool phases(const rt_scope *scope, rt_list set) {
    int64_t member;
    while (rt_next_int(&set, &member))
        if (!rt_within(member, 0, (int64_t)scope->policy->policy->phase_count - 1)) return false;
    return scope->phased;
}

/* Code that reads neither numbers nor other conditions. */
static bool atom(int64_t op, int64_t a, int64_t b, const rt_scope *scope) {
    const rt_policy *policy = scope->policy->policy;
    bool slot = rt_within(a, 0, policy->slots - 1), set = rt_within(b, 0, (int64_t)policy->set_count - 1);
    switch (op) {
    case RT_OP_SIGNAL_IN:
        return slot && scope->policy->kinds[a] == RT_ENUMERATION && set;
    case RT_OP_ARGUMENT_IN:
        return argument(scope, a, RT_CHOICE, RT_ZONE) && set;
    case RT_OP_KNOWN:
        return slot && b == 0;
    case RT_OP_POSITION_IN:
        return rt_within(a, 0, (int64_t)policy->zone_count - 1) && b == 0;
    case RT_OP_POSITION_IN_ARGUMENT:
        return argument(scope, a, RT_ZONE, RT_ZONE) && rt_within(b, 0, (int64_t)policy->table_count - 1);
    case RT_OP_ARGUMENT_POINT_IN:
        return argument(scope, a, RT_PLACE, RT_PLACE) && rt_within(b, 0, (int64_t)policy->zone_count - 1);
    case RT_OP_TIME_IN:
        return rt_within(a, 0, RT_DAY - 1) && rt_within(b, 0, RT_DAY);
    case RT_OP_WEEK_IN:
        return rt_within(a, 0, (int64_t)policy->set_count - 1) && rt_windows_fit(policy->sets[a]) && b == 0;
    case RT_OP_PHASE_IN:
        return set && phases(scope, policy->sets[b]) && a == 0;
    case RT_OP_MONITOR:
        return rt_within(a, 0, (int64_t)scope->monitors - 1) && b == 0;
    default:
        return false;
    }
}

/* Execute one instruction; false if it is malformed. `top` is above the last value. */
static bool step(sum *stack, uint32_t *top, int64_t op, int64_t a, int64_t b, const rt_scope *scope) {
    const int pushes = rt_pushes(op);
    const bool truths = op >= RT_OP_AND;
    sum *made = &stack[*top];
    if (pushes < 1) {
        uint32_t count = pushes < 0 ? 2 : 1;
        if (*top < count || made[-1].truth != truths || (count == 2 && made[-2].truth != truths)) return false;
        *top -= count - 1;
        made = &stack[*top - 1];
    } else {
        memset(made, 0, sizeof *made);
        ++*top;
    }
    switch (op) {
    case RT_OP_CONST:
        made->constant = a;
        return rt_within(a, -RT_MAX_VALUE, RT_MAX_VALUE) && b == 0;
    case RT_OP_SIGNAL:
        if (!rt_within(a, 0, scope->policy->policy->slots - 1) || scope->policy->kinds[a] == RT_POSITION) return false;
        made->factors[a] = 1;
        return b == 0;
    case RT_OP_ARGUMENT:
        if (!argument(scope, a, RT_QUANTITY, RT_CHOICE)) return false;
        made->factors[RT_MAX_SLOTS + a] = 1;
        return b == 0;
    case RT_OP_ADD:
    case RT_OP_SUB:
        return a == 0 && b == 0 && add(made, made + 1, op == RT_OP_ADD ? 1 : -1);
    case RT_OP_SCALE:
        return b == 0 && scale(made, a);
    case RT_OP_LT:
    case RT_OP_LE:
    case RT_OP_GT:
    case RT_OP_GE:
    case RT_OP_EQ:
    case RT_OP_NE:
        made->truth = true;
        return a == 0 && b == 0 && add(made, made + 1, -1);
    case RT_OP_AND:
    case RT_OP_OR:
    case RT_OP_NOT:
        return a == 0 && b == 0;
    default:
        made->truth = true;
        return atom(op, a, b, scope);
    }
}

bool rt_code_fits(rt_list code, const rt_scope *scope) {
    sum stack[RT_MAX_STACK + 1];
    uint32_t top = 0;
    int64_t op, a, b;
    if (code.count == 0 || code.count % 3 || code.count > 3 * RT_MAX_INSTRUCTIONS) return false;
    while (rt_next_int(&code, &op) && rt_next_int(&code, &a) && rt_next_int(&code, &b))
        if (!step(stack, &top, op, a, b, scope) || top > RT_MAX_STACK) return false;
    return top == 1 && stack[0].truth;
}

void rt_read_where(const rt_vehicle *vehicle, rt_slots *slots) {
    if (vehicle->position != -1) {
        rt_add_slot(slots, vehicle->position);
        rt_add_slot(slots, vehicle->position + 1);
    }
    if (vehicle->height != -1) rt_add_slot(slots, vehicle->height);
}

/* Add the slots that well-formed code reads, directly or through temporal monitors, and whether it reads a monitor. */
void rt_read_code(const rt_prepared_policy *policy, rt_list code, rt_slots *slots, bool *monitored) {
    int64_t op, a, b;
    while (rt_next_int(&code, &op) && rt_next_int(&code, &a) && rt_next_int(&code, &b)) {
        if (op == RT_OP_SIGNAL || op == RT_OP_SIGNAL_IN || op == RT_OP_KNOWN) {
            rt_add_slot(slots, a);
        } else if (op == RT_OP_POSITION_IN || op == RT_OP_POSITION_IN_ARGUMENT) {
            rt_read_where(&policy->policy->vehicle, slots);
        } else if (op == RT_OP_MONITOR) {
            slots->bits[0] |= policy->monitor_reads[a].bits[0];
            slots->bits[1] |= policy->monitor_reads[a].bits[1];
            *monitored = true;
        }
    }
}
