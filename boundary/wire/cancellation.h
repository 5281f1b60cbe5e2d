/* Cancellations: a proposer's signed order to stop its mission, after which the vehicle returns by the contingency. */
#ifndef RT_WIRE_CANCELLATION_H
#define RT_WIRE_CANCELLATION_H

#include "document.h"

/* The cancellation in a document, if it is trusted now; it cancels the steps from `current` on. See `open_cancellation`. */
rt_refusal rt_open_cancellation(const rt_flight *flight, rt_bytes document, uint32_t current);

#endif
