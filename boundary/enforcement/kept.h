/* The state that a boundary keeps across a restart, in one file of two slots that are written alternately: an interrupted write leaves
   the other intact. Mirrors adapters/store/opened_missions.py (opened missions, versions of policies) and adapters/store/signing.py. */
#ifndef RT_ENFORCEMENT_KEPT_H
#define RT_ENFORCEMENT_KEPT_H

#include "mavlink/signing.h"
#include "model/limits.h"

typedef struct {
    uint8_t digest[RT_DIGEST_BYTES];
    int64_t expires_us; /* UTC */
} rt_opened;

typedef struct {
    uint8_t name[RT_DIGEST_BYTES]; /* SHA-256 of it */
    int64_t version;
} rt_version;

typedef struct {
    uint64_t layout;   /* RT_KEPT_LAYOUT */
    uint64_t turn;     /* the slot with the greater number is valid */
    uint64_t restarts; /* how often a boundary began with it */
    int64_t floor_us;  /* missions that expire by then were opened, or may have been */
    uint64_t opened_count, version_count, stream_count;
    rt_opened opened[RT_MOST_OPENED];
    uint8_t instance[RT_KEY_BYTES]; /* the owner: the boundary's public key, zeros if any boundary may use it. Layout 2 has one mission
                                       more */
    int64_t since_us;               /* missions issued before are not opened, because another file may have existed then; UTC */
    uint8_t session_digest[RT_DIGEST_BYTES]; /* of its own evidence, and the number of that session. Layout 1 has one mission more */
    int64_t session;
    rt_version versions[RT_MOST_POLICIES];
    int64_t link_timestamp;
    rt_stream streams[RT_MOST_STREAMS];
    uint8_t check[RT_DIGEST_BYTES]; /* SHA-256 over all before */
} rt_kept;

/* The contents of a new file without state: an empty file is damage, not a first start. */
typedef struct {
    uint64_t layout; /* RT_KEPT_FIRST */
    int64_t since_us;
    uint8_t instance[RT_KEY_BYTES];
    uint8_t check[RT_DIGEST_BYTES]; /* SHA-256 over all before */
} rt_kept_first;

#define RT_KEPT_FIRST 0x7274736863756100ULL
#define RT_KEPT_LAYOUT 0x7274736863756103ULL
#define RT_KEPT_LAYOUT_2 0x7274736863756102ULL
#define RT_KEPT_LAYOUT_1 0x7274736863756101ULL

/* Begin with a file that says that it has no state. False for any other file. */
bool rt_first_kept(const rt_kept_first *first, rt_kept *kept);
/* Whether it belongs to a boundary with this public key, NULL for none. */
bool rt_kept_is_of(const rt_kept *kept, const uint8_t *public_key);

/* Whether a mission may be opened at a time (UTC), issued at another; NULL, "replayed", "before-provisioned", "old-policy", or "full"
   if there is no room. */
rt_refusal rt_may_open(const rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES], int64_t issued_us, int64_t expires_us,
                       const uint8_t policy[RT_DIGEST_BYTES], int64_t version, int64_t now_us);
bool rt_was_opened(const rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES]);
/* Open it: missions that expired by `now_us` (UTC) are removed, which raises the floor. */
void rt_open_mission(rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES], int64_t expires_us,
                     const uint8_t policy[RT_DIGEST_BYTES], int64_t version, int64_t now_us);

void rt_forget_mission(rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES]);

void rt_seal_kept(rt_kept *kept);            /* before it is written */
bool rt_is_whole_kept(const rt_kept *kept); /* after it was read: in this layout, or the previous one, */
void rt_upgrade_kept(rt_kept *kept);        /* or the one before that, which is converted */

#endif
