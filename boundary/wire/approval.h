/* Approvals: a person's signed answer to the `confirm` rules that ask for one, about one step of one mission. */
#ifndef RT_WIRE_APPROVAL_H
#define RT_WIRE_APPROVAL_H

#include "document.h"

/* A verified answer. `subject` is what it is about: a grant is about one invocation, by its id; a refusal about whatever
   invocation asks for the same, by a digest of skill and arguments. `step` is the one in force that it counts for. */
typedef struct {
    uint8_t subject[RT_DIGEST_BYTES];
    int64_t step, role, person, granted, monotonic_us, expires_us;
} rt_answered;

/* What a signed approval answers, if it is to be trusted here and now: see `open_approval`. */
rt_refusal rt_open_approval(const rt_flight *flight, rt_bytes document, rt_answered *answered);

/* The verified answers of one flight, in the order in which they came: see `Approvals`. */
typedef struct {
    rt_answered held[RT_MAX_ANSWERS];
    uint32_t count;
} rt_approvals;

/* Take an answer in: `already-answered` for one that is there already; `too-many` where none fits any more. */
rt_refusal rt_add_answer(rt_approvals *approvals, const rt_answered *answered, const rt_now *now);

/* These are the steps now. Grants of others are dropped; refusals stay. */
void rt_keep_answers(rt_approvals *approvals, const rt_mission *mission);

/* What `decide` is told: of each answer that counts one entry, RT_EVERY_RULE, into `out` of RT_MAX_ANSWERS; how many. */
uint32_t rt_answers_about(const rt_approvals *approvals, const rt_invocation *invocation, const rt_now *now, rt_approval *out);

#endif
