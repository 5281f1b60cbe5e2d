#include "cbor.h"

/* The annotations `split` make Frama-C (proof/cbor.c) analyse each length separately. */

static bool head(rt_cursor *cursor, uint8_t *major, uint64_t *argument) {
    if (cursor->at >= cursor->end) return false;
    uint8_t initial = *cursor->at++, info = initial & 0x1F;
    *major = initial >> 5;
    *argument = info;
    if (info < 24) return true;
    if (info > 27) return false; /* reserved, or of indefinite length */
    uint32_t width = 1u << (info - 24);
    //@ split width;
    if (width > (size_t)(cursor->end - cursor->at)) return false;
    uint64_t value = 0;
    for (uint32_t i = 0; i < width; i++) value = value << 8 | *cursor->at++;
    *argument = value;
    return value >= (width == 1 ? 24 : (uint64_t)1 << 4 * width); /* the shortest form */
}

static bool is_utf8(const uint8_t *at, const uint8_t *end) {
    while (at < end) {
        uint8_t lead = *at++;
        if (lead < 0x80) continue;
        int more = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : 1;
        //@ split more;
        if (lead < 0xC2 || lead > 0xF4 || end - at < more) return false;
        /* no overlong form, no surrogate, nothing above U+10FFFF */
        uint8_t low = lead == 0xE0 ? 0xA0 : lead == 0xF0 ? 0x90 : 0x80, high = lead == 0xED ? 0x9F : lead == 0xF4 ? 0x8F : 0xBF;
        for (int i = 0; i < more; i++, at++, low = 0x80, high = 0xBF)
            if (*at < low || *at > high) return false;
    }
    return true;
}

static bool before(rt_bytes one, rt_bytes other) {
    int order = memcmp(one.at, other.at, one.size < other.size ? one.size : other.size);
    return order < 0 || (order == 0 && one.size < other.size);
}

typedef struct {
    uint64_t left; /* items; in a map, a key is next where it is even */
    bool map;
    rt_bytes key; /* the one before, in a map */
} level;

/* The size in the head of a string, an array or a map fits into the remaining bytes; a string's bytes are taken. */
static bool content(rt_cursor *cursor, uint8_t major, uint64_t argument) {
    uint64_t room = (uint64_t)(cursor->end - cursor->at);
    if (argument > room || (major == 5 && 2 * argument > room)) return false;
    //@ split argument;
    if (major > 3) return true;
    const uint8_t *start = cursor->at;
    cursor->at += argument;
    return major == 2 || is_utf8(start, cursor->at);
}

bool rt_cbor_valid(rt_bytes data, uint32_t items) {
    if (data.size == 0 || data.size > RT_CBOR_LIMIT) return false;
    rt_cursor cursor = {data.at, data.at + data.size};
    level levels[RT_CBOR_DEPTH + 1];
    uint32_t depth = 0;
    levels[0] = (level){1, false, {data.at, 0}};
    for (;;) {
        while (levels[depth].left == 0) {
            if (depth == 0) return cursor.at == cursor.end;
            depth--;
        }
        level *in = &levels[depth];
        bool key = in->map && in->left % 2 == 0;
        const uint8_t *start = cursor.at;
        uint8_t major;
        uint64_t argument;
        in->left--;
        if (items-- == 0) return false;
        if (!head(&cursor, &major, &argument) || major == 6) return false;
        if (key && major != 0 && major != 1 && major != 3) return false;
        if (major < 2) {
            if (argument > INT64_MAX) return false;
        } else if (major == 7) {
            if (argument < 20 || argument > 22) return false; /* false, true, null */
        } else if (!content(&cursor, major, argument)) {
            return false;
        }
        if (key) {
            rt_bytes here = {start, (uint32_t)(cursor.at - start)};
            if (in->key.size > 0 && !before(in->key, here)) return false;
            in->key = here;
        }
        if (major == 4 || major == 5) {
            if (++depth > RT_CBOR_DEPTH) return false;
            levels[depth] = (level){major == 5 ? 2 * argument : argument, major == 5, {data.at, 0}};
        }
    }
}

bool rt_take_int(rt_cursor *cursor, int64_t *value) {
    uint8_t major;
    uint64_t argument;
    if (!head(cursor, &major, &argument) || major > 1 || argument > INT64_MAX) return false;
    *value = major == 0 ? (int64_t)argument : -1 - (int64_t)argument;
    return true;
}

static bool string(rt_cursor *cursor, uint8_t kind, rt_bytes *string) {
    uint8_t major;
    uint64_t size;
    if (!head(cursor, &major, &size) || major != kind || size > (uint64_t)(cursor->end - cursor->at)) return false;
    //@ split size;
    *string = (rt_bytes){cursor->at, (uint32_t)size};
    cursor->at += size;
    return true;
}

bool rt_take_octets(rt_cursor *cursor, rt_bytes *octets) { return string(cursor, 2, octets); }

bool rt_take_text(rt_cursor *cursor, rt_bytes *text) { return string(cursor, 3, text); }

static bool container(rt_cursor *cursor, uint8_t kind, uint32_t *count) {
    uint8_t major;
    uint64_t argument;
    if (!head(cursor, &major, &argument) || major != kind || argument > (uint64_t)(cursor->end - cursor->at)) return false;
    *count = (uint32_t)argument;
    return true;
}

bool rt_take_array(rt_cursor *cursor, uint32_t *count) { return container(cursor, 4, count); }

bool rt_take_map(rt_cursor *cursor, uint32_t *count) { return container(cursor, 5, count); }

bool rt_take_bool(rt_cursor *cursor, bool *value) {
    if (cursor->at >= cursor->end || (*cursor->at != 0xF4 && *cursor->at != 0xF5)) return false;
    *value = *cursor->at++ == 0xF5;
    return true;
}

bool rt_take_null(rt_cursor *cursor) {
    if (cursor->at >= cursor->end || *cursor->at != 0xF6) return false;
    cursor->at++;
    return true;
}

bool rt_take_struct(rt_cursor *cursor, uint32_t fields) {
    uint32_t count;
    return rt_take_array(cursor, &count) && count == fields;
}

bool rt_take_extended(rt_cursor *cursor, uint32_t least, uint32_t most, uint32_t *fields) {
    return rt_take_array(cursor, fields) && *fields >= least && *fields <= most;
}

uint32_t rt_cbor_head(uint8_t out[RT_HEAD_BYTES], uint8_t major, uint64_t argument) {
    uint8_t info = argument < 24 ? (uint8_t)argument : argument < 1u << 8 ? 24 : argument < 1u << 16 ? 25 : argument < (uint64_t)1 << 32 ? 26 : 27;
    uint32_t width = info < 24 ? 0 : 1u << (info - 24);
    out[0] = (uint8_t)(major << 5 | info);
    for (uint32_t i = 0; i < width; i++) out[1 + i] = (uint8_t)(argument >> 8 * (width - 1 - i));
    return 1 + width;
}

uint32_t rt_cbor_int(uint8_t out[RT_HEAD_BYTES], int64_t value) {
    return value < 0 ? rt_cbor_head(out, 1, (uint64_t)(-1 - value)) : rt_cbor_head(out, 0, (uint64_t)value);
}

uint32_t rt_cbor_string(uint8_t *out, uint8_t major, rt_bytes string) {
    uint32_t size = rt_cbor_head(out, major, string.size);
    if (string.size > 0) memcpy(out + size, string.at, string.size);
    return size + string.size;
}
