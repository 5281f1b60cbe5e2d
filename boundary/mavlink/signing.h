/* MAVLink 2 message signing, both ends: https://mavlink.io/en/guide/message_signing.html. `signing.py`. */
#ifndef RT_MAVLINK_SIGNING_H
#define RT_MAVLINK_SIGNING_H

#include "framing.h"

#define RT_MOST_STREAMS 16
#define RT_LEAD 3000000LL /* the distance, in timestamps, of frames signed ahead from those signed now */

/* A stream is identified by system, component, link; with the time of its last frame, and whether its system and component were
   received by this link recently. */
typedef struct {
    uint8_t system, component, link;
    int64_t last; /* timestamp, -1: only `by` counts */
} rt_stream;

typedef struct {
    uint8_t key[RT_KEY_BYTES];
    uint8_t link;
    int64_t ahead;    /* the local timestamp */
    int64_t since_us; /* monotonic time minus the timestamp */
    rt_stream streams[RT_MOST_STREAMS];
    uint32_t stream_count;
    rt_stream heard[RT_MOST_STREAMS]; /* the link by which each sender was last received; `last` is the time */
    uint32_t heard_count;
    bool has_own;
    uint8_t own_system, own_component;
    int64_t promised;     /* the last timestamp of a frame that was signed ahead, 0 where none was, */
    int64_t promised_us;  /* and when the batch began at RT_LEAD, monotonic */
    bool news; /* the stored state changed by more than the passing of time; the caller resets it */
} rt_signed_link;

typedef enum { RT_ACCEPTED, RT_UNSIGNED, RT_FORGED, RT_STRAYED, RT_STALE, RT_CROWDED } rt_heard;

/* `streams` and `timestamp` are those of the previous run. The key is copied. */
void rt_signed_link_begin(rt_signed_link *link, const uint8_t key[RT_KEY_BYTES], int64_t timestamp,
                          const rt_stream *streams, uint32_t count, int64_t utc_us, int64_t monotonic_us, uint8_t id);

/* Sign an unsigned frame of `size` octets in place, with room for RT_SIGNATURE more. Returns the new size. */
uint32_t rt_sign_frame(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t now_us);

/* As above, for a frame for use only when nothing more is signed: its timestamp is above all earlier ones, and RT_LEAD to RT_LEAD + 1 s
   above those signed now. A later regular frame with a greater timestamp voids it. 0 if too many were signed ahead. */
uint32_t rt_sign_ahead(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t now_us);

/* The timestamp that nothing signed exceeds: it is stored. */
int64_t rt_signed_up_to(const rt_signed_link *link);

/* Whether a complete frame with a correct checksum is accepted; only then is it remembered. */
rt_heard rt_accept_frame(rt_signed_link *link, rt_bytes frame, int64_t now_us);

#endif
