#include "request.h"
#include "octets.h"

#define HEAD (1 + 2 + 2 + RT_DIGEST_BYTES + 5 * 8 + 2)
static const uint8_t ARTEFACT[] = {0x83, 0x6F, 'r', 't', 's', 'h', 'c', 'u', 'a', '/', 'r', 'e', 'q', 'u', 'e', 's', 't', 2};

bool rt_read_request(rt_bytes data, int64_t slots, uint32_t monitors, rt_request *request) {
    const uint32_t count = (uint32_t)slots, size = HEAD + 12 * count + monitors; /* of the body: at most 975 */
    const uint8_t *at = data.at + sizeof ARTEFACT;
    const uint32_t prefix = (uint32_t)sizeof ARTEFACT + (size < 256 ? 2 : 3);
    if (data.size != prefix + size || memcmp(data.at, ARTEFACT, sizeof ARTEFACT) != 0)
        return false;
    if (*at++ != (size < 256 ? 0x58 : 0x59) || rt_take(&at, size < 256 ? 1 : 2) != size)
        return false;
    request->kind = (int64_t)rt_take(&at, 1);
    request->step = rt_take_signed(&at, 2);
    request->link = rt_take_signed(&at, 2);
    if (request->kind > RT_CONTINGENCY_LINK || request->step < -1 || request->link < -1)
        return false;
    memcpy(request->binding, at, RT_DIGEST_BYTES);
    at += RT_DIGEST_BYTES;
    int64_t *times[] = {&request->now.monotonic_us, &request->now.utc_us, &request->now.utc_error_us,
                        &request->released_us, &request->remaining_us};
    for (uint32_t each = 0; each < 5; each++) {
        uint64_t time = rt_take(&at, 8);
        if (time > RT_MAX_VALUE)
            return false;
        *times[each] = (int64_t)time;
    }
    request->phase = (int64_t)rt_take(&at, 2);
    rt_state *state = &request->state;
    state->slots = count;
    state->monitor_count = monitors;
    for (uint32_t slot = 0; slot < count; slot++) {
        uint64_t bits = rt_take(&at, 8), half = 1ULL << 63;
        state->known[slot] = bits != half; /* the least integer means an unknown value */
        if (bits > RT_MAX_VALUE && bits < half + (half - RT_MAX_VALUE) && bits != half)
            return false;
        state->values[slot] = bits == half ? 0 : bits < half ? (int64_t)bits : -1 - (int64_t)(half - 1 - (bits - half));
    }
    for (uint32_t slot = 0; slot < count; slot++)
        state->ages[slot] = (int64_t)rt_take(&at, 4);
    for (uint32_t monitor = 0; monitor < monitors; monitor++) {
        uint8_t said = *at++;
        if (said != RT_TRUE && said != RT_FALSE && said != RT_UNKNOWN)
            return false;
        state->monitors[monitor] = said;
    }
    return true;
}
