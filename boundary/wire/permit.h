/* Permits: `enforce` issues them, and the executor checks them before anything is sent. `permit.py`. */
#ifndef RT_WIRE_PERMIT_H
#define RT_WIRE_PERMIT_H

#include "../base.h"

#define RT_PERMIT_BODY 24 /* version, kind, step, link, serial, fallbacks, contingencies, not_after_us; big-endian */
#define RT_PERMIT_BYTES (RT_PERMIT_BODY + 32)
#define RT_LINK_VALID_US 1000000LL
#define RT_AGAIN 16

/* the kinds of requests and permits */
enum { RT_STEP = 0, RT_FALLBACK_LINK = 1, RT_CONTINGENCY_LINK = 2 };

typedef struct {
    int64_t kind, step, link; /* of the request; `link` of a degrade rule's target is -1 - rule */
    uint64_t serial;
    int64_t fallbacks, contingencies, not_after_us;
} rt_permit;

void rt_seal_permit(const rt_permit *permit, const uint8_t key[RT_KEY_BYTES], uint8_t sealed[RT_PERMIT_BYTES]);

/* False for bytes that this key did not seal. */
bool rt_open_permit(rt_bytes sealed, const uint8_t key[RT_KEY_BYTES], rt_permit *permit);

#endif
