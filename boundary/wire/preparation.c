#include "preparation.h"

#include "crypto/crypto.h"
#include "octets.h"

#define VERSION 1
#define HEAD (1 + 1 + 8 + 8 + 1)
#define WRITE (RT_PARAMETER_NAME + 4 + 4)

/* ASCII, without NULs except at its end. */
static bool is_name(const uint8_t name[RT_PARAMETER_NAME]) {
    bool ended = false;
    for (uint32_t i = 0; i < RT_PARAMETER_NAME; i++) {
        if (name[i] > 0x7F || (ended && name[i] != 0)) return false;
        ended = name[i] == 0;
    }
    return true;
}

bool rt_read_preparation(rt_bytes body, rt_preparation *preparation) {
    if (body.size < HEAD) return false;
    const uint8_t *at = body.at;
    uint8_t version = *at++;
    preparation->restoring = *at++ != 0;
    preparation->serial = rt_take(&at, 8);
    preparation->not_after_us = rt_take_signed(&at, 8);
    preparation->count = *at++;
    if (version != VERSION || preparation->count > RT_MAX_WRITES || body.size != HEAD + preparation->count * WRITE) return false;
    for (uint32_t i = 0; i < preparation->count; i++) {
        rt_write *each = &preparation->writes[i];
        memcpy(each->name, at, RT_PARAMETER_NAME);
        at += RT_PARAMETER_NAME;
        each->before = (uint32_t)rt_take(&at, 4);
        each->value = (uint32_t)rt_take(&at, 4);
        if (!is_name(each->name)) return false;
    }
    return true;
}

static void mac_of(rt_bytes body, const uint8_t key[RT_KEY_BYTES], uint8_t mac[RT_DIGEST_BYTES]) {
    static const uint8_t domain[] = "rtshcua/preparation"; /* including its NUL */
    const rt_bytes parts[] = {{domain, sizeof domain}, body};
    rt_hmac_sha256((rt_bytes){key, RT_KEY_BYTES}, parts, 2, mac);
}

bool rt_open_preparation(rt_bytes sealed, const uint8_t key[RT_KEY_BYTES], rt_preparation *preparation) {
    uint8_t mac[RT_DIGEST_BYTES];
    if (sealed.size < RT_DIGEST_BYTES) return false;
    rt_bytes body = {sealed.at, sealed.size - RT_DIGEST_BYTES};
    mac_of(body, key, mac);
    return rt_equal(mac, body.at + body.size, sizeof mac) && rt_read_preparation(body, preparation);
}

uint32_t rt_put_writes(const rt_preparation *preparation, uint8_t *out) {
    uint8_t *at = out;
    for (uint32_t i = 0; i < preparation->count; i++) {
        const rt_write *each = &preparation->writes[i];
        memcpy(at, each->name, RT_PARAMETER_NAME);
        at += RT_PARAMETER_NAME;
        rt_put(&at, each->before, 4);
        rt_put(&at, each->value, 4);
    }
    return preparation->count * WRITE;
}

uint32_t rt_seal_preparation(const rt_preparation *preparation, const uint8_t key[RT_KEY_BYTES], uint8_t *out) {
    uint8_t *at = out;
    rt_put(&at, VERSION, 1);
    rt_put(&at, preparation->restoring, 1);
    rt_put(&at, preparation->serial, 8);
    rt_put(&at, (uint64_t)preparation->not_after_us, 8);
    rt_put(&at, preparation->count, 1);
    uint32_t size = HEAD + rt_put_writes(preparation, at);
    mac_of((rt_bytes){out, size}, key, out + size);
    return size + RT_DIGEST_BYTES;
}
