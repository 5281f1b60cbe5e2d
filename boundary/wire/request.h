/* Requests to `enforce`: a fixed layout, read in place. `request.py`. */
#ifndef RT_WIRE_REQUEST_H
#define RT_WIRE_REQUEST_H

#include "model/flat.h"
#include "wire/permit.h"

#define RT_MAX_REQUEST 1023

typedef struct {
    int64_t kind, step, link;
    uint8_t binding[RT_DIGEST_BYTES];
    rt_now now;
    int64_t released_us, remaining_us, phase;
    rt_state state;
} rt_request;

/* False for octets that are not a request for a state of so many slots and temporal monitors. */
bool rt_read_request(rt_bytes data, int64_t slots, uint32_t monitors, rt_request *request);

#endif
