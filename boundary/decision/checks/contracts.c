#include "../parts.h"

static bool check_parameter(const rt_parameter *parameter, const rt_policy *policy) {
    int64_t count = parameter->kind == RT_CHOICE ? parameter->labels.count : policy->declared;
    if (!rt_within(parameter->kind, RT_QUANTITY, RT_PLACE) || !rt_within(parameter->low, -RT_MAX_VALUE, RT_MAX_VALUE))
        return false;
    if (!rt_within(parameter->high, parameter->low, RT_MAX_VALUE)) return false;
    return (parameter->kind != RT_CHOICE && parameter->kind != RT_ZONE) || (parameter->low >= 0 && parameter->high < count);
}

/* Also returns the kind at each first cell. */
static bool check_parameters(const rt_contract *contract, const rt_policy *policy, uint8_t cells[RT_MAX_CELLS]) {
    rt_list left = contract->parameters;
    rt_parameter parameter;
    int64_t cell = 0;
    memset(cells, RT_NO_KIND, RT_MAX_CELLS);
    if (left.count > RT_MAX_PARAMETERS) return false;
    while (rt_next_parameter(&left, &parameter)) {
        int64_t size = parameter.kind == RT_PLACE ? 2 : 1;
        if (parameter.cell != cell || !check_parameter(&parameter, policy) || cell + size > RT_MAX_CELLS) return false;
        cells[cell] = (uint8_t)parameter.kind;
        cell += size;
    }
    return true;
}

static bool check_motion(const rt_motion *motion, const uint8_t cells[RT_MAX_CELLS]) {
    const int64_t named[4] = {motion->altitude, motion->speed, motion->time, motion->lowest};
    int places = 0, zones = 0;
    if (!rt_within(motion->kind, RT_HOLD, RT_LAND)) return false;
    for (int at = 0; at < 4; at++)
        if (named[at] != -1 && (!rt_within(named[at], 0, RT_MAX_CELLS - 1) || cells[named[at]] != RT_QUANTITY)) return false;
    if (!rt_within(motion->facing, RT_ALONG_LEGS, RT_INWARD)) return false;
    if (motion->kind != RT_COVER && (motion->lowest != -1 || motion->facing != RT_ALONG_LEGS)) return false;
    for (int at = 0; at < RT_MAX_CELLS; at++) {
        places += cells[at] == RT_PLACE;
        zones += cells[at] == RT_ZONE;
    }
    if ((motion->kind == RT_CLIMB || motion->kind == RT_FLY || motion->kind == RT_COVER) && motion->altitude == -1) return false;
    return (motion->kind != RT_FLY || places > 0) && (motion->kind != RT_COVER || zones == 1);
}

static const char *const words[4] = {"buffered", "written", "synced", "synced_first"};
#define RT_SYNCED 2

static bool is_text(rt_bytes text, const char *other) {
    uint32_t size = 0;
    while (other[size]) size++;
    return text.size == size && memcmp(text.at, other, size) == 0;
}

/* The durability class of a word, by its number; -1 for an unknown one. */
static int durability(rt_bytes text) {
    for (int word = 0; word < 4; word++)
        if (is_text(text, words[word])) return word;
    return -1;
}

/* The greatest class in a record clause, and how many it names. */
static int recorded_as(rt_list record, int *named) {
    int found = -1;
    rt_bytes text;
    *named = 0;
    while (rt_next_text(&record, &text)) {
        int word = durability(text);
        *named += word >= 0;
        found = word > found ? word : found;
    }
    return *named ? found : RT_SYNCED;
}

static bool check_clauses(rt_list clauses, const rt_scope *scope, rt_slots *reads) {
    rt_clause clause;
    bool monitored;
    if (clauses.count > RT_MAX_CLAUSES) return false;
    while (rt_next_clause(&clauses, &clause)) {
        if (!rt_code_fits(clause.code, scope)) return false;
        rt_read_code(scope->policy, clause.code, reads, &monitored);
    }
    return true;
}

/* `reads` must be exactly what the clauses read, ascending. */
static bool same_reads(rt_list reads, const rt_slots *slots) {
    int64_t slot;
    for (int64_t at = 0; at < RT_MAX_SLOTS; at++)
        if (rt_reads(slots, at) && (!rt_next_int(&reads, &slot) || slot != at)) return false;
    return reads.count == 0;
}

/* rt_check_chain checks its links, because they refer to other contracts. */
bool rt_check_contract(const rt_contract *contract, const rt_prepared_policy *policy, uint8_t cells[RT_MAX_CELLS]) {
    const int64_t durations[4] = {contract->deadline_us, contract->validity_us, contract->duration_us, contract->grace_us};
    rt_slots reads = {{0, 0}};
    int named;
    if (!check_parameters(contract, policy->policy, cells) || !check_motion(&contract->motion, cells)) return false;
    if (!rt_within(contract->timing_class, RT_SEMANTIC, RT_REFLEX)) return false;
    for (int at = 0; at < 4; at++)
        if (!rt_within(durations[at], 0, RT_MAX_DURATION)) return false;
    if (!rt_within(contract->energy, 0, RT_FULL)) return false;
    /* only a reflex may lose its record with the process, because it has no time to wait */
    if (recorded_as(contract->record, &named) == 0 && contract->timing_class != RT_REFLEX) return false;
    if (named > 1 || !rt_check_emissions(contract, &policy->policy->vehicle, cells)) return false;
    const rt_scope scope = {policy, {NULL, NULL, 0}, cells, policy->policy->monitor_count, true};
    return check_clauses(contract->require, &scope, &reads) && check_clauses(contract->assume, &scope, &reads) &&
           check_clauses(contract->maintain, &scope, &reads) && same_reads(contract->reads, &reads);
}

/* A link must be a complete call of a skill that needs no survey path. */
bool rt_check_link(const rt_link *link, const rt_policy *policy) {
    if (!rt_within(link->skill, 0, (int64_t)policy->contract_count - 1)) return false;
    const rt_contract *called = &policy->contracts[link->skill];
    const rt_motion *motion = &called->motion;
    if (motion->kind == RT_COVER || link->arguments.count != rt_cells(called) || !rt_fits(link->arguments, called)) return false;
    if (!rt_within(link->limit_us, 0, RT_MAX_DURATION)) return false;
    if (motion->altitude != -1 && !rt_within(rt_int_at(link->arguments, (uint32_t)motion->altitude), RT_LOWEST, RT_HIGHEST))
        return false;
    if (motion->speed != -1 && !rt_within(rt_int_at(link->arguments, (uint32_t)motion->speed), 0, policy->vehicle.speed))
        return false;
    if (motion->kind != RT_FLY) return true;
    uint32_t cell = (uint32_t)rt_first_cell(called, RT_PLACE);
    return rt_check_place(&policy->projection, rt_int_at(link->arguments, cell), rt_int_at(link->arguments, cell + 1));
}

bool rt_check_chain(rt_list links, const rt_policy *policy) {
    rt_link link;
    if (links.count > RT_MAX_LINKS) return false;
    while (rt_next_link(&links, &link))
        if (!rt_check_link(&link, policy)) return false;
    return true;
}

/* ---------------------------------------------------------------------------------------- a mission may only tighten a contract */

static bool same_calls(rt_list mine, rt_list policys) {
    rt_link one, other;
    if (mine.count != policys.count) return false;
    while (rt_next_link(&mine, &one) && rt_next_link(&policys, &other))
        if (one.skill != other.skill || !rt_same_list(one.arguments, other.arguments) || one.limit_us != other.limit_us ||
            !rt_same(one.text, other.text))
            return false;
    return true;
}

static bool same_parameters(rt_list mine, rt_list policys) {
    rt_parameter a, b;
    if (mine.count != policys.count) return false;
    while (rt_next_parameter(&mine, &a) && rt_next_parameter(&policys, &b)) {
        if (!rt_same(a.name, b.name) || a.kind != b.kind || !rt_same(a.dimension, b.dimension) || a.cell != b.cell ||
            !rt_same_list(a.labels, b.labels))
            return false;
        if (b.low > a.low || a.high > b.high) return false;
    }
    return true;
}

static bool subset(rt_list texts, rt_list of) {
    rt_bytes text;
    while (rt_next_text(&texts, &text))
        if (!rt_names(of, text)) return false;
    return true;
}

static bool records_all(rt_list policys, rt_list mine) {
    rt_bytes text;
    while (rt_next_text(&policys, &text))
        if (durability(text) < 0 && !rt_names(mine, text)) return false;
    return true;
}

static uint32_t occurs(rt_list clauses, const rt_clause *wanted) {
    rt_clause clause;
    uint32_t count = 0;
    while (rt_next_clause(&clauses, &clause))
        count += rt_same_list(clause.code, wanted->code) && rt_same(clause.text, wanted->text);
    return count;
}

/* Whether each clause of the policy's appears as often as in the policy, compared by code and text. */
static bool all_there(rt_list policys, rt_list mine) {
    rt_list left = policys;
    rt_clause clause;
    while (rt_next_clause(&left, &clause))
        if (occurs(mine, &clause) < occurs(policys, &clause)) return false;
    return true;
}

/* Texts are UTF-8. White space is that of Python's `str.split`: its size in bytes, 0 if there is none. */
static uint32_t space(rt_bytes text, uint32_t at) {
    uint8_t byte = text.at[at];
    if ((byte >= 0x09 && byte <= 0x0D) || (byte >= 0x1C && byte <= 0x20)) return 1;
    if (byte == 0xC2 && at + 1 < text.size) return text.at[at + 1] == 0x85 || text.at[at + 1] == 0xA0 ? 2 : 0;
    if (byte < 0xE1 || byte > 0xE3 || at + 2 >= text.size) return 0;
    uint32_t point = (uint32_t)(byte & 15) << 12 | (uint32_t)(text.at[at + 1] & 63) << 6 | (text.at[at + 2] & 63);
    return point == 0x1680 || (point >= 0x2000 && point <= 0x200A) || point == 0x2028 || point == 0x2029 || point == 0x202F ||
                   point == 0x205F || point == 0x3000
               ? 3
               : 0;
}

/* The next byte of a text with its words separated by single spaces, -1 at its end. Between words, `at` stays after the spaces. */
static int next_byte(rt_bytes text, uint32_t *at) {
    uint32_t start = *at, size;
    while (*at < text.size && (size = space(text, *at)) > 0) *at += size;
    if (*at == text.size) return -1;
    if (*at > start && start > 0) return ' ';
    return text.at[(*at)++];
}

int rt_compare_words(rt_bytes one, rt_bytes other) {
    uint32_t at = 0, to = 0;
    for (;;) {
        int a = next_byte(one, &at), b = next_byte(other, &to);
        if (a != b) return a < b ? -1 : 1;
        if (a < 0) return 0;
    }
}

/* Whether a text is an abbreviation, so that other texts may share its beginning. */
static bool is_cut(rt_bytes text) {
    uint32_t characters = 0;
    for (uint32_t at = 0; at < text.size; at++) characters += (text.at[at] & 0xC0) != 0x80;
    return characters == RT_MAX_TEXT && memcmp(text.at + text.size - 3, "...", 3) == 0;
}

/* Whether a clause of the mission's own could be mistaken for one of the policy: it has the text of one, and the code of none. */
static bool poses(const rt_clause *one, const rt_contract *policys) {
    const rt_list lists[3] = {policys->require, policys->assume, policys->maintain};
    bool worded = false;
    rt_clause clause;
    for (int at = 0; at < 3; at++) {
        rt_list left = lists[at];
        while (rt_next_clause(&left, &clause)) {
            if (rt_compare_words(clause.text, one->text) != 0) continue;
            if (rt_same_list(clause.code, one->code)) return false;
            worded = true;
        }
    }
    return worded && !is_cut(one->text);
}

static bool none_poses(rt_list mine, const rt_contract *policys) {
    rt_clause clause;
    while (rt_next_clause(&mine, &clause))
        if (poses(&clause, policys)) return false;
    return true;
}

/* A duration of 0 is unlimited, so it is looser than any other. */
bool rt_tightens(const rt_contract *mine, const rt_contract *policys) {
    const rt_motion *a = &mine->motion, *b = &policys->motion;
    int named;
    return rt_same(mine->name, policys->name) && a->kind == b->kind && a->altitude == b->altitude && a->speed == b->speed &&
           a->time == b->time && a->lowest == b->lowest && a->facing == b->facing && mine->timing_class == policys->timing_class &&
           same_calls(mine->fallback, policys->fallback) && same_parameters(mine->parameters, policys->parameters) &&
           rt_same_list(mine->emits, policys->emits) &&
           (policys->phases.count == 0 || (mine->phases.count > 0 && subset(mine->phases, policys->phases))) &&
           mine->deadline_us <= policys->deadline_us && mine->validity_us <= policys->validity_us &&
           (policys->duration_us == 0 || rt_within(mine->duration_us, 1, policys->duration_us)) &&
           mine->grace_us <= policys->grace_us && mine->energy >= policys->energy && all_there(policys->require, mine->require) &&
           all_there(policys->assume, mine->assume) && all_there(policys->maintain, mine->maintain) &&
           records_all(policys->record, mine->record) &&
           recorded_as(mine->record, &named) >= recorded_as(policys->record, &named) && none_poses(mine->require, policys) &&
           none_poses(mine->assume, policys) && none_poses(mine->maintain, policys);
}
