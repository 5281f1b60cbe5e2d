/* Approvals: a person's signed answer, for one step of one mission, to the `confirm` rules that require an approval. */
#ifndef RT_WIRE_APPROVAL_H
#define RT_WIRE_APPROVAL_H

#include "document.h"

/* A verified answer. `subject`: a grant is about one invocation, by its id; a refusal about every invocation that requests the same, by
   a digest of skill and arguments. `step` is the step in force that it applies to. */
typedef struct {
    uint8_t subject[RT_DIGEST_BYTES];
    int64_t step, role, person, granted, monotonic_us, expires_us;
} rt_answered;

/* The verified answer of a signed approval, if it is trusted now: see `open_approval`. */
rt_refusal rt_open_approval(const rt_flight *flight, rt_bytes document, rt_answered *answered);

/* The verified answers of one flight, in order of arrival: see `Approvals`. */
typedef struct {
    rt_answered held[RT_MAX_ANSWERS];
    uint32_t count;
} rt_approvals;

/* Add an answer: `already-answered` if it is present; `too-many` if there is no room. */
rt_refusal rt_add_answer(rt_approvals *approvals, const rt_answered *answered, const rt_now *now);

/* Set the steps in force. Grants for others are dropped; refusals stay. */
void rt_keep_answers(rt_approvals *approvals, const rt_mission *mission);

/* The approvals for `decide`: one entry for each valid answer, RT_EVERY_RULE, into `out` of RT_MAX_ANSWERS; returns their number. */
uint32_t rt_answers_about(const rt_approvals *approvals, const rt_invocation *invocation, const rt_now *now, rt_approval *out);

#endif
