#include "recall.h"

rt_refusal rt_open_recall(const rt_flight *flight, rt_bytes document, int64_t issued_at_us) {
    rt_verified opened;
    rt_cursor body;
    rt_bytes vehicle, said_flight, mission, policy;
    int64_t issued, expires;
    rt_refusal refusal = rt_open_document(flight, document, &RT_RECALL, RT_DUTY_APPROVAL, &opened, &body);
    if (refusal != NULL) return refusal;
    bool whole = rt_take_struct(&body, 6) && rt_take_text(&body, &vehicle) && rt_take_octets(&body, &said_flight) &&
                 rt_take_octets(&body, &mission) && rt_take_octets(&body, &policy) && rt_take_int(&body, &issued) && rt_take_int(&body, &expires);
    if (!whole || (mission.size > 0) == (policy.size > 0) || (mission.size > 0) != (said_flight.size > 0)) return "malformed";
    if (!rt_same(vehicle, flight->vehicle)) return "wrong-vehicle";
    refusal = rt_check_key(flight, opened.key);
    if (refusal == NULL && !rt_names(opened.key->sources, rt_sources[RT_SOURCE_OPERATOR])) refusal = "wrong-source";
    if (refusal == NULL) refusal = rt_check_times(flight, issued, expires);
    if (refusal != NULL) return refusal;
    if (said_flight.size > 0 && !rt_same(said_flight, flight->flight)) return "other-flight";
    if (mission.size > 0 && !rt_is_of_flight(flight, mission)) return "other-mission";
    if (policy.size > 0 && !rt_same(policy, (rt_bytes){flight->bundle->policy_digest, RT_DIGEST_BYTES})) return "other-policy";
    return policy.size > 0 && issued < issued_at_us ? "before-mission" : NULL;
}
