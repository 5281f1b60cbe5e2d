#include "signing.h"
#include "crypto/crypto.h"

#define EPOCH_US 1420070400000000LL /* 1 January 2015 in UTC us (guide, "Timestamp Handling") */
#define UNIT_US 10
#define MINUTE 6000000LL
#define SECOND 100000LL
#define LAST ((1LL << 48) - 366LL * 24 * 60 * MINUTE) /* timestamps of the last year of the 48 bits are refused */
#define LEADS_EVERY_US 1000000LL /* so an attacker who sends frames signed ahead raises time by RT_LEAD + MOST_AHEAD a second */
#define MOST_AHEAD SECOND /* the greatest distance of frames signed ahead above RT_LEAD, in timestamps: a batch needs some hundreds */
#define STAMP 6
#define TAG 6

static int64_t local_time(const rt_signed_link *link, int64_t now_us) {
    return rt_max(rt_floor(now_us - link->since_us, UNIT_US), link->ahead);
}

static void tag_of(const rt_signed_link *link, const uint8_t *octets, uint32_t size, uint8_t tag[TAG]) {
    uint8_t digest[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){link->key, RT_KEY_BYTES});
    rt_sha256_add(&hash, (rt_bytes){octets, size});
    rt_sha256_end(&hash, digest);
    memcpy(tag, digest, TAG);
}

static rt_stream *of_sender(rt_signed_link *link, uint8_t system, uint8_t component) {
    for (uint32_t at = 0; at < link->heard_count; at++)
        if (link->heard[at].system == system && link->heard[at].component == component)
            return &link->heard[at];
    return NULL;
}

void rt_signed_link_begin(rt_signed_link *link, const uint8_t key[RT_KEY_BYTES], int64_t timestamp,
                          const rt_stream *streams, uint32_t count, int64_t utc_us, int64_t monotonic_us, uint8_t id) {
    int64_t implied = (utc_us - EPOCH_US) / UNIT_US;
    memset(link, 0, sizeof *link);
    memcpy(link->key, key, RT_KEY_BYTES);
    link->link = id;
    link->ahead = rt_max(implied, timestamp);
    link->since_us = monotonic_us - link->ahead * UNIT_US;
    for (uint32_t at = 0; at < count && at < RT_MOST_STREAMS; at++) {
        link->streams[link->stream_count++] = streams[at];
        if (streams[at].last < link->ahead - MINUTE)
            continue;
        rt_stream *heard = of_sender(link, streams[at].system, streams[at].component);
        if (heard == NULL)
            link->heard[link->heard_count++] = streams[at];
        else if (heard->last <= streams[at].last)
            *heard = streams[at];
    }
}

/* Append a signature of this timestamp to a frame; returns its new size. */
static uint32_t signed_at(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t timestamp) {
    rt_set_flags(frame, RT_FLAG_SIGNED);
    frame[size++] = link->link;
    for (uint32_t octet = 0; octet < STAMP; octet++)
        frame[size++] = (uint8_t)(timestamp >> 8 * octet & 0xFF);
    link->has_own = true;
    link->own_system = frame[5];
    link->own_component = frame[6];
    tag_of(link, frame, size, frame + size);
    return size + TAG;
}

uint32_t rt_sign_frame(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t now_us) {
    link->ahead++;
    link->ahead = local_time(link, now_us);
    return signed_at(link, frame, size, link->ahead);
}

uint32_t rt_sign_ahead(rt_signed_link *link, uint8_t *frame, uint32_t size, int64_t now_us) {
    const int64_t begins = local_time(link, now_us) + RT_LEAD;
    if (link->promised >= begins + MOST_AHEAD)
        return 0;
    if (link->promised == 0 || now_us - link->promised_us >= LEADS_EVERY_US) {
        if (begins > link->promised)
            link->promised = begins;
        link->promised_us = now_us;
        link->news = true;
    }
    link->promised++;
    return signed_at(link, frame, size, link->promised);
}

int64_t rt_signed_up_to(const rt_signed_link *link) { return link->promised > link->ahead ? link->promised : link->ahead; }

/* The number of streams without those whose last frame is over a minute old. */
static uint32_t prune(rt_stream *streams, uint32_t count, int64_t local) {
    uint32_t left = 0;
    for (uint32_t at = 0; at < count; at++) {
        const rt_stream each = streams[at];
        if (each.last >= local - MINUTE)
            streams[left++] = each;
    }
    return left;
}

/* A stream over a minute old needs no memory: its time alone refuses the same frames. */
static bool make_room(rt_signed_link *link, bool new_stream, bool new_sender, int64_t local) {
    if (new_stream && link->stream_count == RT_MOST_STREAMS)
        link->stream_count = prune(link->streams, link->stream_count, local);
    if (new_sender && link->heard_count == RT_MOST_STREAMS)
        link->heard_count = prune(link->heard, link->heard_count, local);
    return (!new_stream || link->stream_count < RT_MOST_STREAMS) && (!new_sender || link->heard_count < RT_MOST_STREAMS);
}

rt_heard rt_accept_frame(rt_signed_link *link, rt_bytes frame, int64_t now_us) {
    /* 1. it is signed */
    if (frame.size < RT_HEADER + RT_CHECKSUM + RT_SIGNATURE || (frame.at[RT_FLAGS] & RT_FLAG_SIGNED) == 0)
        return RT_UNSIGNED;
    /* 2. "Computed 48 bit signature does not match": checked before any of its fields is used */
    uint8_t tag[TAG];
    tag_of(link, frame.at, frame.size - TAG, tag);
    if (!rt_equal(tag, frame.at + frame.size - TAG, TAG))
        return RT_FORGED;
    /* 3. it is not one of ours, sent back to us, nor one that its sender sent on another link */
    const uint8_t system = frame.at[5], component = frame.at[6], by = frame.at[frame.size - RT_SIGNATURE];
    rt_stream *sender = of_sender(link, system, component);
    if (link->has_own && system == link->own_system && component == link->own_component && by == link->link)
        return RT_STRAYED;
    if (sender != NULL && sender->link != by)
        return RT_STRAYED;
    /* 4. "Timestamp is older than the previous packet from the same logical stream", or the same: a replay; "more than 1
       minute (6,000,000) behind the local system's timestamp" */
    int64_t timestamp = 0, local = local_time(link, now_us);
    for (uint32_t octet = 0; octet < STAMP; octet++)
        timestamp |= (int64_t)frame.at[frame.size - TAG - STAMP + octet] << 8 * octet;
    rt_stream *stream = NULL;
    for (uint32_t at = 0; at < link->stream_count; at++)
        if (link->streams[at].system == system && link->streams[at].component == component && link->streams[at].link == by)
            stream = &link->streams[at];
    if (timestamp <= (stream == NULL ? -1 : stream->last) || timestamp < local - MINUTE || timestamp > LAST)
        return RT_STALE;
    bool is_new = stream == NULL;
    if (!make_room(link, is_new, sender == NULL, local))
        return RT_CROWDED;
    if (is_new)
        stream = &link->streams[link->stream_count++];
    /* 5. "the timestamp should be replaced by the timestamp of the incoming message if that is greater" */
    link->news = link->news || is_new || timestamp > local + SECOND;
    *stream = (rt_stream){system, component, by, timestamp};
    if (sender == NULL)
        sender = &link->heard[link->heard_count++];
    *sender = *stream;
    if (timestamp > link->ahead)
        link->ahead = timestamp;
    return RT_ACCEPTED;
}
