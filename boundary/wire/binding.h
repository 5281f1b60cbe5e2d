/* The binding (paper symbol B): one digest over everything that an invocation says and rests on; and its id. */
#ifndef RT_WIRE_BINDING_H
#define RT_WIRE_BINDING_H

#include "../model/flat.h"

/* What the ids of a replacement follow from beside its mission. */
typedef struct {
    rt_bytes flight, supersedes;
    int64_t kept;
} rt_after;

/* Whether every invocation has the binding that it must carry. */
bool rt_all_bound(const rt_mission *mission);

/* Whether every invocation has the id that follows from the mission, and from `after` where that is not NULL. */
bool rt_all_named(const rt_mission *mission, const rt_after *after);

#endif
