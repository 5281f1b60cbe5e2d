#include "preparation.h"

#include "mavlink/parameters.h"

#define VALID_US 30000000LL /* us */

/* A parameter that may be set: to a value from `first` to `last`, or to one of `count` values. */
typedef struct {
    uint8_t name[RT_PARAMETER_NAME];
    int32_t first, last;
    uint32_t count;
    uint8_t values[8];
} settable;

static const settable SETTABLE[] = {
    {"FENCE_ENABLE", 0, 0, 1, {1}},
    {"FENCE_TYPE", 0, 0, 8, {4, 5, 6, 7, 12, 13, 14, 15}},
    {"FENCE_RADIUS", 30, 10000, 0, {0}},
    {"FENCE_ALT_MAX", 10, 1000, 0, {0}},
    {"FENCE_ALT_MIN", -100, 100, 0, {0}},
    {"FENCE_MARGIN", 1, 10, 0, {0}},
    {"RTL_ALT", 30, 300000, 0, {0}},
    {"RTL_ALT_M", 1, 3000, 0, {0}},
    {"GF_ACTION", 0, 0, 3, {2, 3, 5}},
    {"GF_MAX_HOR_DIST", 0, 10000, 0, {0}},
    {"GF_MAX_VER_DIST", 0, 10000, 0, {0}},
    {"RTL_RETURN_ALT", 1, 3000, 0, {0}},
};

static bool is_called(const rt_write *write, const uint8_t name[RT_PARAMETER_NAME]) {
    return memcmp(write->name, name, RT_PARAMETER_NAME) == 0;
}

static const settable *settable_of(const rt_write *write) {
    for (uint32_t at = 0; at < sizeof SETTABLE / sizeof *SETTABLE; at++)
        if (is_called(write, SETTABLE[at].name)) return &SETTABLE[at];
    return NULL;
}

static bool is_settable(const rt_write *write) {
    const settable *found = settable_of(write);
    if (found == NULL || !rt_is_finite(write->value)) return false;
    for (uint32_t at = 0; at < found->count; at++)
        if (rt_is_whole(write->value, found->values[at])) return true;
    return found->count == 0 && rt_lies_within(write->value, found->first, found->last);
}

static rt_write *named(rt_write *writes, uint32_t count, const uint8_t name[RT_PARAMETER_NAME]) {
    for (uint32_t at = 0; at < count; at++)
        if (is_called(&writes[at], name)) return &writes[at];
    return NULL;
}

void rt_issuer_begin(rt_issuer *issuer, const rt_preparation *settings, const rt_preparation *owed) {
    memset(issuer, 0, sizeof *issuer);
    if (settings != NULL) issuer->settings = *settings;
    for (uint32_t at = 0; owed != NULL && at < owed->count; at++) issuer->owed[issuer->owed_count++] = owed->writes[at];
}

static rt_refusal restoring(rt_issuer *issuer, const rt_preparation *asked) {
    for (uint32_t at = 0; at < asked->count; at++) {
        const rt_write *each = &asked->writes[at], *owed = named(issuer->owed, issuer->owed_count, each->name);
        if (settable_of(each) == NULL || owed == NULL || owed->before != each->value) return "preparation/not-as-before";
    }
    return NULL;
}

/* A parameter that was set already and is set again is restored to its first value. */
static rt_refusal setting(rt_issuer *issuer, const rt_preparation *asked) {
    for (uint32_t at = 0; at < asked->count; at++) {
        const rt_write *each = &asked->writes[at], *meant = named(issuer->settings.writes, issuer->settings.count, each->name);
        if (meant == NULL || meant->value != each->value || !is_settable(each)) return "preparation/not-configured";
    }
    for (uint32_t at = 0; at < asked->count; at++) {
        const rt_write *each = &asked->writes[at];
        rt_write *owed = named(issuer->owed, issuer->owed_count, each->name);
        const bool first = owed == NULL || owed->value != each->before;
        const uint32_t before = first ? each->before : owed->before;
        if (owed == NULL) owed = &issuer->owed[issuer->owed_count++]; /* at most as many as were configured, besides those at the start */
        *owed = *each;
        owed->before = before;
    }
    return NULL;
}

rt_refusal rt_permit_preparation(rt_issuer *issuer, const uint8_t key[RT_KEY_BYTES], rt_bytes ask, int64_t now_us, uint8_t *out,
                                 uint32_t *size) {
    rt_preparation asked;
    if (!rt_read_preparation(ask, &asked) || asked.count == 0) return "preparation/malformed";
    for (uint32_t at = 1; at < asked.count; at++)
        if (named(asked.writes, at, asked.writes[at].name) != NULL) return "preparation/malformed";
    if (issuer->serial + 1 == RT_MOST_PREPARATIONS) return "preparation/too-many";
    rt_refusal refused = asked.restoring ? restoring(issuer, &asked) : setting(issuer, &asked);
    if (refused != NULL) return refused;
    asked.serial = ++issuer->serial;
    asked.not_after_us = now_us + VALID_US;
    *size = rt_seal_preparation(&asked, key, out);
    return NULL;
}
