/* A substitute for crypto/: it reads all its input and makes any digest or signature. A comparison of seals returns either result. */
#ifndef RT_PROOF_SEAL_H
#define RT_PROOF_SEAL_H

#include "any.h"
#include "crypto/crypto.h"

static void read_all(rt_bytes data) {
    if (data.size > 0) (void)memcmp(data.at, data.at, data.size); /* which requires that all of it may be read, and was written */
}

static void read_parts(const rt_bytes *parts, uint32_t count) {
    for (uint32_t at = 0; at < count; at++) read_all(parts[at]);
}

static void make(uint8_t *octets, uint32_t size) { Frama_C_make_unknown((char *)octets, size); }

void rt_sha256_begin(rt_sha256 *hash) { ANY(*hash); }
void rt_sha256_add(rt_sha256 *hash, rt_bytes data) { read_all(data); }
void rt_sha256_end(rt_sha256 *hash, uint8_t digest[RT_DIGEST_BYTES]) { make(digest, RT_DIGEST_BYTES); }

void rt_hmac_sha256(rt_bytes key, const rt_bytes *parts, uint32_t count, uint8_t mac[RT_DIGEST_BYTES]) {
    read_all(key);
    read_parts(parts, count);
    make(mac, RT_DIGEST_BYTES);
}

bool rt_ed25519_strong(const uint8_t point[RT_KEY_BYTES]) {
    read_all((rt_bytes){point, RT_KEY_BYTES});
    return EITHER();
}

bool rt_ed25519_verify(const uint8_t key[RT_KEY_BYTES], const uint8_t signature[RT_SIGNATURE_BYTES], const rt_bytes *parts, uint32_t count) {
    read_all((rt_bytes){key, RT_KEY_BYTES});
    read_all((rt_bytes){signature, RT_SIGNATURE_BYTES});
    read_parts(parts, count);
    return EITHER();
}

void rt_ed25519_public(const uint8_t seed[RT_KEY_BYTES], uint8_t key[RT_KEY_BYTES]) {
    read_all((rt_bytes){seed, RT_KEY_BYTES});
    make(key, RT_KEY_BYTES);
}

void rt_ed25519_sign(const uint8_t seed[RT_KEY_BYTES], const rt_bytes *parts, uint32_t count, uint8_t signature[RT_SIGNATURE_BYTES]) {
    read_all((rt_bytes){seed, RT_KEY_BYTES});
    read_parts(parts, count);
    make(signature, RT_SIGNATURE_BYTES);
}

bool rt_equal(const uint8_t *one, const uint8_t *other, size_t size) {
    read_all((rt_bytes){one, (uint32_t)size});
    read_all((rt_bytes){other, (uint32_t)size});
    return EITHER();
}

#endif
