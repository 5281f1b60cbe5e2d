/* Deterministic CBOR (RFC 8949, section 4.2.1): the strict check of whole items, and readers of checked items. */
#ifndef RT_WIRE_CBOR_H
#define RT_WIRE_CBOR_H

#include "../base.h"

#define RT_CBOR_LIMIT (16u << 20)
#define RT_CBOR_DEPTH 32

/* The position of a reader. It never passes `end`, whatever the bytes. */
typedef struct {
    const uint8_t *at;
    const uint8_t *end;
} rt_cursor;

/* Whether the bytes are one item, in its only encoding, with at most so many items in all (`cbor.decode`). */
bool rt_cbor_valid(rt_bytes data, uint32_t items);

/* Take the next item if it is of that kind; otherwise the position of the cursor is undefined. */
bool rt_take_int(rt_cursor *cursor, int64_t *value);
bool rt_take_octets(rt_cursor *cursor, rt_bytes *octets);
bool rt_take_text(rt_cursor *cursor, rt_bytes *text);
bool rt_take_array(rt_cursor *cursor, uint32_t *count);
bool rt_take_map(rt_cursor *cursor, uint32_t *count);
bool rt_take_bool(rt_cursor *cursor, bool *value);
bool rt_take_null(rt_cursor *cursor); /* leaves the cursor where it is if the next item is another */

/* An array of exactly this many items. */
bool rt_take_struct(rt_cursor *cursor, uint32_t fields);
/* An array of `least` to `most` items: the last fields of a record are left out if they have their defaults. */
bool rt_take_extended(rt_cursor *cursor, uint32_t least, uint32_t most, uint32_t *fields);

#define RT_HEAD_BYTES 9
enum { RT_MAJOR_INT = 0, RT_MAJOR_OCTETS = 2, RT_MAJOR_TEXT = 3, RT_MAJOR_ARRAY = 4 };

/* The shortest head; returns its size in bytes. */
uint32_t rt_cbor_head(uint8_t out[RT_HEAD_BYTES], uint8_t major, uint64_t argument);
uint32_t rt_cbor_int(uint8_t out[RT_HEAD_BYTES], int64_t value);
/* A string of octets or text, with its head; returns its size in bytes. */
uint32_t rt_cbor_string(uint8_t *out, uint8_t major, rt_bytes string);

#endif
