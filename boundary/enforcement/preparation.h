/* The parameters of an autopilot that may be set before a flight, their permits, and their restoration. `preparation.py`. */
#ifndef RT_ENFORCEMENT_PREPARATION_H
#define RT_ENFORCEMENT_PREPARATION_H

#include "wire/preparation.h"

/* the most permits of one session: the record of used permits has this size */
#define RT_MOST_PREPARATIONS 1024
#define RT_MOST_OWED (2 * RT_MAX_WRITES)

/* The operator's configuration, the parameters owed to the vehicle, and the serial of the last sealed permit. */
typedef struct {
    rt_preparation settings;
    rt_write owed[RT_MOST_OWED];
    uint32_t owed_count;
    uint64_t serial;
} rt_issuer;

/* Begin with the configuration and the owed parameters of earlier runs; NULL for none. */
void rt_issuer_begin(rt_issuer *issuer, const rt_preparation *settings, const rt_preparation *owed);

/* The permit for a request at a monotonic time, into `out` of RT_MAX_PREPARATION; `size` is its size. */
rt_refusal rt_permit_preparation(rt_issuer *issuer, const uint8_t key[RT_KEY_BYTES], rt_bytes ask, int64_t now_us, uint8_t *out,
                                 uint32_t *size);

#endif
