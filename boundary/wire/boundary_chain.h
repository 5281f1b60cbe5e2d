/* The boundary's own evidence (paper symbol d_ev): one digest over everything that it decided, accepted and sent; and its signed
   statements. `boundary_chain.py`, `statement.py`. */
#ifndef RT_WIRE_BOUNDARY_CHAIN_H
#define RT_WIRE_BOUNDARY_CHAIN_H

#include "../crypto/crypto.h"
#include "../model/flat.h"

#define RT_MARK_BYTES 8
#define RT_MOST_MARKS 128

/* the kind of an entry */
enum {
    RT_TAG_BEGIN = 1, RT_TAG_DECIDED = 2, RT_TAG_UNDECIDED = 3, RT_TAG_DOCUMENT = 4, RT_TAG_DECLINED = 5, RT_TAG_SENT = 6,
    RT_TAG_REFUSED = 7, RT_TAG_PREPARED = 8, RT_TAG_UNPREPARED = 9, RT_TAG_FRAME = 10, RT_TAG_STOPPED = 11, RT_TAG_AHEAD = 12
};

/* The digest after `count` entries, that of so many `frames`, and the one `aside`, of what is only counted. */
typedef struct {
    uint8_t digest[RT_DIGEST_BYTES], left[RT_DIGEST_BYTES], aside[RT_DIGEST_BYTES];
    int64_t count, frames, repeated, declined, stopped, ahead;
    uint8_t marks[RT_MARK_BYTES * RT_MOST_MARKS];
    uint32_t marked;
    bool over; /* its end was signed: its owner must refuse everything */
} rt_chain;

/* Add an entry, whose payload has two parts, either of which may be empty. */
void rt_chain_add(rt_chain *chain, uint8_t tag, rt_bytes first, rt_bytes second);
/* Count a repeated answer, a refused document and a refused frame: the digest does not change. */
void rt_chain_repeat(rt_chain *chain, rt_bytes first, rt_bytes second);
void rt_chain_decline(rt_chain *chain, rt_bytes document);
void rt_chain_stop(rt_chain *chain, rt_bytes frame);
/* Count a frame that was signed ahead. The boundary does not see whether it is sent, so the digest does not change. */
void rt_chain_sign_ahead(rt_chain *chain, rt_bytes frame);
/* Add a frame that carries out a command, given as octets. */
void rt_chain_leave(rt_chain *chain, rt_bytes frame);

#define RT_MAX_STATEMENT 2048

/* Sign the state of a session, with the time by a clock from that source, into `out` of RT_MAX_STATEMENT octets; returns their number.
   The marks begin anew. */
uint32_t rt_sign_statement(rt_chain *chain, const uint8_t seed[RT_KEY_BYTES], const uint8_t *flight, int64_t session,
                           const uint8_t before[RT_DIGEST_BYTES], int64_t source, const rt_now *now, bool final, uint8_t *out);

#endif
