/* What a home says of itself: an Entity Attestation Token (RFC 9711) in COSE_Sign1, by the boundary's key. `attestation.py`. */
#ifndef RT_WIRE_ATTESTATION_H
#define RT_WIRE_ATTESTATION_H

#include "../base.h"

#define RT_MAX_ATTESTATION 512

/* state of debugging (RFC 9711, section 4.2.9, `dbgstat`) */
enum { RT_DEBUG_ENABLED = 0, RT_DEBUG_DISABLED = 1 };

/* A home, as it measured itself when it began. */
typedef struct {
    rt_bytes mode;                /* its name: `process`, `trustzone-m`; empty where it attests nothing */
    uint8_t code[RT_DIGEST_BYTES]; /* SHA-256 of the code image */
    int64_t debug;
    uint32_t measures; /* home/process/isolation.h; 0 elsewhere */
} rt_home;

/* What a token is about besides. */
typedef struct {
    const uint8_t *boundary_seed, *log_seed, *link_key; /* NULL for a key that it does not have */
    const uint8_t *flight;   /* RT_FLIGHT_BYTES */
    const uint8_t *evidence; /* the digest of the boundary's own evidence, so far */
    uint64_t boots;
} rt_attested_state;

/* The token, into `out` of RT_MAX_ATTESTATION octets; how many there are. */
uint32_t rt_sign_attestation(const rt_home *home, const rt_attested_state *state, uint8_t *out);

/* A name for the link's key that gives nothing of it away: `fingerprint` of adapters/store/signing.py. */
#define RT_LINK_NAME 8
void rt_name_link_key(const uint8_t key[RT_KEY_BYTES], uint8_t name[RT_LINK_NAME]);

#endif
