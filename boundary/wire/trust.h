/* The trust root: which keys are trusted, for which duty, role, source and vehicle, and until when. */
#ifndef RT_WIRE_TRUST_H
#define RT_WIRE_TRUST_H

#include "../model/flat.h"
#include "artefact.h"
#include "cose.h"

typedef struct {
    int64_t version;
    bool development;
    int64_t issued_at_us, expires_at_us;
    rt_key keys[RT_MAX_KEYS];
    uint32_t key_count;
    int64_t thresholds[RT_DUTIES];
    rt_list revoked; /* octets */
} rt_root;

/* A verified payload, as it was signed, and the key that signed it. */
typedef struct {
    rt_bytes payload;
    const rt_key *key;
} rt_verified;

/* The root in a signed envelope: see `open_root`. `pinned` is its public key (32 bytes) or that key's name (16 bytes); empty trusts
   only a development root, without a pin. */
rt_refusal rt_open_root(rt_bytes data, rt_bytes pinned, int64_t now_us, rt_root *root);

/* The payload of an artefact that a key of the root signed for a duty: see `bundle.open_envelope`. */
rt_refusal rt_open_envelope(rt_bytes envelope, const rt_root *root, int64_t duty, const rt_artefact *kind, uint32_t limit, rt_verified *opened);

/* The number of the person who owns this approval key: the same for all keys of one person. */
uint32_t rt_person(const rt_root *root, const rt_key *key);

/* Why a key is not authorised for a vehicle at a UTC time, for a role through a source, under a policy. */
rt_refusal rt_key_refusal(const rt_key *key, rt_bytes vehicle, int64_t now_us);
rt_refusal rt_speaker_refusal(const rt_key *key, rt_bytes role, rt_bytes source, rt_bytes vehicle, int64_t now_us);
rt_refusal rt_proposer_refusal(const rt_key *key, rt_bytes role, rt_bytes source, rt_bytes policy, rt_bytes vehicle, int64_t now_us);

/* contract.SourceKind by number. */
extern const rt_bytes rt_sources[4];

#endif
