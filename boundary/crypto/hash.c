#include "crypto.h"

#include "crypto_hash_sha256.h"
#include "utils.h"

_Static_assert(sizeof(rt_sha256) >= sizeof(crypto_hash_sha256_state), "room for the state of libsodium's SHA-256");
_Static_assert(_Alignof(rt_sha256) >= _Alignof(crypto_hash_sha256_state), "and aligned for it");

#define HMAC_BLOCK 64

void rt_sha256_begin(rt_sha256 *hash) { crypto_hash_sha256_init((crypto_hash_sha256_state *)hash); }

void rt_sha256_add(rt_sha256 *hash, rt_bytes data) {
    if (data.size > 0) crypto_hash_sha256_update((crypto_hash_sha256_state *)hash, data.at, data.size);
}

void rt_sha256_end(rt_sha256 *hash, uint8_t digest[RT_DIGEST_BYTES]) { crypto_hash_sha256_final((crypto_hash_sha256_state *)hash, digest); }

void rt_hmac_sha256(rt_bytes key, const rt_bytes *parts, uint32_t count, uint8_t mac[RT_DIGEST_BYTES]) {
    uint8_t inner[HMAC_BLOCK], outer[HMAC_BLOCK];
    for (uint32_t i = 0; i < HMAC_BLOCK; i++) {
        uint8_t octet = i < key.size ? key.at[i] : 0;
        inner[i] = octet ^ 0x36;
        outer[i] = octet ^ 0x5C;
    }
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){inner, HMAC_BLOCK});
    for (uint32_t i = 0; i < count; i++) rt_sha256_add(&hash, parts[i]);
    rt_sha256_end(&hash, mac);
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){outer, HMAC_BLOCK});
    rt_sha256_add(&hash, (rt_bytes){mac, RT_DIGEST_BYTES});
    rt_sha256_end(&hash, mac);
    rt_wipe(inner, sizeof inner);
    rt_wipe(outer, sizeof outer);
}

bool rt_equal(const uint8_t *one, const uint8_t *other, size_t size) {
    volatile uint8_t differ = 0; /* volatile: no compiler ends the loop early */
    for (size_t i = 0; i < size; i++) differ = (uint8_t)(differ | (one[i] ^ other[i]));
    return differ == 0;
}

void rt_wipe(void *secret, size_t size) {
    volatile uint8_t *octets = secret;
    for (size_t i = 0; i < size; i++) octets[i] = 0;
}

/* libsodium's SHA-2 wipes its own state with this function. */
void sodium_memzero(void *const secret, const size_t size) { rt_wipe(secret, size); }
