#include "digest.h"

#include "cbor.h"

void rt_digest(rt_bytes domain, rt_bytes data, uint8_t digest[RT_DIGEST_BYTES]) {
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, domain);
    rt_sha256_add(&hash, data);
    rt_sha256_end(&hash, digest);
}

void rt_hash_head(rt_sha256 *hash, uint8_t major, uint64_t argument) {
    uint8_t head[RT_HEAD_BYTES];
    rt_sha256_add(hash, (rt_bytes){head, rt_cbor_head(head, major, argument)});
}

void rt_hash_int(rt_sha256 *hash, int64_t value) {
    uint8_t head[RT_HEAD_BYTES];
    rt_sha256_add(hash, (rt_bytes){head, rt_cbor_int(head, value)});
}

void rt_hash_string(rt_sha256 *hash, uint8_t major, rt_bytes string) {
    rt_hash_head(hash, major, string.size);
    rt_sha256_add(hash, string);
}
