#include "common.h"

#include "crypto/crypto.h"

void rt_greet(const rt_setup *setup, uint32_t measures, bool own_clock, uint8_t greeting[RT_GREETING_BYTES]) {
    memset(greeting, 0, RT_GREETING_BYTES);
    for (int octet = 0; octet < 4; octet++) greeting[octet] = (uint8_t)(measures >> 8 * octet & 0xFF);
    if (setup->signs) rt_name_link_key(setup->keys->link, greeting + 4);
    if (setup->has_log_key) rt_ed25519_public(setup->keys->log, greeting + 4 + RT_LINK_NAME);
    if (setup->has_key) rt_ed25519_public(setup->keys->boundary, greeting + 4 + RT_LINK_NAME + RT_KEY_BYTES);
    greeting[RT_GREETING_BYTES - 1] = own_clock;
}

void rt_gather_link(rt_boundary *boundary, int64_t ahead) {
    rt_signed_link *link = &boundary->executor.gate.signer;
    rt_kept *kept = boundary->kept;
    if (!boundary->executor.gate.signs) return; /* what was kept of the link stays, for a start that has its key */
    kept->link_timestamp = rt_signed_up_to(link) + ahead;
    kept->stream_count = link->stream_count;
    memcpy(kept->streams, link->streams, sizeof kept->streams);
    link->news = false;
}

bool rt_is_to_be_kept(const rt_boundary *boundary, int64_t now_us, int64_t kept_us) {
    const rt_gate *gate = &boundary->executor.gate;
    return boundary->to_keep || (gate->signs && (now_us - kept_us > RT_KEEP_EVERY_US || gate->signer.news));
}
