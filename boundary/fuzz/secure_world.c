/* What libFuzzer calls: a secure world that is begun with one setup, then wishes of the normal world, each with what stands in the
   mailbox. Seals and signatures count as good, so that blobs and bundles are read. */
#include "world.h"

#include "home/trustzone_m/world.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const rt_home home = {{(const uint8_t *)"trustzone-m", 11}, {0}, RT_DEBUG_ENABLED, 0};
    rt_bytes left = {data, (uint32_t)size}, setup, wish;
    if (!next_record(&left, &setup)) return 0;
    uint8_t *exact = malloc(setup.size > 0 ? setup.size : 1), *mailbox = malloc(RT_MAILBOX_SIZE);
    if (setup.size > 0) memcpy(exact, setup.at, setup.size);
    int64_t now_us = rt_world_begin(exact, setup.size, &home);
    free(exact);
    if (now_us < 0 || now_us > RT_MAX_VALUE) now_us = 0; /* a clock never says so */
    while (next_record(&left, &wish)) {
        memset(mailbox, 0xA5, RT_MAILBOX_SIZE);
        if (wish.size == 0) continue;
        const uint32_t octets = wish.size - 1;
        memcpy(mailbox + RT_MAILBOX_HEAD, wish.at + 1, octets < RT_MAILBOX_SIZE - RT_MAILBOX_HEAD ? octets : RT_MAILBOX_SIZE - RT_MAILBOX_HEAD);
        const uint32_t done = rt_world_answer(wish.at[0], mailbox, octets, now_us++, 0);
        const uint32_t answer = mailbox[0] | (uint32_t)mailbox[1] << 8 | (uint32_t)mailbox[2] << 16 | (uint32_t)mailbox[3] << 24;
        const uint32_t blob = mailbox[4] | (uint32_t)mailbox[5] << 8 | (uint32_t)mailbox[6] << 16 | (uint32_t)mailbox[7] << 24;
        if (done != RT_WRONG && RT_MAILBOX_HEAD + answer + blob > RT_MAILBOX_SIZE) abort();
    }
    free(mailbox);
    return 0;
}
