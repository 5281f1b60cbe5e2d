#include "permit.h"
#include "crypto/crypto.h"
#include "octets.h"

#define VERSION 1

static void mac_of(const uint8_t *body, const uint8_t key[RT_KEY_BYTES], uint8_t mac[RT_DIGEST_BYTES]) {
    static const uint8_t domain[] = "rtshcua/permit"; /* including its NUL */
    const rt_bytes parts[] = {{domain, sizeof domain}, {body, RT_PERMIT_BODY}};
    rt_hmac_sha256((rt_bytes){key, RT_KEY_BYTES}, parts, 2, mac);
}

void rt_seal_permit(const rt_permit *permit, const uint8_t key[RT_KEY_BYTES], uint8_t sealed[RT_PERMIT_BYTES]) {
    uint8_t *at = sealed;
    rt_put(&at, VERSION, 1);
    rt_put(&at, (uint64_t)permit->kind, 1);
    rt_put(&at, (uint64_t)permit->step, 2);
    rt_put(&at, (uint64_t)permit->link, 2);
    rt_put(&at, permit->serial, 8);
    rt_put(&at, (uint64_t)permit->fallbacks, 1);
    rt_put(&at, (uint64_t)permit->contingencies, 1);
    rt_put(&at, (uint64_t)permit->not_after_us, 8);
    mac_of(sealed, key, sealed + RT_PERMIT_BODY);
}

bool rt_open_permit(rt_bytes sealed, const uint8_t key[RT_KEY_BYTES], rt_permit *permit) {
    uint8_t mac[RT_DIGEST_BYTES];
    if (sealed.size != RT_PERMIT_BYTES)
        return false;
    mac_of(sealed.at, key, mac);
    if (!rt_equal(mac, sealed.at + RT_PERMIT_BODY, RT_DIGEST_BYTES))
        return false;
    const uint8_t *at = sealed.at + 1;
    permit->kind = *at++;
    permit->step = rt_take_signed(&at, 2);
    permit->link = rt_take_signed(&at, 2);
    permit->serial = rt_take(&at, 8);
    permit->fallbacks = *at++;
    permit->contingencies = *at++;
    permit->not_after_us = rt_take_signed(&at, 8);
    return true;
}
