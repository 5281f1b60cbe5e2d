#include "attestation.h"

#include "../crypto/crypto.h"
#include "cbor.h"
#include "cose.h"
#include "keys.h"

/* claims: RFC 9711, section 4, and our own, for private use (RFC 8392, section 9.1) */
enum { NONCE = 10, UEID = 256, DEBUG = 263, PROFILE = 265, BOOT_COUNT = 267, SOFTWARE = 270, MEASUREMENTS = 273 };
enum { MODE = -70001, EVIDENCE = -70002, MEASURES = -70003, KEYS = -70004, CLAIMS = 11 };
enum { CBOR_CONTENT = 60, SHA_256 = -16, RANDOM_UEID = 1, UEID_BYTES = 16 };

#define LITERAL(text) ((rt_bytes){(const uint8_t *)(text), sizeof(text) - 1})

void rt_name_link_key(const uint8_t key[RT_KEY_BYTES], uint8_t name[RT_LINK_NAME]) {
    static const uint8_t domain[] = "rtshcua/link-key";
    uint8_t digest[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){domain, sizeof domain});
    rt_sha256_add(&hash, (rt_bytes){key, RT_KEY_BYTES});
    rt_sha256_end(&hash, digest);
    memcpy(name, digest, RT_LINK_NAME);
}

static uint32_t put_octets(uint8_t *out, const uint8_t *octets, uint32_t size) {
    return rt_cbor_string(out, RT_MAJOR_OCTETS, (rt_bytes){octets, size});
}

/* Names one boundary: by its public key. */
static uint32_t put_ueid(uint8_t *out, const uint8_t public[RT_KEY_BYTES]) {
    uint8_t digest[RT_DIGEST_BYTES], ueid[1 + UEID_BYTES] = {RANDOM_UEID};
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){public, RT_KEY_BYTES});
    rt_sha256_end(&hash, digest);
    memcpy(ueid + 1, digest, UEID_BYTES);
    return put_octets(out, ueid, sizeof ueid);
}

/* An array of one measurement: its content format, and a map of the algorithm and the digest. */
static uint32_t put_measurements(uint8_t *out, const uint8_t code[RT_DIGEST_BYTES]) {
    uint8_t content[48] = {0xA2};
    uint32_t size = 1;
    size += rt_cbor_int(content + size, 1);
    size += rt_cbor_int(content + size, SHA_256);
    size += rt_cbor_int(content + size, 2);
    size += put_octets(content + size, code, RT_DIGEST_BYTES);
    uint32_t at = rt_cbor_head(out, RT_MAJOR_ARRAY, 1);
    at += rt_cbor_head(out + at, RT_MAJOR_ARRAY, 2);
    at += rt_cbor_int(out + at, CBOR_CONTENT);
    return at + put_octets(out + at, content, size);
}

/* The names of the keys of log and link, empty for those that it does not have. */
static uint32_t put_keys(uint8_t *out, const rt_attested_state *state) {
    uint8_t public[RT_KEY_BYTES], kid[RT_KID_BYTES], link[RT_LINK_NAME];
    if (state->log_seed != NULL) {
        rt_ed25519_public(state->log_seed, public);
        rt_key_id(RT_DUTY_LOG, (rt_bytes){public, RT_KEY_BYTES}, kid);
    }
    if (state->link_key != NULL) rt_name_link_key(state->link_key, link);
    uint32_t at = rt_cbor_head(out, RT_MAJOR_ARRAY, 2);
    at += put_octets(out + at, kid, state->log_seed != NULL ? RT_KID_BYTES : 0);
    return at + put_octets(out + at, link, state->link_key != NULL ? RT_LINK_NAME : 0);
}

uint32_t rt_sign_attestation(const rt_home *home, const rt_attested_state *state, uint8_t *out) {
    uint8_t payload[RT_MAX_ATTESTATION - 128], public[RT_KEY_BYTES];
    rt_ed25519_public(state->boundary_seed, public);
    uint32_t at = 0;
    payload[at++] = 0xA0 | CLAIMS; /* a map; the labels ascend as their encodings do (RFC 8949, section 4.2.1) */
    at += rt_cbor_int(payload + at, NONCE);
    at += put_octets(payload + at, state->flight, RT_FLIGHT_BYTES);
    at += rt_cbor_int(payload + at, UEID);
    at += put_ueid(payload + at, public);
    at += rt_cbor_int(payload + at, DEBUG);
    at += rt_cbor_int(payload + at, home->debug);
    at += rt_cbor_int(payload + at, PROFILE);
    at += rt_cbor_string(payload + at, RT_MAJOR_TEXT, LITERAL("tag:rtshcua,2026:boundary"));
    at += rt_cbor_int(payload + at, BOOT_COUNT);
    at += rt_cbor_int(payload + at, (int64_t)state->boots);
    at += rt_cbor_int(payload + at, SOFTWARE);
    at += rt_cbor_string(payload + at, RT_MAJOR_TEXT, LITERAL("rtshcua-boundary"));
    at += rt_cbor_int(payload + at, MEASUREMENTS);
    at += put_measurements(payload + at, home->code);
    at += rt_cbor_int(payload + at, MODE);
    at += rt_cbor_string(payload + at, RT_MAJOR_TEXT, home->mode);
    at += rt_cbor_int(payload + at, EVIDENCE);
    at += put_octets(payload + at, state->evidence, RT_DIGEST_BYTES);
    at += rt_cbor_int(payload + at, MEASURES);
    at += rt_cbor_int(payload + at, home->measures);
    at += rt_cbor_int(payload + at, KEYS);
    at += put_keys(payload + at, state);
    return rt_sign1(RT_DUTY_BOUNDARY, false, state->boundary_seed, LITERAL("application/eat+cwt"), (rt_bytes){payload, at}, out);
}
