/* Made by .make/limits from rtshcua/model/outcome.py. */
#ifndef RT_MODEL_OUTCOME_H
#define RT_MODEL_OUTCOME_H

#include <stdint.h>

enum {
    RT_ADMITTED = 0,
    RT_BINDING_MISMATCH = 1,
    RT_WRONG_VEHICLE = 2,
    RT_POLICY_VERSION = 3,
    RT_ARGUMENT_RANGE = 4,
    RT_REPLAYED = 5,
    RT_ISSUED_IN_FUTURE = 6,
    RT_EXPIRED = 7,
    RT_CLOCK_UNCERTAIN = 8,
    RT_CLASS_NOT_PERMITTED = 9,
    RT_FORBIDDEN = 10,
    RT_FORBID_UNKNOWN = 11,
    RT_NOT_PERMITTED = 12,
    RT_OUT_OF_SCOPE = 13,
    RT_AWAITING_APPROVAL = 14,
    RT_APPROVAL_REFUSED = 15,
    RT_APPROVAL_TIMED_OUT = 16,
    RT_PHASE_NOT_REACHED = 17,
    RT_PHASE_PASSED = 18,
    RT_NO_SLACK = 19,
    RT_STATE_VIOLATED = 20,
    RT_STATE_UNKNOWN = 21,
    RT_ENVELOPE = 22,
    RT_AIRSPACE = 23,
    RT_INVARIANT = 24,
    RT_ENERGY = 25,
    RT_DEGRADED = 26,
    RT_SAFETY_UNKNOWN = 27,
};

/* the outcome that a decision for each reason has */
static const uint8_t rt_outcome_of[] = {0, 1, 1, 1, 1, 1, 1, 1, 2, 1, 1, 2, 1, 1, 2, 1, 1, 2, 1, 3, 3, 2, 3, 3, 3, 3, 3, 2};

#endif
