/* The rules of one session: which step is current, which ids are used up, what may be asked for again, what is decided about
   links, and what is in force. `session.py`. */
#ifndef RT_DECISION_SESSION_H
#define RT_DECISION_SESSION_H

#include "decide.h"
#include "wire/approval.h"
#include "wire/permit.h"
#include "wire/receipt.h"
#include "wire/replacement.h"

/* The steps that one flight may ever know: those of its bundle, and what fits into the replacements that it takes. */
#define RT_MAX_KNOWN (RT_MAX_INVOCATIONS + RT_MAX_REPLACEMENTS * 2048)

/* Status of wire/response.py: whether `enforce` decided, and if not, why. */
typedef enum { RT_DECIDED = 0, RT_MALFORMED = 1, RT_UNKNOWN_STEP = 2, RT_NOT_CURRENT = 3,
               RT_CLOCK_APART = 4, RT_CLOCK_UNKNOWN = 5 } rt_status;

/* The verified bundle and its invocations; after a replacement, with those of the mission that flies now. */
typedef struct {
    const rt_root *root;
    rt_bytes vehicle;
    uint8_t flight[RT_FLIGHT_BYTES];
    rt_bundle bundle;
    rt_prepared_policy prepared;
    bool recalled, cancelled; /* by whose word no step may begin any more: a person's, or the proposer's own */
    int64_t received_us[RT_MAX_INVOCATIONS]; /* when each step was received on board, monotonic (paper symbol t_r) */
    int64_t issued_at_us;                    /* of what flies first: the earliest of the mission and its steps */
    uint8_t missions[1 + RT_MAX_REPLACEMENTS][RT_DIGEST_BYTES]; /* that was opened, and that replaced it since */
    uint32_t mission_count;
    rt_approvals approvals;
    rt_bytes replaced[RT_MAX_KNOWN]; /* invocations that were in force, and are not any more */
    uint32_t replaced_count;
    rt_bytes known[RT_MAX_KNOWN]; /* the ids of all steps that ever were in force */
    uint32_t known_count;
    rt_replacement arriving; /* what is looked at */
} rt_in_force;

/* An invocation that was prepared last; `step` is -1 where there is none. */
typedef struct {
    int64_t step;
    rt_prepared_invocation invocation;
} rt_kept_invocation;

typedef struct {
    rt_in_force in_force;
    rt_kept_invocation kept[2]; /* a step, and the one before or behind it, whose links may still be asked for */
    uint8_t consumed[RT_MAX_INVOCATIONS / 8];
    int64_t latest;  /* the last step that was asked for and not denied, -1 before, */
    int64_t allowed; /* and the last that may have been sent */
} rt_session;

/* Open a bundle for a flight that begins: its signatures, what it says, and that it makes sense. The bytes stay where they are. */
rt_refusal rt_session_begin(rt_session *session, rt_bytes bundle, const rt_root *root, rt_bytes vehicle,
                            const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *now);

/* Whether no step may begin any more. */
static inline bool rt_called_off(const rt_session *session) { return session->in_force.recalled || session->in_force.cancelled; }

bool rt_is_consumed(const rt_session *session, int64_t step);

/* Why nothing is decided about a step or a link: there is none, or its turn is not now. */
rt_status rt_turn_of(const rt_session *session, int64_t kind, int64_t step, int64_t link);

/* The step's invocation, prepared. It stands until two others were asked for. */
rt_prepared_invocation *rt_step_at(rt_session *session, int64_t step);

/* Decide on a step, or on a link under the binding presented, that may be asked for; of a step it is remembered. `target` of an
   allowed DEGRADE is `-1 - rule`. */
void rt_decide_step(rt_session *session, int64_t step, const rt_state *state, const rt_context *context, const rt_now *now,
                    rt_decision *decision);
void rt_decide_link(rt_session *session, int64_t kind, int64_t step, int64_t link, rt_bytes binding, const rt_state *state,
                    const rt_now *now, rt_decision *decision);

/* Of a step that was admitted nothing was sent, and nothing will be: its id is unused again. False where it is not the last that was
   asked for, or its id is not used up. */
bool rt_session_give_back(rt_session *session, int64_t step);

/* What became of a document: `refused` is why it was not accepted, NULL where it was; the others as in a receipt. */
typedef struct {
    int64_t kind;
    rt_refusal refused;
    int64_t step, role, granted, expires_us;
} rt_taken;

/* Take in a signed document, if it is to be trusted: see `Session.take`. An accepted replacement's bytes must stay where they are. */
void rt_take_document(rt_session *session, rt_bytes document, const rt_now *now, int64_t released, rt_taken *taken);

#endif
