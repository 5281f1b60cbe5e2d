/* Cryptography: a thin layer over Monocypher (the curve) and libsodium's SHA-2 (by Colin Percival), which .make/monocypher unpacks. */
#ifndef RT_CRYPTO_H
#define RT_CRYPTO_H

#include "../base.h"

#define RT_SIGNATURE_BYTES 64

/* An unfinished SHA-256; it may be copied. */
typedef struct {
    uint64_t state[13];
} rt_sha256;

void rt_sha256_begin(rt_sha256 *hash);
void rt_sha256_add(rt_sha256 *hash, rt_bytes data);
void rt_sha256_end(rt_sha256 *hash, uint8_t digest[RT_DIGEST_BYTES]);

/* HMAC-SHA256 (RFC 2104) under a key of at most 64 bytes, over the parts one after another. */
void rt_hmac_sha256(rt_bytes key, const rt_bytes *parts, uint32_t count, uint8_t mac[RT_DIGEST_BYTES]);

/* Ed25519 (RFC 8032, 5.1) over the concatenated parts. A signature is valid if the key and its R are canonical and not of small order,
   s < L, and R is exactly the encoding of [s]B - [k]A, without the cofactor. `wire/keys.py` and OpenSSL do the same. */
bool rt_ed25519_strong(const uint8_t point[RT_KEY_BYTES]);
bool rt_ed25519_verify(const uint8_t key[RT_KEY_BYTES], const uint8_t signature[RT_SIGNATURE_BYTES], const rt_bytes *parts, uint32_t count);
void rt_ed25519_public(const uint8_t seed[RT_KEY_BYTES], uint8_t key[RT_KEY_BYTES]);
void rt_ed25519_sign(const uint8_t seed[RT_KEY_BYTES], const rt_bytes *parts, uint32_t count, uint8_t signature[RT_SIGNATURE_BYTES]);

/* Whether the bytes are equal, in constant time. */
bool rt_equal(const uint8_t *one, const uint8_t *other, size_t size);
void rt_wipe(void *secret, size_t size);

#endif
