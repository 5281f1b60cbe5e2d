/* Basics for all parts of the boundary: views into bytes that stay in place. It has no Python counterpart, because Python has bytes and
   tuples. */
#ifndef RT_BASE_H
#define RT_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* A view of bytes; `at` may be anything if `size` is 0. Text is UTF-8 and not terminated by a NUL. */
typedef struct {
    const uint8_t *at;
    uint32_t size;
} rt_bytes;

/* The items of a well-formed CBOR array: `at` is the first of `count` items; `end` is after the last. */
typedef struct {
    const uint8_t *at;
    const uint8_t *end;
    uint32_t count;
} rt_list;

/* An item of a table. The checks ensure that every index is within it; the remainder, which equals the index, makes that evident to the
   proof. */
#define RT_AT(table, index) ((table)[(uint64_t)(index) % (sizeof(table) / sizeof *(table))])

/* The slug of the Python refusal, or NULL if nothing is refused. */
typedef const char *rt_refusal;

/* The octets of a slug. */
static inline rt_bytes rt_words(rt_refusal slug) {
    rt_bytes words = {(const uint8_t *)slug, 0};
    while (slug[words.size] != 0) words.size++;
    return words;
}

static inline bool rt_same(rt_bytes one, rt_bytes other) {
    return one.size == other.size && (one.size == 0 || memcmp(one.at, other.at, one.size) == 0);
}

/* Negative if some bytes sort before others, positive if they sort after them. */
static inline int rt_compare(rt_bytes one, rt_bytes other) {
    int found = one.size && other.size ? memcmp(one.at, other.at, one.size < other.size ? one.size : other.size) : 0;
    return found ? found : (one.size > other.size) - (one.size < other.size);
}

/* Whether two lists have the same items, each of which has one encoding. */
static inline bool rt_same_list(rt_list one, rt_list other) {
    return one.count == other.count &&
           rt_same((rt_bytes){one.at, (uint32_t)(one.end - one.at)}, (rt_bytes){other.at, (uint32_t)(other.end - other.at)});
}

static inline int64_t rt_min(int64_t a, int64_t b) { return a < b ? a : b; }
static inline int64_t rt_max(int64_t a, int64_t b) { return a > b ? a : b; }
static inline int64_t rt_abs(int64_t a) { return a < 0 ? -a : a; }
static inline bool rt_within(int64_t value, int64_t low, int64_t high) { return low <= value && value <= high; }
/* Division that rounds down, and its non-negative remainder; `by` is positive. */
static inline int64_t rt_floor(int64_t a, int64_t by) { return a / by - (a % by < 0); }
static inline int64_t rt_modulo(int64_t a, int64_t by) {
    int64_t rest = a % by;
    return rest < 0 ? rest + by : rest;
}

#define RT_DIGEST_BYTES 32
#define RT_KEY_BYTES 32
#define RT_KID_BYTES 16
#define RT_ID_BYTES 16
#define RT_FLIGHT_BYTES 16

#endif
