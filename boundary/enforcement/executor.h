/* The only place that turns a permit into a command to send. `executor.py`. */
#ifndef RT_ENFORCEMENT_EXECUTOR_H
#define RT_ENFORCEMENT_EXECUTOR_H

#include "decision/session.h"
#include "frames.h"
#include "preparation.h"
#include "wire/permit.h"

typedef struct {
    uint8_t key[RT_KEY_BYTES];
    const rt_policy *policy;
    const rt_mission *mission; /* a replacement substitutes another */
    bool called_off;           /* no further step may be sent */
    rt_gate gate;
    uint64_t first;            /* the least serial of this session: a boundary may load several bundles one after the other */
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

/* The command of a permit, or of a link by the standing permit of a step that was sent; opens the gate for it. Returns why it is
   refused, or NULL. */
rt_refusal rt_dispatch(rt_executor *executor, rt_bytes sealed, int64_t now_us, rt_permit *permit);
rt_refusal rt_stand_in(rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us, rt_permit *permit);

/* Nothing is sent or set by a permit or a preparation, because its caller's time differs from ours. It is recorded as any refusal. */
rt_refusal rt_dispatch_apart(rt_executor *executor, int64_t now_us);
rt_refusal rt_prepare_apart(rt_executor *executor);

/* Withdraw the permit of a step of which no frame was or can have been sent: its step may be decided again in this session. Returns why
   it is not withdrawn, or NULL. */
rt_refusal rt_withdraw(rt_executor *executor, rt_session *session, rt_bytes sealed, int64_t now_us);

/* The parameters that a preparation permit allows to be set, or why it is refused. It is valid once, on the ground, until
   `rt_gate_prepared`, a dispatch, or the end of its time. */
rt_refusal rt_executor_prepare(rt_executor *executor, rt_bytes sealed, int64_t now_us);

/* What `rt_stand_in` would permit now, and its command; or why it would be refused. Changes nothing. */
rt_refusal rt_may_stand_in(const rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us,
                           rt_permit *permit, rt_command *command);

void rt_ended(rt_executor *executor);                        /* the running step ended in any way */
void rt_ended_command(rt_executor *executor, uint64_t token); /* that command ended; a later one continues */
void rt_landed(rt_executor *executor);                       /* standing permits lapse */
void rt_release(rt_executor *executor);                      /* send nothing more that moves the vehicle */

#endif
