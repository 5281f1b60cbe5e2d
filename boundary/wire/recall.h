/* Recalls: a person's signed order to bring a vehicle home, which ends a mission and starts none. */
#ifndef RT_WIRE_RECALL_H
#define RT_WIRE_RECALL_H

#include "document.h"

/* A recall that is to be trusted here and now: see `open_recall`. One for a whole policy does not reach a mission that was issued
   (`issued_at_us`) after it. */
rt_refusal rt_open_recall(const rt_flight *flight, rt_bytes document, int64_t issued_at_us);

#endif
