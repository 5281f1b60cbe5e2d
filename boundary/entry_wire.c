/* The interface of crypto/ and wire/ for the tests: each function of the boundary, with bytes given by address and size. */
#include "crypto/crypto.h"
#include "wire/approval.h"
#include "wire/cancellation.h"
#include "wire/flat.h"
#include "wire/permit.h"
#include "wire/preparation.h"
#include "wire/recall.h"
#include "wire/receipt.h"
#include "wire/replacement.h"
#include "wire/request.h"
#include "wire/response.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT void rt_test_sha256(const uint8_t *data, uint32_t size, uint32_t step, uint8_t *digest);
EXPORT void rt_test_hmac(const uint8_t *key, uint32_t key_size, const uint8_t *data, uint32_t size, uint8_t *mac);
EXPORT bool rt_test_verify(const uint8_t *key, const uint8_t *signature, const uint8_t *data, uint32_t size);
EXPORT void rt_test_sign(const uint8_t *seed, const uint8_t *data, uint32_t size, uint8_t *key, uint8_t *signature);
EXPORT bool rt_test_equal(const uint8_t *one, const uint8_t *other, uint32_t size);

void rt_test_sha256(const uint8_t *data, uint32_t size, uint32_t step, uint8_t *digest) {
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    for (uint32_t at = 0; at < size; at += step) rt_sha256_add(&hash, (rt_bytes){data + at, size - at < step ? size - at : step});
    rt_sha256_end(&hash, digest);
}

void rt_test_hmac(const uint8_t *key, uint32_t key_size, const uint8_t *data, uint32_t size, uint8_t *mac) {
    rt_bytes parts[2] = {{data, size / 2}, {data + size / 2, size - size / 2}};
    rt_hmac_sha256((rt_bytes){key, key_size}, parts, 2, mac);
}

bool rt_test_verify(const uint8_t *key, const uint8_t *signature, const uint8_t *data, uint32_t size) {
    rt_bytes parts[2] = {{data, size / 3}, {data + size / 3, size - size / 3}};
    return rt_ed25519_verify(key, signature, parts, 2);
}

void rt_test_sign(const uint8_t *seed, const uint8_t *data, uint32_t size, uint8_t *key, uint8_t *signature) {
    rt_bytes part = {data, size};
    rt_ed25519_public(seed, key);
    rt_ed25519_sign(seed, &part, 1, signature);
}

bool rt_test_equal(const uint8_t *one, const uint8_t *other, uint32_t size) { return rt_equal(one, other, size); }

EXPORT bool rt_test_cbor(const uint8_t *data, uint32_t size);
EXPORT rt_refusal rt_test_policy(const uint8_t *data, uint32_t size, const rt_policy **read);
EXPORT rt_refusal rt_test_mission(const uint8_t *data, uint32_t size, const rt_mission **read);
EXPORT void rt_test_invocation(const rt_mission *mission, uint32_t step, rt_invocation *read);
EXPORT uint32_t rt_test_frame(uint32_t which, uint8_t *frame, const char **content_type);

static rt_policy test_policy;
static rt_mission test_mission;

bool rt_test_cbor(const uint8_t *data, uint32_t size) { return rt_cbor_valid((rt_bytes){data, size}, RT_ANY_ITEMS); }

rt_refusal rt_test_policy(const uint8_t *data, uint32_t size, const rt_policy **read) {
    *read = &test_policy;
    return rt_read_policy((rt_bytes){data, size}, &test_policy);
}

rt_refusal rt_test_mission(const uint8_t *data, uint32_t size, const rt_mission **read) {
    *read = &test_mission;
    return rt_read_mission((rt_bytes){data, size}, &test_mission);
}

void rt_test_invocation(const rt_mission *mission, uint32_t step, rt_invocation *read) { rt_invocation_at(mission, step, read); }

uint32_t rt_test_frame(uint32_t which, uint8_t *frame, const char **content_type) {
    const rt_artefact *every[] = {&RT_ROOT, &RT_POLICY, &RT_MISSION, &RT_BUNDLE, &RT_APPROVAL, &RT_RECALL, &RT_REPLACEMENT,
                                  &RT_CANCELLATION, &RT_RECEIPT, &RT_REQUEST, &RT_RESPONSE};
    *content_type = (const char *)every[which]->content_type.at;
    return rt_wrap(frame, every[which]);
}

EXPORT rt_refusal rt_test_root(const uint8_t *data, uint32_t size, const uint8_t *pinned, uint32_t pinned_size, int64_t now_us);
EXPORT rt_refusal rt_test_bundle(const uint8_t *data, uint32_t size, const uint8_t *vehicle, uint32_t vehicle_size, int64_t now_us, uint8_t digests[3][RT_DIGEST_BYTES]);

static rt_root test_root;
static rt_bundle test_bundle;

rt_refusal rt_test_root(const uint8_t *data, uint32_t size, const uint8_t *pinned, uint32_t pinned_size, int64_t now_us) {
    return rt_open_root((rt_bytes){data, size}, (rt_bytes){pinned, pinned_size}, now_us, &test_root);
}

rt_refusal rt_test_bundle(const uint8_t *data, uint32_t size, const uint8_t *vehicle, uint32_t vehicle_size, int64_t now_us, uint8_t digests[3][RT_DIGEST_BYTES]) {
    rt_refusal refusal = rt_open_bundle((rt_bytes){data, size}, &test_root, (rt_bytes){vehicle, vehicle_size}, now_us, &test_bundle);
    memcpy(digests[0], test_bundle.policy_digest, RT_DIGEST_BYTES);
    memcpy(digests[1], test_bundle.mission_digest, RT_DIGEST_BYTES);
    memcpy(digests[2], test_bundle.digest, RT_DIGEST_BYTES);
    return refusal;
}

enum { NONE, APPROVAL, RECALL, REPLACEMENT, CANCELLATION };

EXPORT void rt_test_begin(const uint8_t *vehicle, uint32_t vehicle_size, const uint8_t *flight);
EXPORT rt_refusal rt_test_document(const uint8_t *data, uint32_t size, const int64_t now[3], int64_t issued_at_us, int64_t released, uint32_t current,
                                   int64_t out[7]);
EXPORT void rt_test_replace(void);
EXPORT uint32_t rt_test_about(uint32_t step, const int64_t now[3], int64_t *out);

static rt_replacement test_replacement;
static rt_approvals test_approvals;
static uint8_t test_missions[RT_MAX_REPLACEMENTS + 1][RT_DIGEST_BYTES];
static rt_bytes test_replaced[4096];
static rt_flight test_flight;

/* A flight of the last opened bundle. */
void rt_test_begin(const uint8_t *vehicle, uint32_t vehicle_size, const uint8_t *flight) {
    test_flight = (rt_flight){&test_root, {vehicle, vehicle_size}, {flight, RT_FLIGHT_BYTES}, {0, 0, 0}, &test_bundle, (const uint8_t(*)[RT_DIGEST_BYTES])test_missions, 1, test_replaced, 0};
    memcpy(test_missions[0], test_bundle.mission_digest, RT_DIGEST_BYTES);
    test_approvals.count = 0;
}

rt_refusal rt_test_document(const uint8_t *data, uint32_t size, const int64_t now[3], int64_t issued_at_us, int64_t released, uint32_t current,
                            int64_t out[7]) {
    rt_bytes document = {data, size};
    const rt_artefact *kind;
    rt_answered answered;
    test_flight.now = (rt_now){now[0], now[1], now[2]};
    out[0] = NONE;
    rt_refusal refusal = rt_kind_of(document, &kind);
    if (refusal != NULL) return refusal;
    if (kind == &RT_RECALL) {
        out[0] = RECALL;
        return rt_open_recall(&test_flight, document, issued_at_us);
    }
    if (kind == &RT_CANCELLATION) {
        out[0] = CANCELLATION;
        return rt_open_cancellation(&test_flight, document, current);
    }
    if (kind == &RT_REPLACEMENT) {
        out[0] = REPLACEMENT;
        refusal = rt_open_replacement(&test_flight, document, &test_replacement);
        return refusal != NULL ? refusal : rt_fit_replacement(&test_replacement, &test_bundle, released);
    }
    out[0] = APPROVAL;
    refusal = rt_open_approval(&test_flight, document, &answered);
    if (refusal != NULL) return refusal;
    int64_t said[] = {answered.step, answered.role, answered.person, answered.granted, answered.monotonic_us, answered.expires_us};
    memcpy(out + 1, said, sizeof said);
    return rt_add_answer(&test_approvals, &answered, &test_flight.now);
}

void rt_test_replace(void) {
    for (uint32_t step = (uint32_t)test_replacement.kept; step < test_bundle.mission.invocation_count; step++)
        test_replaced[test_flight.replaced_count++] = test_bundle.mission.invocations[step];
    rt_replace(&test_replacement, &test_bundle);
    memcpy(test_missions[test_flight.mission_count++], test_bundle.mission_digest, RT_DIGEST_BYTES);
    rt_keep_answers(&test_approvals, &test_bundle.mission);
}

uint32_t rt_test_about(uint32_t step, const int64_t now[3], int64_t *out) {
    static rt_approval found[RT_MAX_ANSWERS];
    rt_invocation invocation;
    rt_now moment = {now[0], now[1], now[2]};
    rt_invocation_at(&test_bundle.mission, step, &invocation);
    uint32_t count = rt_answers_about(&test_approvals, &invocation, &moment, found);
    memcpy(out, found, count * sizeof found[0]);
    return count;
}

EXPORT uint32_t rt_test_receipt(const int64_t numbers[5], const uint8_t *slug, uint32_t slug_size, const uint8_t *text, uint32_t text_size, uint8_t *out);
EXPORT uint32_t rt_test_preparation(const uint8_t *data, uint32_t size, const uint8_t *key, uint8_t *out);
EXPORT uint32_t rt_test_permit(const uint8_t *data, uint32_t size, const uint8_t *key, uint8_t *out);
EXPORT bool rt_test_request(const uint8_t *data, uint32_t size, int64_t slots, uint32_t monitors, rt_request *read);
EXPORT uint32_t rt_test_answer(const rt_decision *decision, int64_t consumed, const uint8_t *permit, uint8_t *out);
EXPORT uint32_t rt_test_refusal(uint8_t status, uint8_t *out);

static const uint8_t no_evidence[RT_DIGEST_BYTES];

uint32_t rt_test_receipt(const int64_t numbers[5], const uint8_t *slug, uint32_t slug_size, const uint8_t *text, uint32_t text_size, uint8_t *out) {
    rt_receipt receipt = {numbers[0], {slug, slug_size}, {text, text_size}, numbers[1], numbers[2], numbers[3], numbers[4], {NULL, 0}};
    return rt_write_receipt(&receipt, out);
}

/* An opened permit is sealed again, so that every field is compared. */
uint32_t rt_test_preparation(const uint8_t *data, uint32_t size, const uint8_t *key, uint8_t *out) {
    rt_preparation preparation;
    return rt_open_preparation((rt_bytes){data, size}, key, &preparation) ? rt_seal_preparation(&preparation, key, out) : 0;
}

uint32_t rt_test_permit(const uint8_t *data, uint32_t size, const uint8_t *key, uint8_t *out) {
    rt_permit permit;
    if (!rt_open_permit((rt_bytes){data, size}, key, &permit)) return 0;
    rt_seal_permit(&permit, key, out);
    return RT_PERMIT_BYTES;
}

bool rt_test_request(const uint8_t *data, uint32_t size, int64_t slots, uint32_t monitors, rt_request *read) {
    return rt_read_request((rt_bytes){data, size}, slots, monitors, read);
}

uint32_t rt_test_answer(const rt_decision *decision, int64_t consumed, const uint8_t *permit, uint8_t *out) {
    return rt_write_answer(decision, consumed, permit, no_evidence, out);
}

uint32_t rt_test_refusal(uint8_t status, uint8_t *out) { return rt_write_refusal(status, no_evidence, out); }
