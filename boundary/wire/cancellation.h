/* Cancellations: a proposer's signed word that its mission is not to go on, which brings the vehicle home. */
#ifndef RT_WIRE_CANCELLATION_H
#define RT_WIRE_CANCELLATION_H

#include "document.h"

/* A cancellation that is to be trusted here and now; the steps from `current` on are set aside. See `open_cancellation`. */
rt_refusal rt_open_cancellation(const rt_flight *flight, rt_bytes document, uint32_t current);

#endif
