/* The calls to a boundary outside of the runtime, and their answers: octets in, octets out, over any transport. The other end is
   rtshcua/onboard/enforcement/isolated.py. A call is one octet for its kind, followed by its data, big-endian; an answer is 0 and the
   result, or 1 and the slug of a refusal. Data of a caller is only trusted by its seal, and every call is answered. */
#ifndef RT_ENFORCEMENT_CALLS_H
#define RT_ENFORCEMENT_CALLS_H

#include "boundary.h"

enum {
    RT_CALL_PART = 1,     /* for which (1: LOAD, PRESENT), where (4), octets: a part of what that call is about */
    RT_CALL_LOAD = 2,     /* now (24), size (4) -> flight (16), whether it was opened before (1) */
    RT_CALL_ENFORCE = 3,  /* a request -> a response */
    RT_CALL_PRESENT = 4,  /* now (24), released (4), size (4) -> a receipt */
    RT_CALL_DISPATCH = 5, /* now (8), a permit -> kind (1), step (2), link (2), serial (8), not after (8) */
    RT_CALL_STAND_IN = 6, /* now (8), kind (1), link (1), the standing permit -> as DISPATCH */
    RT_CALL_ENDED = 7,    /* token (8) or nothing */
    RT_CALL_LANDED = 8,
    RT_CALL_RELEASE = 9,
    RT_CALL_OBSERVE = 10, /* now (8), a frame as received -> its verdict (1): rt_heard */
    RT_CALL_SEAL = 11,    /* now (8), a frame -> the octets to send */
    RT_CALL_BEGIN = 12,     /* the proposed session (8) and digest of the previous one (32) -> the accepted ones */
    RT_CALL_STATEMENT = 13, /* whether it is the last (1), now (24) -> a signed statement of the boundary's own evidence */
    RT_CALL_DIGEST = 14,    /* -> the digest of that (32) */
    RT_CALL_PERMIT = 15,    /* now (8), the parameters to set -> their preparation permit */
    RT_CALL_PREPARE = 16,   /* now (8), a preparation permit */
    RT_CALL_PREPARED = 17,  /* nothing more is set */
    RT_CALL_STANDS = 18,    /* now (8) -> whether the vehicle is known to be on the ground (1) */
    RT_CALL_AHEAD = 19, /* now (8), kind (1), link (1), the standing permit (56), then each frame of the link: size (2), octets
                           -> the serial of the link's permit (8), then the signature of each frame (13) if the link has a key */
    RT_CALL_FLIGHT = 20, /* -> the id of the flight that the next bundle begins (16) */
    RT_CALL_LOG = 21,    /* the checkpoint that begins the log of the flight -> its signature by the log's key (64) */
    RT_CALL_TIME = 22,   /* whether to stop waiting for a better source (1) -> the source of the time of day (1), now by it (24), and
                            the number that the vehicle must return in TIMESYNC (8), 0 for none */
    RT_CALL_WITHDRAW = 23, /* now (8), the permit of a step, of which nothing was sent: it may be decided again */
    RT_CALL_HOME = 24 /* -> an attestation token (RFC 9711) of the home */
};

#define RT_MAX_CALL (RT_MAX_PART + 64)
#define RT_MAX_RESULT (RT_MAX_STATEMENT + 64)

/* Answer one call into `out` of RT_MAX_RESULT octets; returns the size of the answer. `own_us` is our own monotonic time, -1 if there
   is only the caller's. */
uint32_t rt_answer(rt_boundary *boundary, rt_bytes call, int64_t own_us, uint8_t *out);

/* Revoke the last answer, because it could not be stored: nothing more is sent, and the answer in `out` becomes a refusal. */
uint32_t rt_take_back(rt_boundary *boundary, uint8_t *out);

#endif
