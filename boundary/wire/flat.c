#include "flat.h"

#include "artefact.h"

#define INT(field) rt_take_int(cursor, &(field))
#define TEXT(field) rt_take_text(cursor, &(field))
#define OCTETS(field) rt_take_octets(cursor, &(field))
#define STRUCT(fields) rt_take_struct(cursor, fields)

/* A list of items, each of which `take` accepts. */
#define LIST(name, type, take)                                                        \
    bool name(rt_cursor *cursor, rt_list *list) {                                     \
        if (!rt_take_array(cursor, &list->count)) return false;                       \
        list->at = cursor->at;                                                        \
        type item;                                                                    \
        for (uint32_t i = 0; i < list->count; i++)                                    \
            if (!take(cursor, &item)) return false;                                   \
        list->end = cursor->at;                                                       \
        return true;                                                                  \
    }

/* A table with a limit. */
#define TABLE(name, type, most, take)                                                 \
    static bool name(rt_cursor *cursor, type table[most], uint32_t *count) {          \
        if (!rt_take_array(cursor, count) || *count > (most)) return false;           \
        for (uint32_t i = 0; i < *count; i++)                                         \
            if (!take(cursor, &table[i])) return false;                               \
        return true;                                                                  \
    }

/* The first item of a list, which was found well-formed. */
#define NEXT(name, type, take)                                                        \
    bool name(rt_list *list, type *item) {                                            \
        rt_cursor cursor = {list->at, list->end};                                     \
        if (list->count == 0 || !take(&cursor, item)) return false;                   \
        list->count--;                                                                \
        list->at = cursor.at;                                                         \
        return true;                                                                  \
    }

LIST(rt_take_ints, int64_t, rt_take_int)
LIST(rt_take_texts, rt_bytes, rt_take_text)
LIST(rt_take_octet_strings, rt_bytes, rt_take_octets)

static bool clause(rt_cursor *cursor, rt_clause *into) {
    return STRUCT(5) && TEXT(into->text) && INT(into->source) && INT(into->start) && INT(into->end) && rt_take_ints(cursor, &into->code);
}

static bool link(rt_cursor *cursor, rt_link *into) {
    return STRUCT(7) && INT(into->skill) && rt_take_ints(cursor, &into->arguments) && INT(into->limit_us) && TEXT(into->text) &&
           INT(into->source) && INT(into->start) && INT(into->end);
}

static bool parameter(rt_cursor *cursor, rt_parameter *into) {
    return STRUCT(7) && TEXT(into->name) && INT(into->kind) && TEXT(into->dimension) && INT(into->cell) && INT(into->low) &&
           INT(into->high) && rt_take_texts(cursor, &into->labels);
}

static bool emission_parameter(rt_cursor *cursor, rt_emission_parameter *into) {
    return STRUCT(3) && INT(into->origin) && INT(into->cell) && INT(into->value);
}

static LIST(emission_parameters, rt_emission_parameter, emission_parameter)

static bool emission(rt_cursor *cursor, rt_emission *into) {
    rt_bytes text;
    return STRUCT(10) && INT(into->command) && INT(into->addressee) && emission_parameters(cursor, &into->parameters) &&
           INT(into->moment) && INT(into->amount) && INT(into->success) && INT(into->bound) && INT(into->within_us) &&
           INT(into->required) && TEXT(text);
}

static LIST(emissions, rt_emission, emission)
static LIST(clauses, rt_clause, clause)
static LIST(links, rt_link, link)
static LIST(parameters, rt_parameter, parameter)

/* Fields that have their defaults are left out at the end, and only there: `builtins_of`. */
static bool motion(rt_cursor *cursor, rt_motion *into) {
    uint32_t fields;
    if (!rt_take_extended(cursor, 4, 6, &fields) || !INT(into->kind) || !INT(into->altitude) || !INT(into->speed) || !INT(into->time))
        return false;
    into->lowest = -1;
    into->facing = RT_ALONG_LEGS;
    if (fields > 4 && !INT(into->lowest)) return false;
    if (fields > 5 && !INT(into->facing)) return false;
    return fields == 4 || (fields == 5 ? into->lowest != -1 : into->facing != RT_ALONG_LEGS);
}

static bool plan(rt_cursor *cursor, rt_plan *into) {
    uint32_t fields;
    if (!rt_take_extended(cursor, 4, 6, &fields) || !INT(into->kind) || !rt_take_ints(cursor, &into->path) || !INT(into->altitude) ||
        !INT(into->speed))
        return false;
    into->heights = into->headings = (rt_list){cursor->at, cursor->at, 0};
    if (fields > 4 && !rt_take_ints(cursor, &into->heights)) return false;
    if (fields > 5 && !rt_take_ints(cursor, &into->headings)) return false;
    return fields == 4 || (fields == 5 ? into->heights.count : into->headings.count) > 0;
}

static bool contract(rt_cursor *cursor, rt_contract *into) {
    uint32_t fields;
    if (!rt_take_extended(cursor, 16, 17, &fields) || !TEXT(into->name) || !parameters(cursor, &into->parameters) ||
        !motion(cursor, &into->motion) || !INT(into->timing_class) || !INT(into->deadline_us) || !INT(into->validity_us) ||
        !rt_take_texts(cursor, &into->phases) || !INT(into->duration_us) || !INT(into->grace_us) || !clauses(cursor, &into->require) ||
        !clauses(cursor, &into->assume) || !clauses(cursor, &into->maintain) || !links(cursor, &into->fallback) ||
        !INT(into->energy) || !rt_take_texts(cursor, &into->record) || !rt_take_ints(cursor, &into->reads))
        return false;
    into->emits = (rt_list){cursor->at, cursor->at, 0};
    return fields == 16 || (emissions(cursor, &into->emits) && into->emits.count > 0);
}

typedef struct {
    int64_t number;
    rt_bytes text;
    rt_list list;
} ignored; /* only the shape is checked here */

static bool label(rt_cursor *cursor, ignored *into) { return STRUCT(2) && INT(into->number) && TEXT(into->text); }

static bool condition(rt_cursor *cursor, ignored *into) { return STRUCT(2) && TEXT(into->text) && INT(into->number); }

static LIST(labels, ignored, label)
static LIST(conditions, ignored, condition)

static bool signal_source(rt_cursor *cursor, rt_signal_source *into) {
    ignored other;
    return STRUCT(6) && TEXT(other.text) && rt_take_texts(cursor, &into->fields) && INT(into->numerator) && INT(into->denominator) &&
           rt_take_ints(cursor, &other.list) && conditions(cursor, &other.list);
}

static bool omission(rt_cursor *cursor, rt_left_out *into) {
    ignored other;
    return STRUCT(6) && INT(into->skill) && TEXT(into->part) && TEXT(other.text) && INT(other.number) && INT(other.number) && INT(other.number);
}

static LIST(signal_sources, rt_signal_source, signal_source)
static LIST(omissions, rt_left_out, omission)

static bool signal(rt_cursor *cursor, rt_signal *into) {
    return STRUCT(7) && TEXT(into->name) && INT(into->slot) && INT(into->kind) && TEXT(into->dimension) && INT(into->stale_us) &&
           labels(cursor, &into->labels) && signal_sources(cursor, &into->sources);
}

static bool zone(rt_cursor *cursor, rt_zone *into) {
    return STRUCT(8) && TEXT(into->name) && INT(into->shape) && INT(into->floor) && INT(into->ceiling) && rt_take_ints(cursor, &into->data) &&
           rt_take_ints(cursor, &into->daily) && rt_take_ints(cursor, &into->dates) && rt_take_ints(cursor, &into->weekly);
}

static bool rule(rt_cursor *cursor, rt_rule *into) {
    if (!STRUCT(13) || !INT(into->kind) || !rt_take_ints(cursor, &into->skills) || !rt_take_ints(cursor, &into->roles) ||
        !rt_take_ints(cursor, &into->sources))
        return false;
    into->has_when = !rt_take_null(cursor);
    if ((into->has_when && !clause(cursor, &into->when)) || !INT(into->approver) || !INT(into->within_us)) return false;
    into->has_target = !rt_take_null(cursor);
    return (!into->has_target || link(cursor, &into->target)) && TEXT(into->text) && INT(into->source) && INT(into->start) &&
           INT(into->end) && INT(into->second);
}

static bool monitor(rt_cursor *cursor, rt_monitor *into) {
    return STRUCT(3) && INT(into->kind) && INT(into->window_us) && clause(cursor, &into->when);
}

static bool airspace(rt_cursor *cursor, rt_airspace *into) {
    return STRUCT(6) && rt_take_ints(cursor, &into->inside) && rt_take_ints(cursor, &into->outside) && TEXT(into->text) &&
           INT(into->source) && INT(into->start) && INT(into->end);
}

static bool speeds(rt_cursor *cursor, rt_speeds *into) {
    return STRUCT(10) && INT(into->cruise) && INT(into->climb) && INT(into->descent) && INT(into->landing) && INT(into->landing_below) &&
           INT(into->homeward) && INT(into->acceleration) && INT(into->air) && INT(into->wind) && INT(into->flight_us);
}

static bool vehicle(rt_cursor *cursor, rt_vehicle *into) {
    uint32_t fields;
    if (!rt_take_extended(cursor, 23, 24, &fields) || !TEXT(into->name) || !TEXT(into->identity) || !INT(into->home_within) || !INT(into->speed) || !INT(into->climb) ||
        !INT(into->position_error) || !INT(into->endurance_us) || !INT(into->reserve) || !INT(into->utc_offset_us) ||
        !INT(into->position) || !INT(into->height) || !INT(into->battery) || !INT(into->return_altitude) || !INT(into->braking) ||
        !INT(into->reaction_us) || !INT(into->north) || !INT(into->east) || !INT(into->down) || !rt_take_texts(cursor, &into->without))
        return false;
    into->servos = (rt_list){cursor->at, cursor->at, 0};
    into->has_speeds = !rt_take_null(cursor);
    return (!into->has_speeds || speeds(cursor, &into->speeds)) && TEXT(into->time_zone) && TEXT(into->time_zone_data) &&
           rt_take_ints(cursor, &into->offsets) && (fields == 23 || (rt_take_ints(cursor, &into->servos) && into->servos.count > 0));
}

TABLE(roles, rt_bytes, RT_MAX_ROLES, rt_take_text)
TABLE(signals, rt_signal, RT_MAX_SLOTS, signal)
TABLE(zones, rt_zone, RT_MAX_ZONES, zone)
TABLE(tables, rt_list, RT_MAX_TABLES, rt_take_ints)
TABLE(sets, rt_list, RT_MAX_SETS, rt_take_ints)
TABLE(contracts, rt_contract, RT_MAX_CONTRACTS, contract)
TABLE(rules, rt_rule, RT_MAX_RULES, rule)
TABLE(contingency, rt_link, RT_MAX_LINKS, link)
TABLE(monitors, rt_monitor, RT_MAX_MONITORS, monitor)
TABLE(phases, rt_bytes, RT_MAX_PHASE_NAMES, rt_take_text)

static bool policy(rt_cursor *cursor, rt_policy *into) {
    rt_projection *p = &into->projection;
    if (!STRUCT(23) || !TEXT(into->name) || !INT(into->version) || !vehicle(cursor, &into->vehicle) || !STRUCT(4) || !INT(p->latitude) ||
        !INT(p->longitude) || !INT(p->east) || !INT(p->north) || !roles(cursor, into->roles, &into->role_count) ||
        !signals(cursor, into->signals, &into->signal_count) || !INT(into->slots) || !zones(cursor, into->zones, &into->zone_count) ||
        !INT(into->declared) || !tables(cursor, into->tables, &into->table_count) || !sets(cursor, into->sets, &into->set_count) ||
        !contracts(cursor, into->contracts, &into->contract_count) || !rules(cursor, into->rules, &into->rule_count))
        return false;
    into->has_airspace = !rt_take_null(cursor);
    return (!into->has_airspace || airspace(cursor, &into->airspace)) && contingency(cursor, into->contingency, &into->contingency_count) &&
           rt_take_texts(cursor, &into->sources) && rt_take_octet_strings(cursor, &into->source_digests) &&
           monitors(cursor, into->monitors, &into->monitor_count) && phases(cursor, into->phases, &into->phase_count) &&
           INT(into->without_evidence) && INT(into->silence_us) && INT(into->after_silence) && omissions(cursor, &into->left_out);
}

/* The slot of the signal of this name, the measured drain; the first, if there are several. */
static int64_t drain_slot(const rt_policy *policy) {
    static const uint8_t name[] = "battery.drain";
    for (uint32_t at = 0; at < policy->signal_count; at++) {
        const rt_signal *signal = &policy->signals[at];
        if (signal->kind == RT_NUMBER && rt_same(signal->name, (rt_bytes){name, sizeof name - 1})) return signal->slot;
    }
    return -1;
}

rt_refusal rt_read_policy(rt_bytes payload, rt_policy *into) {
    rt_cursor cursor;
    rt_refusal refusal = rt_unwrap(&RT_POLICY, payload, &cursor);
    into->payload = payload;
    if (refusal != NULL) return refusal;
    if (!policy(&cursor, into)) return "malformed";
    into->vehicle.drain = drain_slot(into);
    return NULL;
}

static bool invocation(rt_cursor *cursor, rt_invocation *into) {
    const uint8_t *start = cursor->at;
    if (!STRUCT(17) || !OCTETS(into->invocation_id)) return false;
    const uint8_t *content = cursor->at;
    if (!INT(into->step) || !INT(into->phase) || !INT(into->skill) || !INT(into->source) || !INT(into->role) ||
        !rt_take_ints(cursor, &into->arguments) || !INT(into->issued_at_us) || !INT(into->phases) || !INT(into->on_inadmissible) ||
        !contract(cursor, &into->contract) || !plan(cursor, &into->plan) || !TEXT(into->text) || !INT(into->file) || !INT(into->start) || !INT(into->end))
        return false;
    into->content = (rt_bytes){content, (uint32_t)(cursor->at - content)};
    if (!OCTETS(into->binding)) return false;
    into->raw = (rt_bytes){start, (uint32_t)(cursor->at - start)};
    return true;
}

static bool invocation_bytes(rt_cursor *cursor, rt_bytes *raw) {
    rt_invocation read;
    if (!invocation(cursor, &read)) return false;
    *raw = read.raw;
    return true;
}

TABLE(invocations, rt_bytes, RT_MAX_INVOCATIONS, invocation_bytes)

bool rt_take_mission(rt_cursor *cursor, rt_bytes payload, rt_mission *into) {
    const uint8_t *start = cursor->at;
    if (!STRUCT(12) || !TEXT(into->name) || !TEXT(into->intent) || !TEXT(into->proposer) || !TEXT(into->vehicle) || !TEXT(into->policy) ||
        !INT(into->policy_version) || !OCTETS(into->policy_digest) || !INT(into->issued_at_us) || !rt_take_texts(cursor, &into->phases))
        return false;
    into->before = (rt_bytes){start, (uint32_t)(cursor->at - start)};
    if (!invocations(cursor, into->invocations, &into->invocation_count)) return false;
    const uint8_t *behind = cursor->at;
    bool whole = rt_take_texts(cursor, &into->sources) && rt_take_octet_strings(cursor, &into->source_digests);
    into->payload = payload;
    into->behind = (rt_bytes){behind, (uint32_t)(cursor->at - behind)};
    return whole;
}

rt_refusal rt_read_mission(rt_bytes payload, rt_mission *into) {
    rt_cursor cursor;
    rt_refusal refusal = rt_unwrap(&RT_MISSION, payload, &cursor);
    return refusal != NULL || rt_take_mission(&cursor, payload, into) ? refusal : "malformed";
}

void rt_read_invocation(rt_bytes raw, rt_invocation *into) {
    rt_cursor cursor = {raw.at, raw.at + raw.size};
    (void)invocation(&cursor, into); /* well-formed when it was read first */
}

void rt_invocation_at(const rt_mission *mission, uint32_t step, rt_invocation *into) { rt_read_invocation(mission->invocations[step], into); }

/* Most of the time of a decision is spent here, so checked code is read without `rt_take_int`. */
bool rt_next_int(rt_list *list, int64_t *value) {
    const uint8_t *at = list->at;
    if (list->count == 0 || at >= list->end) return false;
    uint8_t initial = *at++;
    uint64_t argument = initial & 0x1F;
    if (argument >= 24) {
        uint32_t width = 1u << (argument - 24);
        for (argument = 0; width > 0; width--) {
            if (at >= list->end) return false;
            argument = argument << 8 | *at++;
        }
    }
    *value = initial & 0x20 ? -1 - (int64_t)argument : (int64_t)argument;
    list->at = at;
    list->count--;
    return true;
}

NEXT(rt_next_clause, rt_clause, clause)
NEXT(rt_next_link, rt_link, link)
NEXT(rt_next_parameter, rt_parameter, parameter)
NEXT(rt_next_source, rt_signal_source, signal_source)
NEXT(rt_next_left_out, rt_left_out, omission)
NEXT(rt_next_emission, rt_emission, emission)
NEXT(rt_next_emission_parameter, rt_emission_parameter, emission_parameter)

static bool text_or_octets(rt_cursor *cursor, rt_bytes *into) {
    rt_cursor again = *cursor;
    if (rt_take_text(cursor, into)) return true;
    *cursor = again;
    return OCTETS(*into);
}

NEXT(rt_next_text, rt_bytes, text_or_octets)

int64_t rt_int_at(rt_list list, uint32_t index) {
    int64_t value = -1;
    for (uint32_t i = 0; i <= index && rt_next_int(&list, &value); i++) continue;
    return value;
}

bool rt_holds(rt_list list, int64_t value) {
    int64_t each = 0;
    while (rt_next_int(&list, &each))
        if (each == value) return true;
    return false;
}

bool rt_names(rt_list texts, rt_bytes text) {
    rt_bytes each;
    while (rt_next_text(&texts, &each))
        if (rt_same(each, text)) return true;
    return false;
}
