/* The interfaces between the files of this folder; each group belongs to one Python module. */
#ifndef RT_DECISION_PARTS_H
#define RT_DECISION_PARTS_H

#include "decide.h"

#define RT_NO_KIND 255
#define RT_SECOND 1000000LL

/* values.py: an abstract truth is a mask of RT_TRUE, RT_FALSE, RT_UNKNOWN, never empty */
typedef unsigned rt_truth;
#define RT_MIXED (RT_TRUE | RT_FALSE)

static inline rt_truth rt_and(rt_truth a, rt_truth b) {
    rt_truth unknown = ((a & RT_UNKNOWN) && (b & (RT_TRUE | RT_UNKNOWN))) || ((b & RT_UNKNOWN) && (a & (RT_TRUE | RT_UNKNOWN)));
    return ((a | b) & RT_FALSE) | (a & b & RT_TRUE) | (unknown ? RT_UNKNOWN : 0);
}
static inline rt_truth rt_not(rt_truth a) { return (a & RT_UNKNOWN) | (a & RT_TRUE) << 1 | (a & RT_FALSE) >> 1; }
static inline rt_truth rt_or(rt_truth a, rt_truth b) { return rt_not(rt_and(rt_not(a), rt_not(b))); }
static inline rt_truth rt_everywhere(rt_truth a) { return a & RT_FALSE ? RT_FALSE : a & RT_UNKNOWN ? RT_UNKNOWN : a; }

typedef struct {
    int64_t value; /* 0 if it is missing */
    bool known;
} rt_value;

/* situation.py: one situation; missing, stale and out-of-range values are unknown */
typedef struct {
    const rt_prepared_policy *policy;
    rt_value slots[RT_MAX_SLOTS];
    uint8_t monitors[RT_MAX_MONITORS];
    int64_t monotonic_us, utc_us, error_us;
} rt_situation;

void rt_situate(const rt_prepared_policy *policy, const rt_state *state, const rt_now *now, rt_situation *situation);
/* The value of a slot; -1 means a slot without a signal. */
rt_value rt_slot(const rt_situation *situation, int64_t slot);

/* volume.py: from a place, along the first leg to the planner's path and along it, all widened by the position error */
typedef struct {
    const rt_planner *planner; /* NULL: only the present place */
    int64_t x, y, error;
    bool located, level; /* whether its start and its height are known */
    bool climbs; /* the start, before the leg: heights start_low..high */
    int64_t start_low, leg_low, leg_high, low, high; /* heights on the leg: leg_low..leg_high; on the path, and in all: low..high */
} rt_volume;

void rt_plan_link(const rt_policy *policy, const rt_link *link, rt_planner *planner);
void rt_plan_step(const rt_policy *policy, const rt_invocation *invocation, rt_planner *planner);
rt_volume rt_here(const rt_situation *situation);
/* `planner` is NULL for a skill without motion */
rt_volume rt_plan_volume(const rt_situation *situation, const rt_planner *planner);
/* The distance of the farthest place from home, mm rounded up, without the position error; for a volume with a known place. */
int64_t rt_farthest(const rt_volume *volume);

/* flying.py, contracts.py */
uint32_t rt_root(uint64_t square); /* rounded down */
static inline int64_t rt_root_up(int64_t square) { return square > 0 ? (int64_t)rt_root((uint64_t)square - 1) + 1 : 0; }
/* Whether a charge is enough for the way home from this distance and between two heights, rounded up, with the declared and with the
   measured drain per minute (0: not measured). */
bool rt_brings_home(const rt_vehicle *vehicle, int64_t charge, int64_t distance, int64_t low, int64_t high, int64_t asked,
                    int64_t drain);
uint32_t rt_cells(const rt_contract *contract);
bool rt_fits(rt_list arguments, const rt_contract *contract);
int64_t rt_first_cell(const rt_contract *contract, int64_t kind); /* -1: none */
int64_t rt_longest(const rt_contract *contract, const rt_vehicle *vehicle, int64_t limit_us);
rt_truth rt_charge_suffices(const rt_contract *contract, const rt_vehicle *vehicle, int64_t asked, rt_value battery,
                            rt_value drain, const rt_volume *volume);

/* outline.py, zones.py */
void rt_prepare_zone(rt_prepared_policy *prepared, uint32_t zone, uint32_t *entries, uint32_t *starts);
bool rt_zone_contains(const rt_prepared_policy *policy, uint32_t zone, int64_t x, int64_t y);
/* Whether a leg, widened by an error on all sides, is completely inside or completely outside, by a margin of at most 3 mm. */
bool rt_zone_clear(const rt_prepared_policy *policy, uint32_t zone, int64_t x0, int64_t y0, int64_t x1, int64_t y1,
                   int64_t error);
/* The greatest number of edges that are compared with a leg between these heights. */
uint32_t rt_zone_compared(const rt_prepared_policy *policy, uint32_t zone, int64_t y0, int64_t y1, int64_t error);
/* Whether the places along a path are inside a zone at any height; there is at least one place. */
rt_truth rt_zone_along(const rt_prepared_policy *policy, uint32_t zone, rt_list path, int64_t error);
/* Whether a volume is inside a zone, at some moment from now to `through_us` from now. */
rt_truth rt_zone_holds(const rt_situation *situation, uint32_t zone, const rt_volume *volume, int64_t through_us);

/* Whether a volume is in the airspace, if there is one. */
rt_truth rt_airspace_keeps(const rt_situation *situation, const rt_volume *volume, int64_t through_us);

/* times.py: over the moments low..high of UTC */
rt_truth rt_time_of_day(const rt_vehicle *vehicle, int64_t start, int64_t end, int64_t low, int64_t high, int64_t error);
rt_truth rt_time_of_week(const rt_vehicle *vehicle, rt_list windows, int64_t low, int64_t high, int64_t error);
bool rt_zone_timed(const rt_zone *zone);
rt_truth rt_zone_exists(const rt_vehicle *vehicle, const rt_zone *zone, int64_t low, int64_t high, int64_t error);

/* evaluate.py */
typedef struct {
    const rt_situation *now;
    const int64_t *arguments;
    int64_t phase;
    const rt_volume *volume; /* where position (and with `ranging`, height) may be */
    bool ranging;
    int64_t through_us; /* zones are evaluated at all moments until then */
} rt_environment;

/* The change of the stack's size by an instruction. */
static inline int rt_pushes(int64_t op) {
    if (op == RT_OP_SCALE || op == RT_OP_NOT) return 0;
    return (op >= RT_OP_ADD && op <= RT_OP_NE) || op == RT_OP_AND || op == RT_OP_OR ? -1 : 1;
}
rt_truth rt_evaluate(rt_list code, const rt_environment *at);
rt_truth rt_matches(const rt_rule *rule, const rt_environment *at);

/* decide.py */
typedef struct {
    rt_prepared_invocation *invocation;
    const rt_policy *policy;
    const rt_context *context;
    const rt_state *state;
    rt_situation now;
    rt_volume here;
    rt_environment at;
    int64_t released_us; /* moved by an approval */
} rt_case;

/* The decision for this reason, with its clause (RT_NO_CLAUSE); returns false, for use as a step's result */
bool rt_found(rt_decision *decision, int64_t reason, int64_t clause);
/* The number of a deciding rule: of equal rules, the last. */
int64_t rt_rule_number(const rt_prepared_invocation *invocation, uint32_t rule);
int64_t rt_degrade_number(const rt_prepared_invocation *invocation, uint32_t rule);
bool rt_same_clause(const rt_clause *one, const rt_clause *other);
/* `context` is NULL for decisions about links only */
void rt_begin_case(rt_prepared_invocation *invocation, const rt_state *state, const rt_context *context, const rt_now *now,
                   rt_case *one);

/* links.py */
int64_t rt_fallback(const rt_case *one); /* a target, as in rt_decision */

/* tree.py */
typedef struct {
    const rt_prepared_policy *policy;
    rt_list skills; /* code may name arguments that all of these have */
    const uint8_t *own; /* instead of `skills`: the kind of each cell of one contract */
    uint32_t monitors;
    bool phased;
} rt_scope;

bool rt_code_fits(rt_list code, const rt_scope *scope);
bool rt_windows_fit(rt_list windows);
void rt_read_code(const rt_prepared_policy *policy, rt_list code, rt_slots *slots, bool *monitored);
void rt_read_where(const rt_vehicle *vehicle, rt_slots *slots);
static inline bool rt_reads(const rt_slots *slots, int64_t slot) { return slots->bits[slot >> 6] >> (slot & 63) & 1; }
static inline void rt_add_slot(rt_slots *slots, int64_t slot) { slots->bits[slot >> 6] |= (uint64_t)1 << (slot & 63); }

/* checks: true if there is no problem */
bool rt_check_signals(const rt_policy *policy);
bool rt_check_policy(const rt_policy *policy, rt_prepared_policy *prepared);
bool rt_check_zones(const rt_policy *policy, rt_prepared_policy *prepared);
bool rt_check_place(const rt_projection *projection, int64_t x, int64_t y);
bool rt_check_contract(const rt_contract *contract, const rt_prepared_policy *policy, uint8_t cells[RT_MAX_CELLS]);
/* The commands to payload that a contract emits, its cells' kinds being known; the servo outputs that a vehicle declares free. */
bool rt_check_emissions(const rt_contract *contract, const rt_vehicle *vehicle, const uint8_t cells[RT_MAX_CELLS]);
bool rt_check_servos(const rt_vehicle *vehicle);
bool rt_may_be_emitted(int64_t command, int64_t addressee);
bool rt_check_chain(rt_list links, const rt_policy *policy);
bool rt_check_link(const rt_link *link, const rt_policy *policy);
bool rt_tightens(const rt_contract *mine, const rt_contract *policys);
int rt_compare_words(rt_bytes one, rt_bytes other); /* compared as words separated by single spaces: negative, 0 or positive */
bool rt_check_mission(const rt_mission *mission, rt_prepared_policy *policy);
/* Heap sort of numbers; `after` compares two of them. */
void rt_sort(uint16_t *numbers, uint32_t count, bool (*after)(const void *of, uint16_t one, uint16_t other), const void *of);

#endif
