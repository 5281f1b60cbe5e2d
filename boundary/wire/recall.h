/* Recalls: a person's signed order to bring a vehicle home. A recall ends a mission and starts none. */
#ifndef RT_WIRE_RECALL_H
#define RT_WIRE_RECALL_H

#include "document.h"

/* The recall in a document, if it is trusted now: see `open_recall`. A recall of a whole policy does not apply to a mission that was
   issued (`issued_at_us`) after it. */
rt_refusal rt_open_recall(const rt_flight *flight, rt_bytes document, int64_t issued_at_us);

#endif
