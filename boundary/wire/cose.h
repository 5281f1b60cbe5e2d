/* Signed envelopes: COSE_Sign1 (RFC 9052, sections 4.2 and 4.4) with Ed25519, without optional features. */
#ifndef RT_WIRE_COSE_H
#define RT_WIRE_COSE_H

#include "keys.h"

/* The unverified claims of an envelope. Do not trust them. */
typedef struct {
    rt_bytes protected, content_type, kid, payload, signature;
} rt_envelope;

/* Parse an envelope without verifying it: `malformed` unless it is canonical. */
rt_refusal rt_take_apart(rt_bytes envelope, uint32_t limit, rt_envelope *claimed);

/* Whether a public key signed it for a duty. */
bool rt_signed_by(const rt_envelope *envelope, int64_t duty, rt_bytes public);

/* An envelope around a payload, signed for a duty, into `out`; how many octets there are. `labelled`: the duty's label is signed along, as
   everything of ours has it; an attestation token has none, so that any reader of COSE verifies it. */
uint32_t rt_sign1(int64_t duty, bool labelled, const uint8_t seed[RT_KEY_BYTES], rt_bytes content_type, rt_bytes payload, uint8_t *out);

#endif
