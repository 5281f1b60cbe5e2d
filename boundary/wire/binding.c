#include "binding.h"

#include "cbor.h"
#include "digest.h"

static const rt_bytes nothing = {NULL, 0};

/* The invocation with another id, and without its binding. */
static void hash_invocation(rt_sha256 *hash, const rt_invocation *invocation, rt_bytes id) {
    rt_hash_head(hash, RT_MAJOR_ARRAY, 17);
    rt_hash_string(hash, RT_MAJOR_OCTETS, id);
    rt_sha256_add(hash, invocation->content);
    rt_hash_string(hash, RT_MAJOR_OCTETS, nothing);
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
        hash_invocation(&hash, &invocation, invocation.invocation_id);
        rt_sha256_end(&hash, binding);
        if (!rt_same(invocation.binding, (rt_bytes){binding, sizeof binding})) return false;
    }
    return true;
}

bool rt_all_named(const rt_mission *mission, const rt_after *after) {
    uint8_t root[RT_DIGEST_BYTES], name[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_invocation invocation;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, RT_DOMAIN("invocation"));
    rt_sha256_add(&hash, mission->before);
    rt_hash_head(&hash, RT_MAJOR_ARRAY, mission->invocation_count);
    for (uint32_t step = 0; step < mission->invocation_count; step++) {
        rt_invocation_at(mission, step, &invocation);
        hash_invocation(&hash, &invocation, nothing);
    }
    rt_sha256_add(&hash, mission->behind);
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
