/* libFuzzer target: calls to a boundary that has a bundle in force, one after another. The first octet says whether its link is signed. */
#include "world.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size == 0) return 0;
    rt_bytes left = {data + 1, (uint32_t)(size - 1)}, call;
    begin((data[0] & 1) != 0);
    while (next_record(&left, &call)) call_with(call, NULL);
    return 0;
}
