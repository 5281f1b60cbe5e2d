/* SHA-256 with domain separation, so that digests of different kinds of data never coincide. */
#ifndef RT_WIRE_DIGEST_H
#define RT_WIRE_DIGEST_H

#include "../crypto/crypto.h"

/* A label with the NUL that ends it. */
#define RT_DOMAIN(name) ((rt_bytes){(const uint8_t *)("rtshcua/" name), sizeof("rtshcua/" name)})

void rt_digest(rt_bytes domain, rt_bytes data, uint8_t digest[RT_DIGEST_BYTES]);

/* Hash values as their CBOR encoding, without writing it first. */
void rt_hash_head(rt_sha256 *hash, uint8_t major, uint64_t argument);
void rt_hash_int(rt_sha256 *hash, int64_t value);
void rt_hash_string(rt_sha256 *hash, uint8_t major, rt_bytes string);

#endif
