#include "boundary_chain.h"

#include "artefact.h"
#include "cose.h"

static const uint8_t LABEL[] = "rtshcua/boundary", FRAMES[] = "rtshcua/boundary-frames", ASIDE[] = "rtshcua/boundary-aside";

static void follow(rt_bytes label, uint8_t digest[RT_DIGEST_BYTES], uint8_t tag, rt_bytes first, rt_bytes second) {
    const uint32_t size = first.size + second.size;
    const uint8_t head[] = {tag, (uint8_t)(size >> 24), (uint8_t)(size >> 16 & 0xFF), (uint8_t)(size >> 8 & 0xFF), (uint8_t)(size & 0xFF)};
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, label);
    rt_sha256_add(&hash, (rt_bytes){digest, RT_DIGEST_BYTES});
    rt_sha256_add(&hash, (rt_bytes){head, sizeof head});
    rt_sha256_add(&hash, first);
    rt_sha256_add(&hash, second);
    rt_sha256_end(&hash, digest);
}

static rt_bytes digest_of(rt_bytes octets, uint8_t digest[RT_DIGEST_BYTES]) {
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, octets);
    rt_sha256_end(&hash, digest);
    return (rt_bytes){digest, RT_DIGEST_BYTES};
}

static const rt_bytes NOTHING = {NULL, 0};

void rt_chain_add(rt_chain *chain, uint8_t tag, rt_bytes first, rt_bytes second) {
    follow((rt_bytes){LABEL, sizeof LABEL}, chain->digest, tag, first, second);
    chain->count++;
    if (chain->marked < RT_MOST_MARKS) memcpy(chain->marks + RT_MARK_BYTES * chain->marked++, chain->digest, RT_MARK_BYTES);
}

void rt_chain_repeat(rt_chain *chain, rt_bytes first, rt_bytes second) {
    chain->repeated++;
    follow((rt_bytes){ASIDE, sizeof ASIDE}, chain->aside, RT_TAG_DECIDED, first, second);
}

void rt_chain_decline(rt_chain *chain, rt_bytes document) {
    uint8_t digest[RT_DIGEST_BYTES];
    chain->declined++;
    follow((rt_bytes){ASIDE, sizeof ASIDE}, chain->aside, RT_TAG_DECLINED, digest_of(document, digest), NOTHING);
}

void rt_chain_stop(rt_chain *chain, rt_bytes frame) {
    uint8_t digest[RT_DIGEST_BYTES];
    chain->stopped++;
    follow((rt_bytes){ASIDE, sizeof ASIDE}, chain->aside, RT_TAG_STOPPED, digest_of(frame, digest), NOTHING);
}

void rt_chain_sign_ahead(rt_chain *chain, rt_bytes frame) {
    uint8_t digest[RT_DIGEST_BYTES];
    chain->ahead++;
    follow((rt_bytes){ASIDE, sizeof ASIDE}, chain->aside, RT_TAG_AHEAD, digest_of(frame, digest), NOTHING);
}

void rt_chain_leave(rt_chain *chain, rt_bytes frame) {
    chain->frames++;
    follow((rt_bytes){FRAMES, sizeof FRAMES}, chain->left, RT_TAG_FRAME, frame, NOTHING);
}

uint32_t rt_sign_statement(rt_chain *chain, const uint8_t seed[RT_KEY_BYTES], const uint8_t *flight, int64_t session,
                           const uint8_t before[RT_DIGEST_BYTES], int64_t source, const rt_now *now, bool final, uint8_t *out) {
    static uint8_t payload[RT_MAX_STATEMENT]; /* the marks are most of its size */
    uint32_t at = rt_wrap(payload, &RT_STATEMENT);
    at += rt_cbor_head(payload + at, RT_MAJOR_ARRAY, 18);
    at += rt_cbor_string(payload + at, RT_MAJOR_OCTETS, (rt_bytes){flight, RT_FLIGHT_BYTES});
    at += rt_cbor_int(payload + at, session);
    at += rt_cbor_string(payload + at, RT_MAJOR_OCTETS, (rt_bytes){before, RT_DIGEST_BYTES});
    at += rt_cbor_int(payload + at, chain->count);
    at += rt_cbor_string(payload + at, RT_MAJOR_OCTETS, (rt_bytes){chain->digest, RT_DIGEST_BYTES});
    at += rt_cbor_string(payload + at, RT_MAJOR_OCTETS, (rt_bytes){chain->marks, RT_MARK_BYTES * chain->marked});
    at += rt_cbor_int(payload + at, chain->frames);
    at += rt_cbor_string(payload + at, RT_MAJOR_OCTETS, (rt_bytes){chain->left, RT_DIGEST_BYTES});
    at += rt_cbor_int(payload + at, chain->repeated);
    at += rt_cbor_int(payload + at, chain->declined);
    at += rt_cbor_int(payload + at, chain->stopped);
    at += rt_cbor_int(payload + at, chain->ahead);
    at += rt_cbor_string(payload + at, RT_MAJOR_OCTETS, (rt_bytes){chain->aside, RT_DIGEST_BYTES});
    at += rt_cbor_int(payload + at, source);
    at += rt_cbor_int(payload + at, now->monotonic_us);
    at += rt_cbor_int(payload + at, now->utc_us);
    at += rt_cbor_int(payload + at, now->utc_error_us);
    payload[at++] = final ? 0xF5 : 0xF4;
    chain->marked = 0;
    return rt_sign1(RT_DUTY_BOUNDARY, true, seed, RT_STATEMENT.content_type, (rt_bytes){payload, at}, out);
}
