/* What the decision is asked from outside of this folder (session, enforcement).

   Once a policy and a mission were verified and read:

       rt_prepare(&policy, &prepared)                     as prepare.py: what is malformed is refused, tables are filled
       rt_prepare_mission(&mission, &prepared)            likewise; every step is looked at
       rt_prepare_invocation(&mission, step, &prepared, &invocation)     when a step becomes one that may be asked for

   and then, any number of times, rt_decide and the questions about links. They write nothing but their answer and, in the
   prepared invocation, what is remembered to be quick: no answer depends on it. The views stay valid as long as the payloads
   of policy and mission stay where they are; a replacement needs another rt_mission, not another rt_prepared_policy.

   The times of rt_now and rt_context, and the values of rt_state, are within RT_MAX_VALUE of 0: wire/request refuses others. */
#ifndef RT_DECISION_DECIDE_H
#define RT_DECISION_DECIDE_H

#include "../model/flat.h"
#include "../model/outcome.h"

typedef struct {
    uint64_t bits[2];
} rt_slots; /* a set of state slots */

/* An edge of a zone, of corners within RT_MAX_COORDINATE. */
typedef struct {
    int32_t x0, y0, x1, y1;
} rt_edge;

/* The edges of a zone, by horizontal bands (outline.py, `Bands`). A circle has no edges. */
typedef struct {
    uint32_t first, count; /* in `edges` */
    uint32_t bands, starts; /* their number, and the index of their first entries in `starts` */
    int64_t south, height; /* the lowest band, and the height of each */
    int64_t x, y, square, radius; /* of a circle; the radius is rounded up */
} rt_prepared_zone;

#define RT_REPEATS 4 /* entries of the bands for each edge */
#define RT_MAX_ENTRIES (RT_REPEATS * RT_MAX_TOTAL_VERTICES)
/* A zone with n > 16 edges has at most isqrt(n) <= n / 4 bands, any other has one; each zone has one start more than bands. */
#define RT_MAX_STARTS (RT_MAX_TOTAL_VERTICES / 4 + 2 * RT_MAX_ZONES)

/* Working memory for loading. */
typedef struct {
    uint16_t order[RT_MAX_TOTAL_VERTICES], before[RT_MAX_TOTAL_VERTICES], crossed[RT_MAX_TOTAL_VERTICES],
        moved[RT_MAX_TOTAL_VERTICES];
    rt_bytes ids[RT_MAX_INVOCATIONS];
} rt_scratch;

typedef struct {
    const rt_policy *policy;
    int64_t stale_us[RT_MAX_SLOTS], most[RT_MAX_SLOTS]; /* the limits of a slot */
    uint8_t kinds[RT_MAX_SLOTS];
    uint8_t cells[RT_MAX_CONTRACTS][RT_MAX_CELLS]; /* the parameter kind at each first cell, RT_NO_KIND elsewhere */
    rt_slots monitor_reads[RT_MAX_MONITORS]; /* the slots that a monitor reads, directly or through earlier ones */
    rt_prepared_zone zones[RT_MAX_ZONES];
    rt_edge edges[RT_MAX_TOTAL_VERTICES];
    uint16_t entries[RT_MAX_ENTRIES]; /* edges of a band, counted from the first of their zone */
    uint32_t starts[RT_MAX_STARTS];
    uint16_t by_words[RT_MAX_RULES]; /* the rules, in the order of their texts */
    rt_scratch scratch;
} rt_prepared_policy;

/* Where a skill flies (volume.py): along a path of points, at an altitude if it has one, or at the height of each point. */
typedef struct {
    int64_t kind, altitude;
    bool has_altitude;
    uint32_t points;
    int64_t x, y; /* the first point */
    rt_list path; /* all of them, where there are more than one, or they have heights */
    rt_list heights; /* of each point; empty if all are at the altitude */
    int64_t first, low, high; /* the first, the least and the greatest of them, or the altitude */
    int64_t farthest; /* the greatest square of a distance from home on it */
    uint8_t *along; /* cached results of the path, with its heights if it has them, by zone: 0 if there is none; NULL without a cache */
} rt_planner;

typedef struct {
    rt_invocation invocation;
    const rt_prepared_policy *policy;
    int64_t arguments[RT_MAX_CELLS];
    bool misfit; /* an argument is out of its range */
    uint16_t rules[RT_MAX_RULES]; /* the candidates of all kinds, in the order of the policy */
    uint32_t rule_count;
    rt_planner planner;
    uint8_t along[RT_MAX_ZONES];
    rt_slots reads; /* the slots that a decision may read */
    int64_t phase; /* its number among the policy's phase names, RT_NO_PHASE */
    int64_t rests_us, lasts_us;
    int64_t asked; /* the slowest speed that this step and earlier ones request, mm/s; 0 if none does */
} rt_prepared_invocation;

#define RT_NO_PHASE (-1)
#define RT_START (-2) /* no link was tried yet */

/* prepare.c: `malformed`, or NULL */
rt_refusal rt_prepare(const rt_policy *policy, rt_prepared_policy *prepared);
rt_refusal rt_prepare_mission(const rt_mission *mission, rt_prepared_policy *policy);
/* Only for a mission that rt_prepare_mission accepted. */
void rt_prepare_invocation(const rt_mission *mission, uint32_t step, const rt_prepared_policy *policy,
                           rt_prepared_invocation *invocation);

/* decide.c */
void rt_decide(rt_prepared_invocation *invocation, const rt_state *state, const rt_context *context, const rt_now *now,
               rt_decision *decision);

/* fallbacks.c. The target of a matching `degrade` rule: `-1 - rule`, or RT_NO_TARGET. (session.py: a link DEGRADE is requested; the
   link that flies is `policy->rules[rule].target`.) */
int64_t rt_choose_degrade(rt_prepared_invocation *invocation, const rt_state *state, const rt_now *now);
/* Whether a link of a chain may fly now; `phase` is that of the invocation whose chain it is, RT_NO_PHASE for the contingency. */
bool rt_link_admissible(const rt_link *link, const rt_prepared_policy *policy, const rt_state *state, const rt_now *now,
                        int64_t phase);

#endif
