/* The flat form (`rtshcua/model/flat`), field for field, as views into the bytes of a bundle. A list is read item by item:

       rt_list left = contract->require;
       rt_clause clause;
       while (rt_next_clause(&left, &clause)) ...

   `rt_next_*` take the first item off a list; false where none is left. They are for lists that `rt_read_policy` and
   `rt_read_mission` found well-formed (wire/flat.c); they check nothing again. */
#ifndef RT_MODEL_FLAT_H
#define RT_MODEL_FLAT_H

#include "../base.h"
#include "limits.h"

/* code.py */
enum {
    RT_OP_CONST = 1, RT_OP_SIGNAL = 2, RT_OP_ARGUMENT = 3, RT_OP_ADD = 5, RT_OP_SUB = 6, RT_OP_SCALE = 7,
    RT_OP_LT = 16, RT_OP_LE = 17, RT_OP_GT = 18, RT_OP_GE = 19, RT_OP_EQ = 20, RT_OP_NE = 21,
    RT_OP_SIGNAL_IN = 24, RT_OP_ARGUMENT_IN = 25, RT_OP_KNOWN = 26, RT_OP_POSITION_IN = 28,
    RT_OP_POSITION_IN_ARGUMENT = 29, RT_OP_ARGUMENT_POINT_IN = 30, RT_OP_TIME_IN = 32, RT_OP_WEEK_IN = 33,
    RT_OP_PHASE_IN = 34, RT_OP_MONITOR = 36, RT_OP_AND = 40, RT_OP_OR = 41, RT_OP_NOT = 42
};

typedef struct {
    rt_bytes text;
    int64_t source, start, end;
    rt_list code; /* integers */
} rt_clause;

/* zone.py */
enum { RT_CIRCLE = 0, RT_POLYGON = 1, RT_AREA = 2 };
#define RT_SHIFT 20
#define RT_TURN 3600000000LL
#define RT_HALF_TURN 1800000000LL
#define RT_MAX_COORDINATE (1LL << 29)
#define RT_LOWEST (-(1LL << 30))
#define RT_HIGHEST (1LL << 30)

typedef struct {
    int64_t latitude, longitude, east, north;
} rt_projection;

typedef struct {
    rt_bytes name;
    int64_t shape, floor, ceiling;
    rt_list data, daily, dates, weekly; /* integers */
} rt_zone;

/* contract.py */
enum { RT_SEMANTIC = 0, RT_TACTICAL = 1, RT_REFLEX = 2 };
enum { RT_SOURCE_AGENT = 0, RT_SOURCE_OPERATOR = 1, RT_SOURCE_ONBOARD = 2, RT_SOURCE_REFLEX = 3 };
enum { RT_HOLD = 0, RT_CLIMB = 1, RT_FLY = 2, RT_COVER = 3, RT_HOME = 4, RT_LAND = 5 };
enum { RT_QUANTITY = 0, RT_CHOICE = 1, RT_ZONE = 2, RT_PLACE = 3 };

typedef struct {
    rt_bytes name;
    int64_t kind;
    rt_bytes dimension;
    int64_t cell, low, high;
    rt_list labels; /* texts */
} rt_parameter;

typedef struct {
    int64_t skill;
    rt_list arguments; /* integers */
    int64_t limit_us;
    rt_bytes text;
    int64_t source, start, end;
} rt_link;

enum { RT_ALONG_LEGS = 0, RT_INWARD = 1 };

typedef struct {
    int64_t kind, altitude, speed, time, lowest, facing;
} rt_motion;

/* Commands to payload. The addressee of RT_AUTOPILOT is `VEHICLE` in Python. */
enum { RT_AUTOPILOT = 0, RT_CAMERA = 1, RT_GIMBAL = 2 };
enum { RT_AT_BEGIN = 0, RT_AT_END = 1, RT_AT_TURN = 2, RT_AT_WAYPOINT = 3, RT_BY_DISTANCE = 4, RT_BY_TIME = 5 };
enum { RT_BY_ACKNOWLEDGEMENT = 0, RT_BY_IMAGE = 1, RT_BY_ATTITUDE = 2, RT_BY_ALL_IMAGES = 3 };
enum { RT_CONSTANT = 0, RT_OF_ARGUMENT = 1, RT_LATITUDE = 2, RT_LONGITUDE = 3, RT_HEIGHT = 4 };

typedef struct {
    int64_t origin, cell, value;
} rt_emission_parameter;

typedef struct {
    int64_t command, addressee;
    rt_list parameters; /* rt_emission_parameter */
    int64_t moment, amount, success, bound, within_us, required;
} rt_emission;

typedef struct {
    rt_bytes name;
    rt_list parameters; /* rt_parameter */
    rt_motion motion;
    int64_t timing_class, deadline_us, validity_us;
    rt_list phases; /* texts */
    int64_t duration_us, grace_us;
    rt_list require, assume, maintain; /* rt_clause */
    rt_list fallback; /* rt_link */
    int64_t energy;
    rt_list record; /* texts */
    rt_list reads; /* integers */
    rt_list emits; /* rt_emission */
} rt_contract;

/* signal.py */
enum { RT_NUMBER = 0, RT_ENUMERATION = 1, RT_POSITION = 2 };

/* The fields of a source that `decision/checks` reads; its message, sentinels and `where` are for the runtime. */
typedef struct {
    rt_list fields; /* texts */
    int64_t numerator, denominator;
} rt_signal_source;

typedef struct {
    rt_bytes name;
    int64_t slot, kind;
    rt_bytes dimension;
    int64_t stale_us;
    rt_list labels; /* pairs of integer and text */
    rt_list sources; /* rt_signal_source */
} rt_signal;

/* policy.py */
enum { RT_FORBID = 0, RT_PERMIT = 1, RT_CONFIRM = 2, RT_DEGRADE = 3 };
enum { RT_FOR_LAST = 0, RT_WITHIN_LAST = 1, RT_RISING = 2, RT_FALLING = 3 };

typedef struct {
    int64_t kind;
    rt_list skills, roles, sources; /* integers */
    bool has_when;
    rt_clause when;
    int64_t approver, within_us;
    bool has_target;
    rt_link target;
    rt_bytes text;
    int64_t source, start, end, second;
} rt_rule;

typedef struct {
    int64_t kind, window_us;
    rt_clause when;
} rt_monitor;

typedef struct {
    rt_list inside, outside; /* integers */
    rt_bytes text;
    int64_t source, start, end;
} rt_airspace;

typedef struct {
    int64_t cruise, climb, descent, landing, landing_below, homeward, acceleration, air, wind, flight_us;
} rt_speeds;

typedef struct {
    rt_bytes name, identity;
    int64_t home_within, speed, climb, position_error, endurance_us, reserve, utc_offset_us;
    int64_t position, height, battery; /* slots, -1: none */
    int64_t return_altitude, braking, reaction_us;
    int64_t north, east, down; /* slots */
    int64_t drain;             /* the slot of the signal of that name, -1: none; not a field of the artefact */
    rt_list without; /* texts */
    bool has_speeds;
    rt_speeds speeds;
    rt_bytes time_zone, time_zone_data;
    rt_list offsets; /* integers */
    rt_list servos;  /* likewise */
} rt_vehicle;

/* The fields of a left-out clause that `decision/checks` reads. */
typedef struct {
    int64_t skill;
    rt_bytes part;
} rt_left_out;

/* `rt_read_policy` fills the tables once; a count beyond its limit is refused as `malformed`, as by `decision/checks` in Python. */
typedef struct {
    rt_bytes payload; /* the artefact, as it was signed */
    rt_bytes name;
    int64_t version;
    rt_vehicle vehicle;
    rt_projection projection;
    rt_bytes roles[RT_MAX_ROLES];
    uint32_t role_count;
    rt_signal signals[RT_MAX_SLOTS];
    uint32_t signal_count;
    int64_t slots;
    rt_zone zones[RT_MAX_ZONES];
    uint32_t zone_count;
    int64_t declared;
    rt_list tables[RT_MAX_TABLES]; /* integers */
    uint32_t table_count;
    rt_list sets[RT_MAX_SETS]; /* integers */
    uint32_t set_count;
    rt_contract contracts[RT_MAX_CONTRACTS];
    uint32_t contract_count;
    rt_rule rules[RT_MAX_RULES];
    uint32_t rule_count;
    bool has_airspace;
    rt_airspace airspace;
    rt_link contingency[RT_MAX_LINKS];
    uint32_t contingency_count;
    rt_list sources, source_digests; /* texts; bytes */
    rt_monitor monitors[RT_MAX_MONITORS];
    uint32_t monitor_count;
    rt_bytes phases[RT_MAX_PHASE_NAMES];
    uint32_t phase_count;
    int64_t without_evidence, silence_us, after_silence;
    rt_list left_out; /* rt_left_out */
} rt_policy;

/* mission.py */
#define RT_ALONG (-1)
#define RT_FULL_TURN 36000

typedef struct {
    int64_t kind;
    rt_list path; /* integers */
    int64_t altitude, speed;
    rt_list heights, headings; /* integers, one for each point, or empty */
} rt_plan;

typedef struct {
    rt_bytes raw;     /* the whole invocation as it was signed, */
    rt_bytes content; /* and its part between the id and the binding */
    rt_bytes invocation_id;
    int64_t step, phase, skill, source, role;
    rt_list arguments; /* integers */
    int64_t issued_at_us, phases, on_inadmissible;
    rt_contract contract;
    rt_plan plan;
    rt_bytes text;
    int64_t file, start, end;
    rt_bytes binding;
} rt_invocation;

typedef struct {
    rt_bytes payload;
    rt_bytes before, behind; /* the parts of the mission before and after its invocations */
    rt_bytes name, intent, proposer, vehicle, policy;
    int64_t policy_version;
    rt_bytes policy_digest;
    int64_t issued_at_us;
    rt_list phases; /* texts */
    rt_bytes invocations[RT_MAX_INVOCATIONS]; /* each as it was signed: `rt_invocation_at` reads it */
    uint32_t invocation_count;
    rt_list sources, source_digests;
} rt_mission;

/* wire/flat.c: read a verified payload. They return `malformed` (or `unknown-format`, `unknown-version`) for everything that
   `artefact.unpack` refuses. */
rt_refusal rt_read_policy(rt_bytes payload, rt_policy *policy);
rt_refusal rt_read_mission(rt_bytes payload, rt_mission *mission);

void rt_read_invocation(rt_bytes raw, rt_invocation *invocation);
void rt_invocation_at(const rt_mission *mission, uint32_t step, rt_invocation *invocation);

/* Take the first item off a list. */
bool rt_next_int(rt_list *list, int64_t *value);
bool rt_next_text(rt_list *list, rt_bytes *text); /* byte strings too */
bool rt_next_clause(rt_list *list, rt_clause *clause);
bool rt_next_link(rt_list *list, rt_link *link);
bool rt_next_parameter(rt_list *list, rt_parameter *parameter);
bool rt_next_source(rt_list *list, rt_signal_source *source);
bool rt_next_left_out(rt_list *list, rt_left_out *left_out);
bool rt_next_emission(rt_list *list, rt_emission *emission);
bool rt_next_emission_parameter(rt_list *list, rt_emission_parameter *parameter);

/* The integer at an index, by a walk through the list, for short lists. -1 is never returned: the index is below `count`. */
int64_t rt_int_at(rt_list list, uint32_t index);
bool rt_holds(rt_list list, int64_t value); /* whether it is among the integers */
bool rt_names(rt_list texts, rt_bytes text); /* likewise */

/* situation.py */
typedef struct {
    int64_t values[RT_MAX_SLOTS];
    bool known[RT_MAX_SLOTS];
    int64_t ages[RT_MAX_SLOTS];
    uint8_t monitors[RT_MAX_MONITORS];
    uint32_t slots, monitor_count;
} rt_state;

typedef struct {
    int64_t monotonic_us, utc_us, utc_error_us;
} rt_now;

/* An answer to one rule, or to each rule that requires its role (Python has an entry for each, up to 16,384 of them). */
#define RT_EVERY_RULE (-1)
typedef struct {
    int64_t rule, role, granted, monotonic_us, person;
} rt_approval;

typedef struct {
    rt_bytes binding, vehicle;
    int64_t policy_version, consumed, released_us, phase, remaining_us;
    const rt_approval *approvals;
    uint32_t approval_count;
} rt_context;

/* model/decision.py. `clause` is numbered as `wire/response.py` numbers it: rules, the airspace, then the contract's own; RT_NO_CLAUSE.
   `target` is a link's number, RT_DEGRADE with `rule` for a degrade rule's target, RT_NO_TARGET. */
#define RT_NO_CLAUSE (-1)
#define RT_DEGRADE_LINK (-1)
#define RT_NO_TARGET (-(1 << 15) - 1)
enum { RT_ALLOW = 0, RT_DENY = 1, RT_DEFER = 2, RT_FALLBACK = 3 };

typedef struct {
    int64_t outcome, reason; /* numbers of model/outcome.py: outcome.h is generated */
    int64_t step;
    int64_t clause;
    int64_t target; /* RT_NO_TARGET, a link's number, or -1 - rule */
    int64_t valid_until_us;
} rt_decision;

/* decision/values.py */
enum { RT_TRUE = 1, RT_FALSE = 2, RT_UNKNOWN = 4 };

#endif
