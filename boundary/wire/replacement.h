/* Replacements: a new mission for a flight that is under way, under the policy that it flies under. */
#ifndef RT_WIRE_REPLACEMENT_H
#define RT_WIRE_REPLACEMENT_H

#include "document.h"

#define RT_MAX_REPLACEMENTS 64

/* A verified replacement: `digest` names the mission from now on. */
typedef struct {
    rt_bytes supersedes;
    int64_t kept;
    rt_mission mission;
    uint8_t digest[RT_DIGEST_BYTES];
    const rt_key *key;
} rt_replacement;

/* A replacement that is to be trusted here and now; whether it fits what has flown is for `rt_fit_replacement`. */
rt_refusal rt_open_replacement(const rt_flight *flight, rt_bytes document, rt_replacement *found);

/* Whether it fits what is in force, of which `released` steps were released: see `fit_replacement`. */
rt_refusal rt_fit_replacement(const rt_replacement *found, const rt_bundle *bundle, int64_t released);

/* Put it in force: the steps that stay, as they were signed first, then the new ones. Both documents are still needed after it. */
void rt_replace(rt_replacement *found, rt_bundle *bundle);

/* Whether a mission key may set aside the steps of a bundle from `first` on: see `check_set_aside`. */
rt_refusal rt_check_set_aside(const rt_key *key, const rt_bundle *bundle, uint32_t first);

#endif
