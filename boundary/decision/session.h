/* The rules of one session: which step is current, which ids are used, what may be requested again, what is decided about links, and
   what is in force. `session.py`. */
#ifndef RT_DECISION_SESSION_H
#define RT_DECISION_SESSION_H

#include "decide.h"
#include "wire/approval.h"
#include "wire/permit.h"
#include "wire/receipt.h"
#include "wire/replacement.h"

/* The greatest number of steps in one flight: those of its bundle, and of its replacements. */
#define RT_MAX_KNOWN (RT_MAX_INVOCATIONS + RT_MAX_REPLACEMENTS * (RT_MAX_DOCUMENT / 128))

/* Status of wire/response.py: whether `enforce` decided, or why not. */
typedef enum { RT_DECIDED = 0, RT_MALFORMED = 1, RT_UNKNOWN_STEP = 2, RT_NOT_CURRENT = 3,
               RT_CLOCK_APART = 4, RT_CLOCK_UNKNOWN = 5 } rt_status;

/* The verified bundle and its invocations; after a replacement, those of the new mission. */
typedef struct {
    const rt_root *root;
    rt_bytes vehicle;
    uint8_t flight[RT_FLIGHT_BYTES];
    rt_bundle bundle;
    rt_prepared_policy prepared;
    bool recalled, cancelled; /* no further step may begin, by order of a person or of the proposer */
    int64_t received_us[RT_MAX_INVOCATIONS]; /* when each step was received on board, monotonic (paper symbol t_r) */
    int64_t issued_at_us;                    /* of the first mission: the earliest issue of the mission and its steps */
    uint8_t missions[1 + RT_MAX_REPLACEMENTS][RT_DIGEST_BYTES]; /* the first mission and its replacements */
    uint32_t mission_count;
    rt_approvals approvals;
    rt_bytes replaced[RT_MAX_KNOWN]; /* invocations that were in force and no longer are */
    uint32_t replaced_count;
    rt_bytes known[RT_MAX_KNOWN]; /* the ids of all steps that were ever in force */
    uint32_t known_count;
    rt_replacement arriving; /* the document under examination */
} rt_in_force;

/* The last prepared invocations; `step` is -1 if there is none. */
typedef struct {
    int64_t step;
    rt_prepared_invocation invocation;
} rt_kept_invocation;

typedef struct {
    rt_in_force in_force;
    rt_kept_invocation kept[2]; /* a step, and the one before or after it, whose links may still be requested */
    uint8_t consumed[RT_MAX_INVOCATIONS / 8];
    int64_t latest;  /* the last step that was requested and not denied, -1 before, */
    int64_t allowed; /* and the last that may have been sent */
} rt_session;

/* Open a bundle for a new flight: verify its signatures and check its contents. The bytes must stay in place. */
rt_refusal rt_session_begin(rt_session *session, rt_bytes bundle, const rt_root *root, rt_bytes vehicle,
                            const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *now);

/* Whether no further step may begin. */
static inline bool rt_called_off(const rt_session *session) { return session->in_force.recalled || session->in_force.cancelled; }

bool rt_is_consumed(const rt_session *session, int64_t step);

/* Why no decision is made about a step or a link: it does not exist, or it is not its turn. */
rt_status rt_turn_of(const rt_session *session, int64_t kind, int64_t step, int64_t link);

/* The step's prepared invocation. It is valid until two others were requested. */
rt_prepared_invocation *rt_step_at(rt_session *session, int64_t step);

/* Decide on a step, or on a link under the given binding, that may be requested; a step is remembered. `target` of an allowed DEGRADE
   is `-1 - rule`. */
void rt_decide_step(rt_session *session, int64_t step, const rt_state *state, const rt_context *context, const rt_now *now,
                    rt_decision *decision);
void rt_decide_link(rt_session *session, int64_t kind, int64_t step, int64_t link, rt_bytes binding, const rt_state *state,
                    const rt_now *now, rt_decision *decision);

/* Release the id of an admitted step of which nothing was sent and nothing will be. False unless it is the last requested step and its
   id is used. */
bool rt_session_give_back(rt_session *session, int64_t step);

/* The result of a document: `refused` is the reason, NULL if it was accepted; the others as in a receipt. */
typedef struct {
    int64_t kind;
    rt_refusal refused;
    int64_t step, role, granted, expires_us;
} rt_taken;

/* Accept a signed document if it is trusted: see `Session.take`. The bytes of an accepted replacement must stay in place. */
void rt_take_document(rt_session *session, rt_bytes document, const rt_now *now, int64_t released, rt_taken *taken);

#endif
