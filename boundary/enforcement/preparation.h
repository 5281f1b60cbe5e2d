/* What may be set of an autopilot before a flight, who permits it, and to what it is put back. `preparation.py`. */
#ifndef RT_ENFORCEMENT_PREPARATION_H
#define RT_ENFORCEMENT_PREPARATION_H

#include "wire/preparation.h"

/* how many permits one session seals: what remembers those that were used holds as many */
#define RT_MOST_PREPARATIONS 1024
#define RT_MOST_OWED (2 * RT_MAX_WRITES)

/* What an operator configured, what is owed to the vehicle, and the serial of the permit that was sealed last. */
typedef struct {
    rt_preparation settings;
    rt_write owed[RT_MOST_OWED];
    uint32_t owed_count;
    uint64_t serial;
} rt_issuer;

/* Begin with what was configured, and what earlier runs left to be put back; NULL for nothing. */
void rt_issuer_begin(rt_issuer *issuer, const rt_preparation *settings, const rt_preparation *owed);

/* The permit for what is asked for at a monotonic time, into `out` of RT_MAX_PREPARATION; `size` is how many octets. */
rt_refusal rt_permit_preparation(rt_issuer *issuer, const uint8_t key[RT_KEY_BYTES], rt_bytes ask, int64_t now_us, uint8_t *out,
                                 uint32_t *size);

#endif
