/* MAVLink 2 message signing, both ends: https://mavlink.io/en/guide/message_signing.html. `signing.py`. */
#ifndef RT_MAVLINK_SIGNING_H
#define RT_MAVLINK_SIGNING_H

#include "framing.h"

#define RT_MOST_STREAMS 16
#define RT_LEAD 3000000LL /* what is signed ahead begins so far, in timestamps, before what is signed now */

/* What a stream is named by: system, component, link; when it was last heard, and whether its system and component were heard by
   this link lately. */
typedef struct {
    uint8_t system, component, link;
    int64_t last; /* timestamp, -1: only `by` counts */
} rt_stream;

typedef struct {
    uint8_t key[RT_KEY_BYTES];
    uint8_t link;
    int64_t ahead;    /* the local timestamp */
    int64_t since_us; /* monotonic time less the timestamp */
    rt_stream streams[RT_MOST_STREAMS];
    uint32_t stream_count;
    rt_stream heard[RT_MOST_STREAMS]; /* by which link each sender was heard last; `last` says when */
    uint32_t heard_count;
    bool has_own;
    uint8_t own_system, own_component;
    int64_t promised;     /* the last timestamp of a frame that was signed ahead, 0 where none was, */
    int64_t promised_us;  /* and when they last began at RT_LEAD, monotonic */
    bool news; /* there is more to keep than time going by; the caller takes it back */
} rt_signed_link;

typedef enum { RT_ACCEPTED, RT_UNSIGNED, RT_FORGED, RT_STRAYED, RT_STALE, RT_CROWDED } rt_heard;

/* `streams` and `timestamp` are those of the run before. The key is copied. */
void rt_signed_link_begin(rt_signed_link *link, const uint8_t key[RT_KEY_BYTES], int64_t timestamp,
                          const rt_stream *streams, uint32_t count, int64_t utc_us, int64_t monotonic_us, uint8_t id);

/* Sign an unsigned frame of `size` octets in place; there is room for RT_SIGNATURE more. Answers the new size. */
uint32_t rt_sign_frame(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t now_us);

/* The same for a frame that is to be sent only when nothing more is signed: its timestamp is above all that were promised before,
   and RT_LEAD to RT_LEAD + 1 s above what is signed now. Whatever leaves once that time has come voids it. 0 where too many were
   signed so. */
uint32_t rt_sign_ahead(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t now_us);

/* The timestamp above which nothing was signed: what is kept. */
int64_t rt_signed_up_to(const rt_signed_link *link);

/* Whether a whole frame with a right checksum may come in; only then is it remembered. */
rt_heard rt_accept_frame(rt_signed_link *link, rt_bytes frame, int64_t now_us);

#endif
