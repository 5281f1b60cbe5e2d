/* The only place that turns a permit into something to send. `executor.py`. */
#ifndef RT_ENFORCEMENT_EXECUTOR_H
#define RT_ENFORCEMENT_EXECUTOR_H

#include "decision/session.h"
#include "frames.h"
#include "preparation.h"
#include "wire/permit.h"

typedef struct {
    uint8_t key[RT_KEY_BYTES];
    const rt_policy *policy;
    const rt_mission *mission; /* a replacement puts another in its place */
    bool called_off;           /* no step may be sent any more */
    rt_gate gate;
    uint64_t first;            /* the least serial of this session: a boundary may load one bundle in the place of another */
    uint64_t used[RT_MAX_DISPATCHED]; /* serials, ascending */
    uint32_t used_count;
    uint8_t prepared[RT_MOST_PREPARATIONS / 8]; /* the serials of preparations that were begun */
    int64_t step; /* the last step that was sent, -1 before, */
    uint64_t serial;
    bool running;
    int64_t before; /* the step that was sent before it, */
    uint64_t before_serial;
    uint64_t last; /* the permit that was dispatched last */
    bool flies;
    uint64_t flight; /* the first step permit of this flight, while it flies */
    int64_t fallback_step, fallback_link; /* the step whose chain was last in use, and the last link sent */
    int64_t contingency;                  /* the last link of the contingency that was sent */
    bool homeward, final;
} rt_executor;

void rt_executor_begin(rt_executor *executor, const uint8_t key[RT_KEY_BYTES], const rt_policy *policy, const rt_mission *mission,
                       uint64_t first);

/* Send the command of a permit, or of a link by the standing permit of a step that was sent: the gate is open for it then.
   Answer why not, or NULL and what is permitted. */
rt_refusal rt_dispatch(rt_executor *executor, rt_bytes sealed, int64_t now_us, rt_permit *permit);
rt_refusal rt_stand_in(rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us, rt_permit *permit);

/* By a permit, or a preparation, nothing is sent or set: its caller's time is not ours. That is told as any refusal of one is. */
rt_refusal rt_dispatch_apart(rt_executor *executor, int64_t now_us);
rt_refusal rt_prepare_apart(rt_executor *executor);

/* Give the permit of a step up of which no frame left, nor may one have: its step may be decided again then, in this session. Why it
   is not given up, or NULL. */
rt_refusal rt_withdraw(rt_executor *executor, rt_session *session, rt_bytes sealed, int64_t now_us);

/* What may be set of the vehicle from now on, by a preparation permit, or why nothing may. It is good once, on the ground, until
   `rt_gate_prepared`, a dispatch, or its time is over. */
rt_refusal rt_executor_prepare(rt_executor *executor, rt_bytes sealed, int64_t now_us);

/* What `rt_stand_in` would permit now, and its command; or why it would not. Nothing is sent, and nothing changes. */
rt_refusal rt_may_stand_in(const rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us,
                           rt_permit *permit, rt_command *command);

void rt_ended(rt_executor *executor);                        /* the running step ended, however it did */
void rt_ended_command(rt_executor *executor, uint64_t token); /* that command ended; another since runs on */
void rt_landed(rt_executor *executor);                       /* standing permits lapse */
void rt_release(rt_executor *executor);                      /* send nothing more that moves the vehicle */

#endif
