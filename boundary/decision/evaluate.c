/* Conditions, evaluated over one situation from the postfix code that `tree.c` found well-formed. Everything is a point there, or
   missing, but for the height over a planned volume. So a number is `number + factor * height`, and what is subtracted from
   itself is 0, as in the sums of tree.py. By its bound on each sum nothing exceeds 2**62. */
#include "parts.h"

typedef struct {
    int64_t number, factor;
    rt_truth truth; /* of a truth value; of a number RT_UNKNOWN if a part of it is missing, else 0 */
} cell;

/* Whether left - right is at most `bound`, or, for RT_OP_EQ, is 0. */
static rt_truth compare(int64_t op, const cell *left, const cell *right, int64_t bound, const rt_environment *at) {
    if (left->truth || right->truth) return RT_UNKNOWN;
    int64_t low = left->number - right->number, high = low, factor = left->factor - right->factor;
    if (factor) {
        low += factor * (factor < 0 ? at->volume->high : at->volume->low);
        high += factor * (factor < 0 ? at->volume->low : at->volume->high);
    }
    if (op == RT_OP_EQ || op == RT_OP_NE) return low > 0 || high < 0 ? RT_FALSE : low == high ? RT_TRUE : RT_MIXED;
    return high <= bound ? RT_TRUE : low > bound ? RT_FALSE : RT_MIXED;
}

static cell signal(int64_t slot, const rt_environment *at) {
    if (at->ranging && slot == at->now->policy->policy->vehicle.height) return (cell){0, 1, at->volume->level ? 0 : RT_UNKNOWN};
    rt_value value = RT_AT(at->now->slots, slot);
    return (cell){value.value, 0, value.known ? 0 : RT_UNKNOWN};
}

static int64_t argument(int64_t number, const rt_environment *at) { return at->arguments[(uint64_t)number % RT_MAX_CELLS]; }

/* Conditions that read neither numbers nor other conditions. */
static rt_truth atom(int64_t op, int64_t a, int64_t b, const rt_environment *at) {
    const rt_situation *now = at->now;
    const rt_policy *policy = now->policy->policy;
    const rt_vehicle *vehicle = &policy->vehicle;
    int64_t utc = now->utc_us, zone;
    rt_value value;
    rt_list table;
    rt_truth truth;
    switch (op) {
    case RT_OP_SIGNAL_IN:
        value = RT_AT(now->slots, a);
        return !value.known ? RT_UNKNOWN : rt_holds(RT_AT(policy->sets, b), value.value) ? RT_TRUE : RT_FALSE;
    case RT_OP_ARGUMENT_IN:
        return rt_holds(RT_AT(policy->sets, b), argument(a, at)) ? RT_TRUE : RT_FALSE;
    case RT_OP_KNOWN:
        return RT_AT(now->slots, a).known ? RT_TRUE : RT_UNKNOWN;
    case RT_OP_POSITION_IN:
        return rt_zone_holds(now, (uint32_t)a, at->volume, at->through_us);
    case RT_OP_POSITION_IN_ARGUMENT:
        zone = argument(a, at);
        table = RT_AT(policy->tables, b);
        if (!rt_within(zone, 0, (int64_t)table.count - 1))
            return RT_UNKNOWN; /* an argument out of range does not name a zone */
        return rt_zone_holds(now, (uint32_t)rt_int_at(table, (uint32_t)zone), at->volume, at->through_us);
    case RT_OP_ARGUMENT_POINT_IN:
        truth = rt_zone_contains(now->policy, (uint32_t)b, argument(a, at), argument(a + 1, at)) ? RT_TRUE : RT_FALSE;
        if (!rt_zone_timed(&RT_AT(policy->zones, b))) return truth;
        return rt_and(truth, rt_zone_exists(vehicle, &RT_AT(policy->zones, b), utc, utc + at->through_us, now->error_us));
    case RT_OP_TIME_IN:
        return rt_time_of_day(vehicle, a, b, utc, utc, now->error_us);
    case RT_OP_WEEK_IN:
        return rt_time_of_week(vehicle, RT_AT(policy->sets, a), utc, utc, now->error_us);
    case RT_OP_PHASE_IN:
        return rt_holds(RT_AT(policy->sets, b), at->phase) ? RT_TRUE : RT_FALSE;
    default:
        return RT_AT(now->monitors, a);
    }
}

rt_truth rt_evaluate(rt_list code, const rt_environment *at) {
    cell stack[2 * RT_MAX_STACK] = {{0, 0, 0}};
    uint32_t top = 0; /* the last value; the stack is never empty here */
    int64_t op = 0, a = 0, b = 0;
    while (rt_next_int(&code, &op) && rt_next_int(&code, &a) && rt_next_int(&code, &b)) {
        top += (uint32_t)rt_pushes(op);
        cell *to = &RT_AT(stack, top), *right = &RT_AT(stack, top + 1); /* `right` if there are two operands */
        switch (op) {
        case RT_OP_CONST:
            *to = (cell){a, 0, 0};
            break;
        case RT_OP_SIGNAL:
            *to = signal(a, at);
            break;
        case RT_OP_ARGUMENT:
            *to = (cell){argument(a, at), 0, 0};
            break;
        case RT_OP_ADD:
        case RT_OP_SUB:
            to->number += op == RT_OP_ADD ? right->number : -right->number;
            to->factor += op == RT_OP_ADD ? right->factor : -right->factor;
            to->truth |= right->truth;
            break;
        case RT_OP_SCALE:
            to->number *= a;
            to->factor *= a;
            break;
        case RT_OP_LT:
        case RT_OP_LE:
        case RT_OP_EQ:
        case RT_OP_NE:
            to->truth = compare(op, to, right, op == RT_OP_LT ? -1 : 0, at);
            if (op == RT_OP_NE) to->truth = rt_not(to->truth);
            break;
        case RT_OP_GT:
        case RT_OP_GE:
            to->truth = compare(op, right, to, op == RT_OP_GT ? -1 : 0, at);
            break;
        case RT_OP_AND:
        case RT_OP_OR:
            to->truth = op == RT_OP_AND ? rt_and(to->truth, right->truth) : rt_or(to->truth, right->truth);
            break;
        case RT_OP_NOT:
            to->truth = rt_not(to->truth);
            break;
        default:
            to->truth = atom(op, a, b, at);
        }
    }
    return RT_AT(stack, top).truth;
}

rt_truth rt_matches(const rt_rule *rule, const rt_environment *at) {
    return rule->has_when ? rt_evaluate(rule->when.code, at) : RT_TRUE;
}
