/* libFuzzer target: requests to a boundary that has a bundle in force, one after another. Permits are dispatched if the first octet
   says so, so that links are requested in flight too. */
#include "world.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static uint8_t call[1 + UINT16_MAX], dispatch[9 + RT_PERMIT_BYTES], answer[RT_MAX_RESULT];
    if (size == 0) return 0;
    rt_bytes left = {data + 1, (uint32_t)(size - 1)}, request;
    begin(false);
    while (next_record(&left, &request)) {
        call[0] = RT_CALL_ENFORCE;
        memcpy(call + 1, request.at, request.size);
        uint32_t answered = call_with((rt_bytes){call, 1 + request.size}, answer);
        if ((data[0] & 1) == 0 || answered < RT_DIGEST_BYTES + RT_PERMIT_BYTES) continue;
        dispatch[0] = RT_CALL_DISPATCH;
        for (uint32_t octet = 0; octet < 8; octet++) dispatch[1 + octet] = (uint8_t)(boundary.now_us >> 8 * (7 - octet) & 0xFF);
        memcpy(dispatch + 9, answer + answered - RT_DIGEST_BYTES - RT_PERMIT_BYTES, RT_PERMIT_BYTES);
        call_with((rt_bytes){dispatch, sizeof dispatch}, NULL);
    }
    return 0;
}
