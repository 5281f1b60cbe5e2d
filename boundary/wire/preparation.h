/* The preparation permit: which parameters of the vehicle may be set on the ground, and to what. `preparation.py`. */
#ifndef RT_WIRE_PREPARATION_H
#define RT_WIRE_PREPARATION_H

#include "../base.h"

#define RT_MAX_WRITES 32
#define RT_PARAMETER_NAME 16
#define RT_MAX_PREPARATION (19 + RT_MAX_WRITES * 24 + 32)

/* One parameter: its name, filled up with NULs, the value that it was found to have, and the one it gets: the 32 bits of a
   float. */
typedef struct {
    uint8_t name[RT_PARAMETER_NAME];
    uint32_t before, value;
} rt_write;

typedef struct {
    uint64_t serial;
    bool restoring;
    int64_t not_after_us;
    rt_write writes[RT_MAX_WRITES];
    uint32_t count;
} rt_preparation;

/* The preparation of a body without its seal; false for octets that are none. */
bool rt_read_preparation(rt_bytes body, rt_preparation *preparation);

/* False for bytes that this key did not seal, too. */
bool rt_open_preparation(rt_bytes sealed, const uint8_t key[RT_KEY_BYTES], rt_preparation *preparation);

/* The writes alone, into `out`; how many octets. */
uint32_t rt_put_writes(const rt_preparation *preparation, uint8_t *out);

/* The permit's bytes, into `out` of RT_MAX_PREPARATION; how many. */
uint32_t rt_seal_preparation(const rt_preparation *preparation, const uint8_t key[RT_KEY_BYTES], uint8_t *out);

#endif
