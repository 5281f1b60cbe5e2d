#include "kept.h"
#include "crypto/crypto.h"

bool rt_was_opened(const rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES]) {
    for (uint64_t at = 0; at < kept->opened_count; at++)
        if (memcmp(kept->opened[at].digest, digest, RT_DIGEST_BYTES) == 0)
            return true;
    return false;
}

rt_refusal rt_may_open(const rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES], int64_t issued_us, int64_t expires_us,
                       const uint8_t policy[RT_DIGEST_BYTES], int64_t version, int64_t now_us) {
    if (rt_was_opened(kept, digest) || expires_us <= kept->floor_us)
        return "replayed";
    if (issued_us < kept->since_us)
        return "before-provisioned";
    bool known = false;
    for (uint64_t at = 0; at < kept->version_count; at++)
        if (memcmp(kept->versions[at].name, policy, RT_DIGEST_BYTES) == 0) {
            known = true;
            if (version < kept->versions[at].version)
                return "old-policy";
        }
    uint64_t lasting = 0; /* the others are dropped */
    for (uint64_t at = 0; at < kept->opened_count; at++) lasting += kept->opened[at].expires_us >= now_us ? 1 : 0;
    bool room = lasting < RT_MOST_OPENED && (known || kept->version_count < RT_MOST_POLICIES);
    return room ? NULL : "full";
}

void rt_open_mission(rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES], int64_t expires_us,
                     const uint8_t policy[RT_DIGEST_BYTES], int64_t version, int64_t now_us) {
    uint64_t left = 0, at = 0;
    for (uint64_t each = 0; each < kept->opened_count; each++) {
        if (kept->opened[each].expires_us >= now_us)
            kept->opened[left++] = kept->opened[each];
        else if (kept->opened[each].expires_us > kept->floor_us)
            kept->floor_us = kept->opened[each].expires_us;
    }
    memcpy(kept->opened[left].digest, digest, RT_DIGEST_BYTES);
    kept->opened[left++].expires_us = expires_us;
    kept->opened_count = left;
    while (at < kept->version_count && memcmp(kept->versions[at].name, policy, RT_DIGEST_BYTES) != 0)
        at++;
    if (at == kept->version_count)
        memcpy(kept->versions[kept->version_count++].name, policy, RT_DIGEST_BYTES);
    kept->versions[at].version = version;
}

void rt_forget_mission(rt_kept *kept, const uint8_t digest[RT_DIGEST_BYTES]) {
    uint64_t left = 0;
    for (uint64_t each = 0; each < kept->opened_count; each++)
        if (memcmp(kept->opened[each].digest, digest, RT_DIGEST_BYTES) != 0) kept->opened[left++] = kept->opened[each];
    kept->opened_count = left;
}

static void check_of(const rt_kept *kept, uint8_t check[RT_DIGEST_BYTES]) {
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){(const uint8_t *)kept, offsetof(rt_kept, check)});
    rt_sha256_end(&hash, check);
}

void rt_seal_kept(rt_kept *kept) {
    kept->layout = RT_KEPT_LAYOUT;
    kept->turn++;
    check_of(kept, kept->check);
}

/* The number of missions of a layout; 0 for an unknown one. */
static uint64_t most_opened(uint64_t layout) {
    return layout == RT_KEPT_LAYOUT ? RT_MOST_OPENED : layout == RT_KEPT_LAYOUT_2 ? RT_MOST_OPENED + 1 : layout == RT_KEPT_LAYOUT_1 ? RT_MOST_OPENED + 2 : 0;
}

bool rt_is_whole_kept(const rt_kept *kept) {
    uint8_t check[RT_DIGEST_BYTES];
    const uint64_t most = most_opened(kept->layout);
    if (most == 0 || kept->opened_count > most || kept->version_count > RT_MOST_POLICIES || kept->stream_count > RT_MOST_STREAMS)
        return false;
    check_of(kept, check);
    return memcmp(check, kept->check, RT_DIGEST_BYTES) == 0;
}

/* New fields are where the older layouts have their last missions. */
_Static_assert(offsetof(rt_kept, instance) == offsetof(rt_kept, opened) + RT_MOST_OPENED * sizeof(rt_opened), "no gap");
_Static_assert(offsetof(rt_kept, session_digest) == offsetof(rt_kept, instance) + sizeof(rt_opened), "no gap");
_Static_assert(offsetof(rt_kept, versions) == offsetof(rt_kept, session_digest) + sizeof(rt_opened), "no gap");

/* The mission of this number, including those beyond the present room. */
static rt_opened opened_at(const rt_kept *kept, uint64_t number) {
    rt_opened found;
    memcpy(&found, (const uint8_t *)kept + offsetof(rt_kept, opened) + number * sizeof found, sizeof found);
    return found;
}

void rt_upgrade_kept(rt_kept *kept) {
    if (kept->layout == RT_KEPT_LAYOUT) return;
    while (kept->opened_count > RT_MOST_OPENED) { /* one does not fit any more: the first to expire, which cannot be opened again */
        rt_opened first = opened_at(kept, --kept->opened_count);
        for (uint64_t each = 0; each < RT_MOST_OPENED; each++)
            if (kept->opened[each].expires_us < first.expires_us) {
                const rt_opened other = kept->opened[each];
                kept->opened[each] = first;
                first = other;
            }
        if (first.expires_us > kept->floor_us) kept->floor_us = first.expires_us;
    }
    memset(kept->instance, 0, sizeof kept->instance);
    kept->since_us = 0;
    if (kept->layout == RT_KEPT_LAYOUT_1) {
        memset(kept->session_digest, 0, sizeof kept->session_digest);
        kept->session = 0;
    }
    kept->layout = RT_KEPT_LAYOUT;
}

bool rt_first_kept(const rt_kept_first *first, rt_kept *kept) {
    uint8_t check[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){(const uint8_t *)first, offsetof(rt_kept_first, check)});
    rt_sha256_end(&hash, check);
    if (first->layout != RT_KEPT_FIRST || memcmp(check, first->check, RT_DIGEST_BYTES) != 0) return false;
    memset(kept, 0, sizeof *kept);
    kept->floor_us = -1;
    kept->layout = RT_KEPT_LAYOUT;
    kept->since_us = first->since_us;
    memcpy(kept->instance, first->instance, RT_KEY_BYTES);
    return true;
}

bool rt_kept_is_of(const rt_kept *kept, const uint8_t *public_key) {
    static const uint8_t anybody[RT_KEY_BYTES];
    if (memcmp(kept->instance, anybody, RT_KEY_BYTES) == 0) return true;
    return public_key != NULL && memcmp(kept->instance, public_key, RT_KEY_BYTES) == 0;
}
