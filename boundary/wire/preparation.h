/* The preparation permit: the parameters of the vehicle that may be set on the ground, with their values. `preparation.py`. */
#ifndef RT_WIRE_PREPARATION_H
#define RT_WIRE_PREPARATION_H

#include "../base.h"

#define RT_MAX_WRITES 32
#define RT_PARAMETER_NAME 16
#define RT_MAX_PREPARATION (19 + RT_MAX_WRITES * 24 + 32)

/* One parameter: its name, padded with NULs, its present value and its new value: the 32 bits of a float. */
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

/* The preparation of a body without its seal; false for malformed octets. */
bool rt_read_preparation(rt_bytes body, rt_preparation *preparation);

/* Also false for bytes that this key did not seal. */
bool rt_open_preparation(rt_bytes sealed, const uint8_t key[RT_KEY_BYTES], rt_preparation *preparation);

/* The writes only, into `out`; returns their size. */
uint32_t rt_put_writes(const rt_preparation *preparation, uint8_t *out);

/* The permit's bytes, into `out` of RT_MAX_PREPARATION; returns their size. */
uint32_t rt_seal_preparation(const rt_preparation *preparation, const uint8_t key[RT_KEY_BYTES], uint8_t *out);

#endif
