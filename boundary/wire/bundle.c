#include "bundle.h"

#include "digest.h"

static rt_refusal envelopes(rt_bytes data, rt_bytes *policy, rt_bytes *mission) {
    rt_cursor cursor;
    if (data.size > RT_MAX_BUNDLE) return "too-large";
    rt_refusal refusal = rt_unwrap(&RT_BUNDLE, data, &cursor);
    if (refusal != NULL) return refusal;
    return rt_take_struct(&cursor, 2) && rt_take_octets(&cursor, policy) && rt_take_octets(&cursor, mission) ? NULL : "malformed";
}

rt_refusal rt_open_bundle(rt_bytes data, const rt_root *root, rt_bytes vehicle, int64_t now_us, rt_bundle *bundle) {
    rt_bytes first, second;
    rt_verified policy, mission;
    rt_refusal refusal = envelopes(data, &first, &second);
    if (refusal == NULL) refusal = rt_open_envelope(first, root, RT_DUTY_POLICY, &RT_POLICY, RT_MAX_BUNDLE, &policy);
    if (refusal == NULL) refusal = rt_open_envelope(second, root, RT_DUTY_MISSION, &RT_MISSION, RT_MAX_BUNDLE, &mission);
    if (refusal == NULL) refusal = rt_read_policy(policy.payload, &bundle->policy);
    if (refusal == NULL) refusal = rt_read_mission(mission.payload, &bundle->mission);
    if (refusal != NULL) return refusal;
    bundle->policy_key = policy.key;
    bundle->mission_key = mission.key;
    rt_digest(RT_DOMAIN("policy"), policy.payload, bundle->policy_digest);
    rt_digest(RT_DOMAIN("mission"), mission.payload, bundle->mission_digest);
    rt_digest(RT_DOMAIN("bundle"), data, bundle->digest);
    return rt_check_bundle(bundle, &bundle->mission, mission.key, vehicle, now_us, NULL);
}

rt_refusal rt_check_bundle(const rt_bundle *bundle, const rt_mission *mission, const rt_key *key, rt_bytes vehicle, int64_t now_us,
                           const rt_after *after) {
    const rt_policy *policy = &bundle->policy;
    if (!rt_same(mission->policy_digest, (rt_bytes){bundle->policy_digest, RT_DIGEST_BYTES})) return "wrong-policy";
    if (!rt_same(mission->policy, policy->name) || mission->policy_version != policy->version) return "wrong-policy";
    if (!rt_same(mission->vehicle, policy->vehicle.identity)) return "wrong-vehicle";
    if (!rt_all_bound(mission)) return "binding-mismatch";
    if (!rt_all_named(mission, after)) return "id-mismatch";
    if (!rt_same(policy->vehicle.identity, vehicle)) return "wrong-vehicle";
    rt_refusal refusal = rt_key_refusal(bundle->policy_key, vehicle, now_us);
    return refusal != NULL ? refusal : rt_check_proposer(key, policy, mission, 0, false, now_us);
}

rt_refusal rt_check_proposer(const rt_key *key, const rt_policy *policy, const rt_mission *mission, uint32_t first, bool in_person,
                             int64_t now_us) {
    for (uint32_t step = first; step < mission->invocation_count; step++) {
        rt_invocation invocation;
        rt_invocation_at(mission, step, &invocation);
        int64_t source = in_person ? RT_SOURCE_OPERATOR : invocation.source;
        if (invocation.role < 0 || invocation.role >= policy->role_count || source < RT_SOURCE_AGENT || source > RT_SOURCE_REFLEX)
            return "malformed";
        rt_refusal refusal = rt_proposer_refusal(key, policy->roles[invocation.role], rt_sources[source], policy->name,
                                                 policy->vehicle.identity, now_us);
        if (refusal != NULL) return refusal;
    }
    return NULL;
}
