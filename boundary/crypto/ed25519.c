/* Ed25519 from Monocypher's building blocks. Monocypher's own check multiplies by the cofactor, and OpenSSL does not; the last steps
   are therefore made here, from its internal functions. */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include "monocypher.c"
#pragma GCC diagnostic pop

#include "crypto.h"
#include "crypto_hash_sha512.h"

/* y of the points of small order, little-endian; -y is of small order too. 0: order 4, 1: the neutral point (its -1: order 2). */
static const uint8_t small_order[][RT_KEY_BYTES] = {
    {0},
    {1},
    {0xec, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff,
     0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f},
    {0x26, 0xe8, 0x95, 0x8f, 0xc2, 0xb2, 0x27, 0xb0, 0x45, 0xc3, 0xf4, 0x89, 0xf2, 0xef, 0x98, 0xf0,
     0xd5, 0xdf, 0xac, 0x05, 0xd3, 0xc6, 0x33, 0x39, 0xb1, 0x38, 0x02, 0x88, 0x6d, 0x53, 0xfc, 0x05},
    {0xc7, 0x17, 0x6a, 0x70, 0x3d, 0x4d, 0xd8, 0x4f, 0xba, 0x3c, 0x0b, 0x76, 0x0d, 0x10, 0x67, 0x0f,
     0x2a, 0x20, 0x53, 0xfa, 0x2c, 0x39, 0xcc, 0xc6, 0x4e, 0xc7, 0xfd, 0x77, 0x92, 0xac, 0x03, 0x7a},
};

bool rt_ed25519_strong(const uint8_t point[RT_KEY_BYTES]) {
    uint8_t y[RT_KEY_BYTES];
    memcpy(y, point, sizeof y);
    y[31] &= 0x7f; /* the sign of x */
    for (size_t i = 0; i < sizeof small_order / sizeof small_order[0]; i++)
        if (memcmp(y, small_order[i], sizeof y) == 0) return false;
    bool high = y[31] == 0x7f; /* p = 2^255 - 19 */
    for (size_t i = 1; i < 31; i++) high = high && y[i] == 0xff;
    return !(high && y[0] >= 0xed);
}

static void sha512_parts(crypto_hash_sha512_state *hash, const rt_bytes *parts, uint32_t count, uint8_t reduced[32]) {
    uint8_t digest[64];
    for (uint32_t i = 0; i < count; i++)
        if (parts[i].size > 0) crypto_hash_sha512_update(hash, parts[i].at, parts[i].size);
    crypto_hash_sha512_final(hash, digest);
    crypto_eddsa_reduce(reduced, digest);
    rt_wipe(digest, sizeof digest);
}

static void challenge(const uint8_t r[32], const uint8_t key[32], const rt_bytes *parts, uint32_t count, uint8_t k[32]) {
    crypto_hash_sha512_state hash;
    crypto_hash_sha512_init(&hash);
    crypto_hash_sha512_update(&hash, r, 32);
    crypto_hash_sha512_update(&hash, key, 32);
    sha512_parts(&hash, parts, count, k);
}

bool rt_ed25519_verify(const uint8_t key[RT_KEY_BYTES], const uint8_t signature[RT_SIGNATURE_BYTES], const rt_bytes *parts, uint32_t count) {
    const uint8_t *s = signature + 32;
    uint32_t s32[8];
    ge sum, doubled, temporary; /* sum: first -A, then [s]B - [k]A */
    load32_le_buf(s32, s, 8);
    if (!rt_ed25519_strong(key) || !rt_ed25519_strong(signature) || is_above_l(s32) || ge_frombytes_neg_vartime(&sum, key)) return false;
    uint8_t k[32], encoded[32];
    challenge(signature, key, parts, count, k);
    /* the ladder of crypto_eddsa_check_equation */
    ge_cached odd[P_W_SIZE];
    ge_double(&doubled, &sum, &temporary);
    ge_cache(&odd[0], &sum);
    for (size_t i = 1; i < P_W_SIZE; i++) {
        ge_add(&temporary, &doubled, &odd[i - 1]);
        ge_cache(&odd[i], &temporary);
    }
    slide_ctx k_slide, s_slide;
    slide_init(&k_slide, k);
    slide_init(&s_slide, s);
    ge_zero(&sum);
    for (int i = MAX(k_slide.next_check, s_slide.next_check); i >= 0; i--) {
        fe one, other;
        ge_double(&sum, &sum, &temporary);
        int k_digit = slide_step(&k_slide, P_W_WIDTH, i, k), s_digit = slide_step(&s_slide, B_W_WIDTH, i, s);
        if (k_digit > 0) ge_add(&sum, &sum, &odd[k_digit / 2]);
        if (k_digit < 0) ge_sub(&sum, &sum, &odd[-k_digit / 2]);
        if (s_digit > 0) ge_madd(&sum, &sum, b_window + s_digit / 2, one, other);
        if (s_digit < 0) ge_msub(&sum, &sum, b_window + -s_digit / 2, one, other);
    }
    ge_tobytes(encoded, &sum);
    return memcmp(encoded, signature, sizeof encoded) == 0;
}

/* The secret scalar of a seed, followed by the input of the nonces. */
static void expand(const uint8_t seed[RT_KEY_BYTES], uint8_t expanded[64]) {
    crypto_hash_sha512_state hash;
    crypto_hash_sha512_init(&hash);
    crypto_hash_sha512_update(&hash, seed, RT_KEY_BYTES);
    crypto_hash_sha512_final(&hash, expanded);
    crypto_eddsa_trim_scalar(expanded, expanded);
}

void rt_ed25519_public(const uint8_t seed[RT_KEY_BYTES], uint8_t key[RT_KEY_BYTES]) {
    uint8_t expanded[64];
    expand(seed, expanded);
    crypto_eddsa_scalarbase(key, expanded);
    rt_wipe(expanded, sizeof expanded);
}

void rt_ed25519_sign(const uint8_t seed[RT_KEY_BYTES], const rt_bytes *parts, uint32_t count, uint8_t signature[RT_SIGNATURE_BYTES]) {
    uint8_t expanded[64], key[32], nonce[32], k[32];
    crypto_hash_sha512_state hash;
    expand(seed, expanded);
    crypto_eddsa_scalarbase(key, expanded);
    crypto_hash_sha512_init(&hash);
    crypto_hash_sha512_update(&hash, expanded + 32, 32);
    sha512_parts(&hash, parts, count, nonce);
    crypto_eddsa_scalarbase(signature, nonce);
    challenge(signature, key, parts, count, k);
    crypto_eddsa_mul_add(signature + 32, k, expanded, nonce);
    rt_wipe(expanded, sizeof expanded);
    rt_wipe(nonce, sizeof nonce);
    rt_wipe(&hash, sizeof hash);
}
