/* libFuzzer target: the first octet is the kind of the others. */
#include "world.h"

#include "wire/approval.h"
#include "wire/cancellation.h"
#include "wire/flat.h"
#include "wire/preparation.h"
#include "wire/recall.h"
#include "wire/replacement.h"
#include "wire/request.h"

static rt_root root;
static rt_bundle bundle;
static rt_replacement replacement;
static rt_approvals approvals;

/* An array of byte strings: a root, a bundle, and documents for a flight of it. */
static void fly(rt_bytes data) {
    static const uint8_t flight_id[RT_FLIGHT_BYTES];
    rt_cursor cursor = {data.at, data.at + data.size};
    rt_bytes signed_root, sealed, document;
    rt_bytes replaced[64];
    uint32_t count, replaced_count = 0;
    if (!rt_cbor_valid(data, RT_ANY_ITEMS) || !rt_take_array(&cursor, &count) || count < 2 || !rt_take_octets(&cursor, &signed_root) ||
        rt_open_root(signed_root, (rt_bytes){NULL, 0}, 0, &root) != NULL || !rt_take_octets(&cursor, &sealed) ||
        rt_open_bundle(sealed, &root, (rt_bytes)RT_TEXT("quad-07"), 0, &bundle) != NULL)
        return;
    uint8_t missions[64][RT_DIGEST_BYTES];
    uint32_t mission_count = 1;
    memcpy(missions[0], bundle.mission_digest, RT_DIGEST_BYTES);
    approvals.count = 0;
    int64_t utc_us = bundle.mission.issued_at_us > 0 && bundle.mission.issued_at_us < RT_MAX_VALUE ? bundle.mission.issued_at_us + 60000000 : 0;
    while (rt_take_octets(&cursor, &document) && mission_count < 64) {
        rt_flight flight = {&root, RT_TEXT("quad-07"), {flight_id, RT_FLIGHT_BYTES}, {0, utc_us, 0}, &bundle, (const uint8_t(*)[RT_DIGEST_BYTES])missions, mission_count, replaced, replaced_count};
        const rt_artefact *kind = NULL;
        rt_answered answered;
        static rt_approval told[RT_MAX_ANSWERS];
        if (rt_kind_of(document, &kind) != NULL) continue;
        if (kind == &RT_APPROVAL && rt_open_approval(&flight, document, &answered) == NULL) rt_add_answer(&approvals, &answered, &flight.now);
        if (kind == &RT_RECALL) rt_open_recall(&flight, document, 0);
        if (kind == &RT_CANCELLATION) rt_open_cancellation(&flight, document, 0);
        if (kind == &RT_REPLACEMENT && rt_open_replacement(&flight, document, &replacement) == NULL && rt_fit_replacement(&replacement, &bundle, 0) == NULL) {
            for (uint32_t step = (uint32_t)replacement.kept; step < bundle.mission.invocation_count && replaced_count < 64; step++)
                replaced[replaced_count++] = bundle.mission.invocations[step];
            rt_replace(&replacement, &bundle);
            memcpy(missions[mission_count++], bundle.mission_digest, RT_DIGEST_BYTES);
            rt_keep_answers(&approvals, &bundle.mission);
        }
        for (uint32_t step = 0; step < bundle.mission.invocation_count; step++) {
            rt_invocation invocation;
            rt_invocation_at(&bundle.mission, step, &invocation);
            rt_answers_about(&approvals, &invocation, &flight.now, told);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static rt_request request;
    rt_preparation preparation;
    if (size == 0) return 0;
    rt_bytes rest = {data + 1, (uint32_t)(size - 1)};
    switch (data[0]) {
    case 0: rt_cbor_valid(rest, RT_ANY_ITEMS); break;
    case 1: rt_read_policy(rest, &bundle.policy); break;
    case 2: rt_read_mission(rest, &bundle.mission); break;
    case 3: rt_open_root(rest, (rt_bytes){NULL, 0}, 0, &root); break;
    case 4: fly(rest); break;
    case 5: rt_read_request(rest, 9, 2, &request); break;
    default: rt_read_preparation(rest, &preparation);
    }
    return 0;
}
