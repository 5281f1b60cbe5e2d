/* A substitute for wire/cbor.c, which proof/cbor.c covers: a reader that returns anything, whatever the bytes. A string that it returns
   is a view of any octets, all of which may be read. */
#ifndef RT_PROOF_READER_H
#define RT_PROOF_READER_H

#include "any.h"
#include "wire/cbor.h"

#define BYTES 64

static uint8_t input[BYTES], view[BYTES];

static bool taken(rt_cursor *cursor) {
    cursor->at = input + SIZE(BYTES);
    return EITHER();
}

static bool string(rt_cursor *cursor, rt_bytes *of) {
    ANY(view);
    *of = (rt_bytes){view, SIZE(BYTES)};
    return taken(cursor);
}

bool rt_cbor_valid(rt_bytes data, uint32_t items) { return EITHER(); }
bool rt_take_octets(rt_cursor *cursor, rt_bytes *octets) { return string(cursor, octets); }
bool rt_take_text(rt_cursor *cursor, rt_bytes *text) { return string(cursor, text); }
bool rt_take_null(rt_cursor *cursor) { return taken(cursor); }
bool rt_take_struct(rt_cursor *cursor, uint32_t fields) { return taken(cursor); }

bool rt_take_int(rt_cursor *cursor, int64_t *value) {
    *value = WITHIN(INT64_MIN, INT64_MAX);
    return taken(cursor);
}

bool rt_take_array(rt_cursor *cursor, uint32_t *count) {
    *count = SIZE(UINT32_MAX);
    return taken(cursor);
}

bool rt_take_extended(rt_cursor *cursor, uint32_t least, uint32_t most, uint32_t *fields) {
    *fields = least + SIZE(most - least);
    return taken(cursor);
}

bool rt_take_map(rt_cursor *cursor, uint32_t *count) { return rt_take_array(cursor, count); }

bool rt_take_bool(rt_cursor *cursor, bool *value) {
    *value = EITHER();
    return taken(cursor);
}

uint32_t rt_cbor_head(uint8_t out[RT_HEAD_BYTES], uint8_t major, uint64_t argument) {
    Frama_C_make_unknown((char *)out, RT_HEAD_BYTES);
    return 1 + SIZE(RT_HEAD_BYTES - 1);
}

uint32_t rt_cbor_int(uint8_t out[RT_HEAD_BYTES], int64_t value) { return rt_cbor_head(out, RT_MAJOR_INT, 0); }

#endif
