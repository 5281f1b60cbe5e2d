#include "cancellation.h"

#include "replacement.h"

rt_refusal rt_open_cancellation(const rt_flight *flight, rt_bytes document, uint32_t current) {
    rt_verified opened;
    rt_cursor body;
    rt_bytes said_flight, mission;
    int64_t issued, expires;
    rt_refusal refusal = rt_open_document(flight, document, &RT_CANCELLATION, RT_DUTY_MISSION, &opened, &body);
    if (refusal != NULL) return refusal;
    bool whole = rt_take_struct(&body, 4) && rt_take_octets(&body, &said_flight) && rt_take_octets(&body, &mission) &&
                 rt_take_int(&body, &issued) && rt_take_int(&body, &expires);
    if (!whole) return "malformed";
    refusal = rt_check_key(flight, opened.key);
    if (refusal == NULL) refusal = rt_check_times(flight, issued, expires);
    if (refusal != NULL) return refusal;
    if (!rt_same(said_flight, flight->flight)) return "other-flight";
    if (!rt_is_of_flight(flight, mission)) return "other-mission";
    return rt_check_set_aside(opened.key, flight->bundle, current);
}
