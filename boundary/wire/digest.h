/* SHA-256 with domain separation: a digest of one kind of thing is never a digest of another. */
#ifndef RT_WIRE_DIGEST_H
#define RT_WIRE_DIGEST_H

#include "../crypto/crypto.h"

/* A label with the NUL that ends it. */
#define RT_DOMAIN(name) ((rt_bytes){(const uint8_t *)("rtshcua/" name), sizeof("rtshcua/" name)})

void rt_digest(rt_bytes domain, rt_bytes data, uint8_t digest[RT_DIGEST_BYTES]);

/* Bytes that are hashed as the CBOR that they would be, without being written first. */
void rt_hash_head(rt_sha256 *hash, uint8_t major, uint64_t argument);
void rt_hash_int(rt_sha256 *hash, int64_t value);
void rt_hash_string(rt_sha256 *hash, uint8_t major, rt_bytes string);

#endif
