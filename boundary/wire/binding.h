/* The binding (paper symbol B): one digest over an invocation and everything that it depends on; and its id. */
#ifndef RT_WIRE_BINDING_H
#define RT_WIRE_BINDING_H

#include "../model/flat.h"

/* The additional input of a replacement's ids. */
typedef struct {
    rt_bytes flight, supersedes;
    int64_t kept;
} rt_after;

/* Whether every invocation has the computed binding. */
bool rt_all_bound(const rt_mission *mission);

/* Whether every invocation has the id computed from the mission, and from `after` unless that is NULL. */
bool rt_all_named(const rt_mission *mission, const rt_after *after);

#endif
