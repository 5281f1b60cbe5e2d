#include "world.h"

#include "../common.h"
#include "crypto/crypto.h"
#include "enforcement/calls.h"

enum { FINE = 0, USAGE = 64, UNTRUSTED = 65, DAMAGED = 78 }; /* as in ../process/main.c */

/* What the host puts at SETUP before the start, little-endian. The octets of the parts follow in this order. */
typedef struct {
    uint32_t magic, flags;
    uint8_t keys[5][RT_KEY_BYTES]; /* entropy of this start, the keys of link, boundary and log, and what a chip has fused */
    int64_t monotonic_us, utc_us, utc_error_us, stated_us;
    uint32_t sizes[6]; /* root, pin, vehicle, settings, owed, what was kept */
    uint32_t reserved[2];
} setup_head;
enum { HAS_LINK_KEY = 1, HAS_BOUNDARY_KEY = 2, HAS_LOG_KEY = 4, PACED = 8, HAS_SETTINGS = 16, HAS_OWED = 32 };
#define SETUP_MAGIC 0x315A5452u /* RTZ1 */

/* Keys fill pages of their own, so that a test can name them. */
static rt_keys keys RT_KEY_PAGES;
static uint8_t sealing[RT_KEY_BYTES] RT_KEY_PAGES;

static rt_boundary boundary;
static rt_kept kept;
static rt_preparation settings, owed;
static uint8_t root[RT_MAX_ROOT], vehicle[256], pin[RT_KEY_BYTES];
static uint8_t call[RT_MAX_CALL], answer[RT_MAX_RESULT], greeting[RT_GREETING_BYTES];
static uint32_t answer_size;
static uint8_t begun = USAGE; /* FINE once it began, else why it did not */
static bool paced, waits;     /* an answer waits for what is kept */
static int64_t kept_us;

/* ------------------------------------------------------------------------------------------------ what is kept */

static void seal(const rt_kept *what, uint8_t mac[RT_DIGEST_BYTES]) {
    const rt_bytes parts[] = {{(const uint8_t *)what, sizeof *what}};
    rt_hmac_sha256((rt_bytes){sealing, sizeof sealing}, parts, 1, mac);
}

/* Read what was kept: sealed by us, or nothing at all, which is a first start. */
static bool read_kept(rt_bytes blob) {
    uint8_t mac[RT_DIGEST_BYTES];
    if (blob.size == 0) {
        rt_kept_first first = {RT_KEPT_FIRST, 0, {0}, {0}};
        rt_sha256 hash;
        rt_sha256_begin(&hash);
        rt_sha256_add(&hash, (rt_bytes){(const uint8_t *)&first, offsetof(rt_kept_first, check)});
        rt_sha256_end(&hash, first.check);
        return rt_first_kept(&first, &kept);
    }
    if (blob.size != sizeof kept + sizeof mac) return false;
    memcpy(&kept, blob.at, sizeof kept);
    seal(&kept, mac);
    return rt_equal(mac, blob.at + sizeof kept, sizeof mac) && rt_is_whole_kept(&kept);
}

/* ------------------------------------------------------------------------------------------------ the start */

/* The parts of the setup, one behind the other; false where they do not fit. */
static bool take_parts(const setup_head *head, const uint8_t *at, const uint8_t *end, rt_bytes parts[6]) {
    for (int part = 0; part < 6; part++) {
        if (head->sizes[part] > (uint32_t)(end - at)) return false;
        parts[part] = (rt_bytes){at, head->sizes[part]};
        at += head->sizes[part];
    }
    return true;
}

static uint8_t begin(const uint8_t *setup_at, uint32_t size, const rt_home *home, int64_t *began_us) {
    static const uint8_t domain[] = "rtshcua/trustzone-m/kept";
    setup_head taken; /* aligned */
    const setup_head *head = &taken;
    rt_bytes parts[6];
    if (size < sizeof taken) return USAGE;
    memcpy(&taken, setup_at, sizeof taken);
    if (head->magic != SETUP_MAGIC || !take_parts(head, setup_at + sizeof taken, setup_at + size, parts)) return USAGE;
    if (parts[0].size > sizeof root || parts[1].size > sizeof pin || parts[2].size > sizeof vehicle) return USAGE;
    memcpy(root, parts[0].at, parts[0].size);
    memcpy(pin, parts[1].at, parts[1].size);
    memcpy(vehicle, parts[2].at, parts[2].size);
    *began_us = head->monotonic_us;
    memcpy(keys.session, head->keys[0], RT_KEY_BYTES);
    memcpy(keys.link, head->keys[1], RT_KEY_BYTES);
    memcpy(keys.boundary, head->keys[2], RT_KEY_BYTES);
    memcpy(keys.log, head->keys[3], RT_KEY_BYTES);
    const uint32_t flags = head->flags;
    paced = (flags & PACED) != 0;
    const rt_bytes what_for = {domain, sizeof domain};
    rt_hmac_sha256((rt_bytes){head->keys[4], RT_KEY_BYTES}, &what_for, 1, sealing);
    rt_wipe(taken.keys, sizeof taken.keys);
    if (!read_kept(parts[5])) return DAMAGED;
    uint8_t own[RT_KEY_BYTES];
    if (flags & HAS_BOUNDARY_KEY) rt_ed25519_public(keys.boundary, own);
    if (!rt_kept_is_of(&kept, flags & HAS_BOUNDARY_KEY ? own : NULL)) return DAMAGED;
    if ((flags & HAS_SETTINGS) && !rt_read_preparation(parts[3], &settings)) return USAGE;
    if ((flags & HAS_OWED) && !rt_read_preparation(parts[4], &owed)) return USAGE;
    kept.restarts++;
    const rt_setup setup = {
        &keys, &kept, {root, parts[0].size}, {pin, parts[1].size}, {vehicle, parts[2].size},
        (flags & HAS_LINK_KEY) != 0, (flags & HAS_BOUNDARY_KEY) != 0, (flags & HAS_LOG_KEY) != 0,
        flags & HAS_SETTINGS ? &settings : NULL, flags & HAS_OWED ? &owed : NULL,
        {head->monotonic_us, head->utc_us, head->utc_error_us}, head->stated_us, *home};
    if (rt_boundary_begin(&boundary, &setup) != NULL) return UNTRUSTED;
    rt_greet(&setup, 0, !paced, greeting);
    boundary.to_keep = true; /* that it was started once more */
    return FINE;
}

/* ------------------------------------------------------------------------------------------------ the way in */

static void put_word(uint8_t *at, uint32_t value) {
    for (int octet = 0; octet < 4; octet++) at[octet] = (uint8_t)(value >> 8 * octet & 0xFF);
}

/* Hand the answer out, and behind it what is to be kept; or that alone, while the answer waits for it. */
static uint32_t hand_out(uint8_t *mailbox, bool keeps, bool must) {
    uint32_t size = must ? 0 : answer_size;
    memcpy(mailbox + RT_MAILBOX_HEAD, answer, size);
    put_word(mailbox, size);
    put_word(mailbox + 4, keeps ? sizeof kept + RT_DIGEST_BYTES : 0);
    waits = must;
    if (!keeps) return RT_DONE;
    uint8_t mac[RT_DIGEST_BYTES];
    rt_seal_kept(&kept);
    seal(&kept, mac);
    memcpy(mailbox + RT_MAILBOX_HEAD + size, &kept, sizeof kept);
    memcpy(mailbox + RT_MAILBOX_HEAD + size + sizeof kept, mac, sizeof mac);
    return must ? RT_KEEP_FIRST : RT_DONE_KEEP;
}
_Static_assert(sizeof(rt_kept) + RT_DIGEST_BYTES == RT_BLOB_SIZE, "as the other side expects it");
_Static_assert(RT_MAILBOX_HEAD + RT_MAX_RESULT + sizeof(rt_kept) + RT_DIGEST_BYTES <= RT_MAILBOX_SIZE, "room for all of it");
_Static_assert(RT_MAILBOX_HEAD + RT_MAX_CALL <= RT_MAILBOX_SIZE, "and for any call");

static uint32_t answer_call(uint8_t *mailbox, uint32_t size, int64_t now_us) {
    if (size > sizeof call || waits) return RT_WRONG;
    memcpy(call, mailbox + RT_MAILBOX_HEAD, size); /* what is looked at is a copy: the normal world may go on writing there */
    answer_size = rt_answer(&boundary, (rt_bytes){call, size}, paced ? -1 : now_us, answer);
    const bool keeps = rt_is_to_be_kept(&boundary, now_us, kept_us), must = boundary.to_keep;
    if (keeps) {
        rt_gather_link(&boundary, RT_RESERVE);
        boundary.to_keep = false;
        kept_us = now_us;
    }
    return hand_out(mailbox, keeps, must);
}

uint32_t rt_world_answer(uint32_t want, uint8_t *mailbox, uint32_t size, int64_t now_us, uint32_t violations) {
    if (want == RT_WANT_STATUS) {
        put_word(mailbox, 4);
        put_word(mailbox + 4, 0);
        put_word(mailbox + RT_MAILBOX_HEAD, violations);
        return RT_DONE;
    }
    if (violations > 0) return RT_VIOLATED;
    if (begun != FINE) {
        answer[0] = begun;
        answer_size = 1;
        (void)hand_out(mailbox, false, false);
        return RT_NOT_BEGUN;
    }
    switch (want) {
    case RT_WANT_GREETING:
        memcpy(answer, greeting, sizeof greeting);
        for (int octet = 0; octet < 8; octet++) answer[sizeof greeting + (size_t)octet] = (uint8_t)(kept.turn >> 8 * octet & 0xFF);
        answer_size = sizeof greeting + 8;
        boundary.to_keep = false;
        return hand_out(mailbox, true, true);
    case RT_WANT_CALL:
        return answer_call(mailbox, size, now_us);
    case RT_WANT_END:
        rt_gather_link(&boundary, 0);
        (void)rt_give_back(&boundary);
        answer_size = 0;
        return hand_out(mailbox, true, true);
    case RT_WANT_KEPT:
    case RT_WANT_NOT_KEPT:
        if (!waits) return RT_WRONG;
        if (want == RT_WANT_NOT_KEPT) answer_size = rt_take_back(&boundary, answer);
        return hand_out(mailbox, false, false);
    default:
        return RT_WRONG;
    }
}

int64_t rt_world_begin(const uint8_t *setup, uint32_t size, const rt_home *home) {
    int64_t began_us = 0;
    begun = begin(setup, size, home, &began_us);
    if (begun != FINE) rt_world_wipe();
    return began_us;
}

void rt_world_wipe(void) {
    rt_wipe(&keys, sizeof keys);
    rt_wipe(sealing, sizeof sealing);
    rt_wipe(&boundary, sizeof boundary); /* it has copies of keys */
}
