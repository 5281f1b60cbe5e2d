#include "document.h"

rt_refusal rt_kind_of(rt_bytes document, const rt_artefact **kind) {
    const rt_artefact *every[] = {&RT_APPROVAL, &RT_RECALL, &RT_REPLACEMENT, &RT_CANCELLATION};
    rt_envelope claimed;
    if (document.size > RT_MAX_DOCUMENT) return "too-large";
    rt_refusal refusal = rt_take_apart(document, RT_CBOR_LIMIT, &claimed);
    if (refusal != NULL) return refusal;
    for (size_t i = 0; i < sizeof every / sizeof every[0]; i++)
        if (rt_same(claimed.content_type, every[i]->content_type)) {
            *kind = every[i];
            return every[i] != &RT_REPLACEMENT && document.size > RT_MAX_WITHOUT_MISSION ? "too-large" : NULL;
        }
    return "unknown-document";
}

rt_refusal rt_open_document(const rt_flight *flight, rt_bytes document, const rt_artefact *kind, int64_t duty, rt_verified *opened,
                            rt_cursor *body) {
    if (rt_latest_utc_us(flight) >= flight->root->expires_at_us) return "root-expired";
    rt_refusal refusal = rt_open_envelope(document, flight->root, duty, kind, RT_MAX_DOCUMENT, opened);
    return refusal != NULL ? refusal : rt_unwrap(kind, opened->payload, body);
}

rt_refusal rt_check_times(const rt_flight *flight, int64_t issued_at_us, int64_t expires_at_us) {
    if (issued_at_us > rt_latest_utc_us(flight)) return "issued-in-future";
    if (rt_latest_utc_us(flight) >= expires_at_us) return "expired";
    /* both may be any number of 64 bits; the issue is before the expiry, so the unsigned difference is right */
    bool lives = issued_at_us < expires_at_us && (uint64_t)expires_at_us - (uint64_t)issued_at_us <= RT_MAX_LIFE_US;
    return lives ? NULL : "too-long-lived";
}

rt_refusal rt_check_key(const rt_flight *flight, const rt_key *key) { return rt_key_refusal(key, flight->vehicle, rt_latest_utc_us(flight)); }

bool rt_is_of_flight(const rt_flight *flight, rt_bytes mission) {
    for (uint32_t i = 0; i < flight->mission_count; i++)
        if (rt_same(mission, (rt_bytes){flight->missions[i], RT_DIGEST_BYTES})) return true;
    return false;
}
