/* Replacements: a new mission for a flight in progress, under the policy in force. */
#ifndef RT_WIRE_REPLACEMENT_H
#define RT_WIRE_REPLACEMENT_H

#include "document.h"

/* A verified replacement; `digest` is the digest of the new mission. */
typedef struct {
    rt_bytes supersedes;
    int64_t kept;
    rt_mission mission;
    uint8_t digest[RT_DIGEST_BYTES];
    const rt_key *key;
} rt_replacement;

/* The replacement in a document, if it is trusted now; `rt_fit_replacement` checks it against the flown steps. */
rt_refusal rt_open_replacement(const rt_flight *flight, rt_bytes document, rt_replacement *found);

/* Check it against the mission in force, of which `released` steps were released: see `fit_replacement`. */
rt_refusal rt_fit_replacement(const rt_replacement *found, const rt_bundle *bundle, int64_t released);

/* Put it in force: the kept steps as they were first signed, then the new ones. Both documents are still needed afterwards. */
void rt_replace(rt_replacement *found, rt_bundle *bundle);

/* Check that a mission key may set aside the steps of a bundle from `first` on: see `check_set_aside`. */
rt_refusal rt_check_set_aside(const rt_key *key, const rt_bundle *bundle, uint32_t first);

#endif
