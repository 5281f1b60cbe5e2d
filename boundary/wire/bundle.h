/* A bundle: the policy's envelope and the mission's, nested as signed bytes. */
#ifndef RT_WIRE_BUNDLE_H
#define RT_WIRE_BUNDLE_H

#include "binding.h"
#include "trust.h"

/* A verified bundle: its parts, the digests that name them, and the keys that signed them, which are in the root. */
typedef struct {
    rt_policy policy;
    rt_mission mission;
    uint8_t policy_digest[RT_DIGEST_BYTES], mission_digest[RT_DIGEST_BYTES], digest[RT_DIGEST_BYTES];
    const rt_key *policy_key, *mission_key;
} rt_bundle;

/* Verify a bundle under a trust root for a vehicle, at a UTC time; then read it: see `open_bundle`. */
rt_refusal rt_open_bundle(rt_bytes data, const rt_root *root, rt_bytes vehicle, int64_t now_us, rt_bundle *bundle);

/* Check that a mission belongs to a bundle's policy, and that the keys of both are authorised for them on this vehicle; `after` is as
   for `rt_all_named`. See `check_bundle`. */
rt_refusal rt_check_bundle(const rt_bundle *bundle, const rt_mission *mission, const rt_key *key, rt_bytes vehicle, int64_t now_us,
                           const rt_after *after);

/* Check that a mission key may sign the steps of a mission from `first` on under a policy; `in_person`: as if an operator had proposed
   them. See `check_proposer`. */
rt_refusal rt_check_proposer(const rt_key *key, const rt_policy *policy, const rt_mission *mission, uint32_t first, bool in_person,
                             int64_t now_us);

#endif
