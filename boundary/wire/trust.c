#include "trust.h"

#include "flat.h"

const rt_bytes rt_sources[4] = {RT_TEXT("agent"), RT_TEXT("operator"), RT_TEXT("onboard"), RT_TEXT("reflex")};
static const rt_bytes any = RT_TEXT("*");

#define LINK_ID_BYTES 8

/* Take a map's next key if it is this one: the fields of a struct are in the order of their encodings. */
static bool field(rt_cursor *cursor, rt_bytes name) {
    rt_bytes key;
    rt_cursor again = *cursor;
    if (rt_take_text(cursor, &key) && rt_same(key, name)) return true;
    *cursor = again;
    return false;
}

#define FIELD(name) field(cursor, (rt_bytes)RT_TEXT(name))

static bool are_sources(rt_list texts) {
    rt_bytes each;
    while (rt_next_text(&texts, &each)) {
        bool known = false;
        for (size_t i = 0; i < sizeof rt_sources / sizeof rt_sources[0]; i++) known = known || rt_same(each, rt_sources[i]);
        if (!known) return false;
    }
    return true;
}

static bool key_of(rt_cursor *cursor, rt_key *key) {
    uint32_t count;
    rt_bytes duty;
    if (!rt_take_map(cursor, &count) || count != 9 || !FIELD("duty") || !rt_take_text(cursor, &duty)) return false;
    for (key->duty = 0; key->duty < RT_DUTIES && !rt_same(duty, rt_duty_name(key->duty));) key->duty++;
    if (key->duty == RT_DUTIES || !FIELD("roles") || !rt_take_texts(cursor, &key->roles) || !FIELD("person") ||
        !rt_take_text(cursor, &key->person) || !FIELD("public") || !rt_take_octets(cursor, &key->public) || !FIELD("sources") ||
        !rt_take_texts(cursor, &key->sources) || !FIELD("policies") || !rt_take_texts(cursor, &key->policies) || !FIELD("vehicles") ||
        !rt_take_texts(cursor, &key->vehicles) || !FIELD("expires_us"))
        return false;
    key->has_expiry = !rt_take_null(cursor);
    if ((key->has_expiry && !rt_take_int(cursor, &key->expires_us)) || !FIELD("development") || !rt_take_bool(cursor, &key->development) ||
        key->public.size != RT_KEY_BYTES || !rt_ed25519_strong(key->public.at) || !are_sources(key->sources))
        return false;
    rt_key_id(key->duty, key->public, key->kid);
    return true;
}

static bool thresholds(rt_cursor *cursor, int64_t of[RT_DUTIES]) {
    static const int64_t order[] = {RT_DUTY_LOG, RT_DUTY_ROOT, RT_DUTY_POLICY, RT_DUTY_MISSION, RT_DUTY_WITNESS, RT_DUTY_APPROVAL};
    uint32_t count, read = 0;
    of[RT_DUTY_WITNESS] = 1; /* the optional one */
    if (!rt_take_map(cursor, &count)) return false;
    for (size_t i = 0; i < sizeof order / sizeof order[0]; i++) {
        if (!field(cursor, rt_duty_name(order[i]))) {
            if (order[i] != RT_DUTY_WITNESS) return false;
        } else if (++read > count || !rt_take_int(cursor, &of[order[i]])) {
            return false;
        }
    }
    return read == count;
}

static bool root_of(rt_cursor *cursor, rt_root *root) {
    uint32_t fields;
    root->revoked = (rt_list){cursor->at, cursor->at, 0};
    if (!rt_take_map(cursor, &fields) || (fields != 6 && fields != 7) || !FIELD("keys") || !rt_take_array(cursor, &root->key_count) ||
        root->key_count > RT_MAX_KEYS)
        return false;
    for (uint32_t i = 0; i < root->key_count; i++)
        if (!key_of(cursor, &root->keys[i])) return false;
    if (fields == 7 && (!FIELD("revoked") || !rt_take_octet_strings(cursor, &root->revoked) || root->revoked.count == 0)) return false;
    return FIELD("version") && rt_take_int(cursor, &root->version) && FIELD("thresholds") && thresholds(cursor, root->thresholds) &&
           FIELD("development") && rt_take_bool(cursor, &root->development) && FIELD("issued_at_us") &&
           rt_take_int(cursor, &root->issued_at_us) && FIELD("expires_at_us") && rt_take_int(cursor, &root->expires_at_us);
}

static bool is_name(rt_bytes person) {
    if (person.size == 0 || person.size > 64) return false;
    for (uint32_t i = 0; i < person.size; i++) {
        uint8_t c = person.at[i];
        bool plain = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
        if (!plain && (i == 0 || (c != '.' && c != '_' && c != '-'))) return false;
    }
    return true;
}

/* An approval key belongs to one person, in one role and in person. */
static rt_refusal check_bound(const rt_key *key) {
    if ((key->person.size > 0 && key->duty != RT_DUTY_APPROVAL) || (key->policies.count > 0 && key->duty != RT_DUTY_MISSION)) return "malformed";
    if (key->duty != RT_DUTY_APPROVAL) return NULL;
    bool one = is_name(key->person) && key->roles.count == 1 && !rt_names(key->roles, any) && key->sources.count == 1 &&
               rt_names(key->sources, rt_sources[RT_SOURCE_OPERATOR]);
    return one ? NULL : "whose-approval";
}

static bool is_revoked(const rt_root *root, rt_bytes kid) { return rt_names(root->revoked, kid); }

static rt_refusal check_revoked(const rt_root *root) {
    rt_list left = root->revoked;
    rt_bytes each;
    while (rt_next_text(&left, &each))
        if ((each.size != RT_KID_BYTES && each.size != LINK_ID_BYTES) || rt_names(left, each)) return "malformed";
    for (uint32_t i = 0; i < root->key_count; i++)
        if (is_revoked(root, (rt_bytes){root->keys[i].kid, RT_KID_BYTES})) return "revoked-key";
    return NULL;
}

static rt_refusal check_thresholds(const rt_root *root) {
    uint32_t witnesses = 0;
    for (uint32_t i = 0; i < root->key_count; i++) witnesses += root->keys[i].duty == RT_DUTY_WITNESS;
    for (int64_t duty = 0; duty < RT_DUTY_BOUNDARY; duty++) { /* a vehicle has one boundary */
        int64_t threshold = root->thresholds[duty];
        if (threshold > 1 && duty != RT_DUTY_WITNESS) return "unsupported-threshold";
        if (threshold > 1 && threshold > witnesses) return "unreachable-threshold";
        if (threshold < 1) return "malformed";
    }
    return NULL;
}

/* Refuse a root that contradicts itself, independent of its signature. */
static rt_refusal check(const rt_root *root) {
    if (root->revoked.count > RT_MAX_REVOKED || root->version < 1 || root->expires_at_us <= root->issued_at_us) return "malformed";
    rt_refusal refusal = check_thresholds(root);
    for (uint32_t i = 0; i < root->key_count && refusal == NULL; i++)
        for (uint32_t j = 0; j < i; j++)
            if (rt_same(root->keys[i].public, root->keys[j].public)) refusal = "shared-key";
    for (uint32_t i = 0; i < root->key_count && refusal == NULL; i++) refusal = check_bound(&root->keys[i]);
    if (refusal == NULL) refusal = check_revoked(root);
    for (uint32_t i = 0; i < root->key_count && refusal == NULL && !root->development; i++)
        if (root->keys[i].development) refusal = "development-key";
    return refusal;
}

static rt_refusal decode(rt_bytes payload, rt_root *root) {
    rt_cursor cursor;
    rt_refusal refusal = rt_unwrap(&RT_ROOT, payload, &cursor);
    if (refusal != NULL) return refusal;
    return root_of(&cursor, root) ? check(root) : "malformed";
}

static const rt_key *find(const rt_root *root, rt_bytes kid) {
    for (uint32_t i = 0; i < root->key_count; i++)
        if (rt_same(kid, (rt_bytes){root->keys[i].kid, RT_KID_BYTES})) return &root->keys[i];
    return NULL;
}

rt_refusal rt_open_root(rt_bytes data, rt_bytes pinned, int64_t now_us, rt_root *root) {
    rt_envelope claimed;
    rt_refusal refusal = rt_take_apart(data, RT_MAX_ROOT, &claimed);
    bool whole = pinned.size == RT_KEY_BYTES; /* else only the root itself contains the key, so it is parsed first */
    if (refusal == NULL && !whole) refusal = decode(claimed.payload, root);
    if (refusal != NULL) return refusal;
    if (pinned.size == 0 && !root->development) return "unpinned";
    if (!rt_same(claimed.content_type, RT_ROOT.content_type)) return "wrong-content-type";
    rt_bytes public = pinned;
    uint8_t kid[RT_KID_BYTES];
    rt_bytes wanted = {kid, RT_KID_BYTES};
    if (whole) {
        if (!rt_ed25519_strong(pinned.at)) return "unknown-key";
        rt_key_id(RT_DUTY_ROOT, pinned, kid);
    } else {
        wanted = pinned.size == 0 ? claimed.kid : pinned;
        const rt_key *key = find(root, wanted);
        if (key == NULL || key->duty != RT_DUTY_ROOT) return "unknown-key";
        public = key->public;
    }
    if (!rt_same(claimed.kid, wanted)) return "unknown-key";
    if (!rt_signed_by(&claimed, RT_DUTY_ROOT, public)) return "bad-signature";
    if (whole) refusal = decode(claimed.payload, root);
    if (refusal != NULL) return refusal;
    const rt_key *signer = find(root, claimed.kid);
    if (signer == NULL) return "not-self-signed";
    if (now_us >= root->expires_at_us) return "expired";
    return signer->has_expiry && now_us >= signer->expires_us ? "key-expired" : NULL;
}

rt_refusal rt_open_envelope(rt_bytes envelope, const rt_root *root, int64_t duty, const rt_artefact *kind, uint32_t limit, rt_verified *opened) {
    rt_envelope claimed;
    rt_refusal refusal = rt_take_apart(envelope, limit, &claimed);
    if (refusal != NULL) return refusal;
    if (is_revoked(root, claimed.kid)) return "revoked-key";
    if (!rt_same(claimed.content_type, kind->content_type)) return "wrong-content-type";
    const rt_key *key = find(root, claimed.kid);
    if (key == NULL) return "unknown-key";
    if (key->duty != duty) return "wrong-duty";
    if (!rt_signed_by(&claimed, duty, key->public)) return "bad-signature";
    *opened = (rt_verified){claimed.payload, key};
    return NULL;
}

uint32_t rt_person(const rt_root *root, const rt_key *key) {
    uint32_t number = 0;
    while (number < root->key_count && !rt_same(root->keys[number].person, key->person)) number++; /* it is found, at the latest as the
                                                                                                      key itself */
    return number;
}

rt_refusal rt_key_refusal(const rt_key *key, rt_bytes vehicle, int64_t now_us) {
    if (key->has_expiry && now_us >= key->expires_us) return "key-expired";
    return rt_names(key->vehicles, vehicle) || rt_names(key->vehicles, any) ? NULL : "wrong-vehicle";
}

rt_refusal rt_speaker_refusal(const rt_key *key, rt_bytes role, rt_bytes source, rt_bytes vehicle, int64_t now_us) {
    rt_refusal refusal = rt_key_refusal(key, vehicle, now_us);
    if (refusal != NULL) return refusal;
    if (!rt_names(key->sources, source)) return "wrong-source";
    return rt_names(key->roles, role) || rt_names(key->roles, any) ? NULL : "wrong-role";
}

rt_refusal rt_proposer_refusal(const rt_key *key, rt_bytes role, rt_bytes source, rt_bytes policy, rt_bytes vehicle, int64_t now_us) {
    rt_refusal refusal = rt_speaker_refusal(key, role, source, vehicle, now_us);
    if (refusal != NULL) return refusal;
    return rt_names(key->policies, policy) || rt_names(key->policies, any) ? NULL : "key-other-policy";
}
