#include "binding.h"

#include "cbor.h"
#include "digest.h"

#define INVOCATION_HEAD 1 /* of an array of 17 */
#define NO_BYTES 0x40     /* an empty byte string */

static const uint8_t no_bytes[] = {NO_BYTES};

/* How many bytes the encoding of a byte string has. */
static uint32_t encoded(rt_bytes octets) {
    uint8_t head[RT_HEAD_BYTES];
    return rt_cbor_head(head, RT_MAJOR_OCTETS, octets.size) + octets.size;
}

/* The invocation without its binding; without its id too if it is to be `nameless`. */
static void hash_invocation(rt_sha256 *hash, const rt_invocation *invocation, bool nameless) {
    rt_bytes raw = invocation->raw;
    uint32_t end = raw.size - encoded(invocation->binding), start = 0;
    if (nameless) {
        rt_sha256_add(hash, (rt_bytes){raw.at, INVOCATION_HEAD});
        rt_sha256_add(hash, (rt_bytes){no_bytes, sizeof no_bytes});
        start = INVOCATION_HEAD + encoded(invocation->invocation_id);
    }
    rt_sha256_add(hash, (rt_bytes){raw.at + start, end - start});
    rt_sha256_add(hash, (rt_bytes){no_bytes, sizeof no_bytes});
}

bool rt_all_bound(const rt_mission *mission) {
    uint8_t binding[RT_DIGEST_BYTES];
    rt_sha256 around, hash;
    rt_sha256_begin(&around);
    rt_sha256_add(&around, RT_DOMAIN("binding"));
    rt_hash_head(&around, RT_MAJOR_ARRAY, 2);
    rt_hash_head(&around, RT_MAJOR_ARRAY, 7);
    rt_hash_string(&around, RT_MAJOR_OCTETS, mission->policy_digest);
    rt_hash_string(&around, RT_MAJOR_TEXT, mission->policy);
    rt_hash_int(&around, mission->policy_version);
    rt_hash_string(&around, RT_MAJOR_TEXT, mission->vehicle);
    rt_hash_string(&around, RT_MAJOR_TEXT, mission->name);
    rt_hash_int(&around, mission->issued_at_us);
    rt_hash_head(&around, RT_MAJOR_ARRAY, mission->phases.count);
    rt_sha256_add(&around, (rt_bytes){mission->phases.at, (uint32_t)(mission->phases.end - mission->phases.at)});
    for (uint32_t step = 0; step < mission->invocation_count; step++) {
        rt_invocation invocation;
        rt_invocation_at(mission, step, &invocation);
        hash = around;
        hash_invocation(&hash, &invocation, false);
        rt_sha256_end(&hash, binding);
        if (!rt_same(invocation.binding, (rt_bytes){binding, sizeof binding})) return false;
    }
    return true;
}

bool rt_all_named(const rt_mission *mission, const rt_after *after) {
    uint8_t root[RT_DIGEST_BYTES], name[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_invocation invocation;
    const uint8_t *at = mission->body.at;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, RT_DOMAIN("invocation"));
    for (uint32_t step = 0; step < mission->invocation_count; step++) {
        rt_invocation_at(mission, step, &invocation);
        rt_sha256_add(&hash, (rt_bytes){at, (uint32_t)(invocation.raw.at - at)});
        hash_invocation(&hash, &invocation, true);
        at = invocation.raw.at + invocation.raw.size;
    }
    rt_sha256_add(&hash, (rt_bytes){at, (uint32_t)(mission->body.at + mission->body.size - at)});
    if (after != NULL) {
        rt_hash_head(&hash, RT_MAJOR_ARRAY, 3);
        rt_hash_string(&hash, RT_MAJOR_OCTETS, after->flight);
        rt_hash_string(&hash, RT_MAJOR_OCTETS, after->supersedes);
        rt_hash_int(&hash, after->kept);
    }
    rt_sha256_end(&hash, root);
    for (uint32_t step = 0; step < mission->invocation_count; step++) {
        rt_invocation_at(mission, step, &invocation);
        rt_sha256_begin(&hash);
        rt_sha256_add(&hash, RT_DOMAIN("invocation"));
        rt_hash_head(&hash, RT_MAJOR_ARRAY, 2);
        rt_hash_string(&hash, RT_MAJOR_OCTETS, (rt_bytes){root, sizeof root});
        rt_hash_int(&hash, invocation.step);
        rt_sha256_end(&hash, name);
        if (!rt_same(invocation.invocation_id, (rt_bytes){name, RT_ID_BYTES})) return false;
    }
    return true;
}
