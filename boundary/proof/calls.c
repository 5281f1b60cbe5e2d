/* Frama-C's Eva runs this: calls of any octets to a boundary in any state. The called functions read all their input, write as much as
   their headers allow, and return anything. A call that signs ahead has up to EXACT octets, each length separately. */
#include "seal.h"
#include "enforcement/calls.h"

#define EXACT 75

static uint8_t octets[RT_MAX_CALL], few[EXACT], out[RT_MAX_RESULT];
static rt_boundary boundary;
static rt_keys keys;

static rt_refusal refused(void) { return EITHER() ? "refused" : NULL; }

static uint32_t written(uint8_t *into, uint32_t most) {
    make(into, most);
    return SIZE(most);
}

static rt_refusal permit_of(rt_bytes sealed, rt_permit *permit) {
    read_all(sealed);
    ANY(*permit);
    return refused();
}

bool rt_give_back(rt_boundary *of) { return EITHER(); }
rt_refusal rt_load(rt_boundary *of, const uint8_t flight[RT_FLIGHT_BYTES], const rt_now *now, int64_t own_us) { return refused(); }
uint32_t rt_present(rt_boundary *of, const rt_now *now, int64_t released, int64_t own_us, uint8_t *receipt) { return written(receipt, 256); }
bool rt_is_apart(int64_t now_us, int64_t own_us) { return EITHER(); }
int64_t rt_own_now(const rt_boundary *of, const rt_now *named, int64_t own_us, rt_now *now) {
    ANY(*now);
    return WITHIN(0, 4);
}
void rt_clock_settle(rt_clock *clock, int64_t monotonic_us) {}
bool rt_clock_asks(const rt_clock *clock, int64_t monotonic_us) { return EITHER(); }
void rt_clock_challenge(rt_clock *clock, int64_t number, int64_t monotonic_us) {}
int64_t rt_clock_number(const rt_clock *clock) { return WITHIN(0, INT64_MAX); }
void rt_clock_hear(rt_clock *clock, rt_bytes frame, uint8_t link, int64_t vehicle_us, int64_t monotonic_us) { read_all(frame); }
bool rt_attest(rt_boundary *of, int64_t session, const uint8_t before[RT_DIGEST_BYTES]) {
    read_all((rt_bytes){before, RT_DIGEST_BYTES});
    return EITHER();
}
uint32_t rt_attested(rt_boundary *of, const rt_now *now, int64_t own_us, bool final, uint8_t *statement) { return written(statement, RT_MAX_STATEMENT); }
rt_refusal rt_begin_log(rt_boundary *of, rt_bytes checkpoint, uint8_t made[RT_SIGNATURE_BYTES]) {
    read_all(checkpoint);
    make(made, RT_SIGNATURE_BYTES);
    return refused();
}
uint32_t rt_enforce(rt_boundary *of, rt_bytes request, int64_t own_us, uint8_t *response) {
    read_all(request);
    return written(response, RT_MAX_RESPONSE);
}
rt_refusal rt_permit_preparation(rt_issuer *issuer, const uint8_t key[RT_KEY_BYTES], rt_bytes ask, int64_t now_us, uint8_t *made, uint32_t *size) {
    read_all(ask);
    *size = written(made, RT_MAX_PREPARATION);
    return refused();
}
rt_refusal rt_executor_prepare(rt_executor *executor, rt_bytes sealed, int64_t now_us) {
    read_all(sealed);
    return refused();
}
rt_refusal rt_dispatch(rt_executor *executor, rt_bytes sealed, int64_t now_us, rt_permit *permit) { return permit_of(sealed, permit); }
rt_refusal rt_stand_in(rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us, rt_permit *permit) { return permit_of(sealed, permit); }
rt_refusal rt_may_stand_in(const rt_executor *executor, rt_bytes sealed, int64_t kind, int64_t link, int64_t now_us, rt_permit *permit,
                           rt_command *command) {
    ANY(*command);
    return permit_of(sealed, permit);
}
void rt_ended(rt_executor *executor) {}
void rt_ended_command(rt_executor *executor, uint64_t token) {}
void rt_landed(rt_executor *executor) {}
void rt_release(rt_executor *executor) {}
void rt_gate_prepared(rt_gate *gate) {}
bool rt_gate_stands(const rt_gate *gate, int64_t now_us) { return EITHER(); }
void rt_gate_observe(rt_gate *gate, rt_bytes frame, int64_t now_us) { read_all(frame); }
rt_refusal rt_gate_seal(rt_gate *gate, rt_bytes frame, int64_t now_us, uint8_t *sealed, uint32_t *size) {
    read_all(frame);
    *size = written(sealed, RT_LARGEST_FRAME);
    return refused();
}
rt_refusal rt_gate_sign_ahead(rt_gate *gate, const rt_command *command, rt_bytes frame, int64_t now_us, uint8_t *made) {
    read_all(frame);
    make(made, RT_SIGNATURE);
    return refused();
}
void rt_set_flags(uint8_t *frame, uint8_t flags) { make(frame, RT_LARGEST_FRAME); }

/* It accepts none that is shorter than a signed one. */
rt_heard rt_accept_frame(rt_signed_link *link, rt_bytes frame, int64_t now_us) {
    read_all(frame);
    return frame.size < RT_HEADER + RT_CHECKSUM + RT_SIGNATURE ? RT_UNSIGNED : (rt_heard)WITHIN(RT_ACCEPTED, RT_CROWDED);
}

int main(void) {
    uint32_t size = SIZE(EXACT);
    ANY(keys);
    ANY(octets);
    ANY(few);
    ANY(boundary.chain.digest);
    boundary.keys = &keys;
    boundary.loaded = EITHER(), boundary.opened = EITHER(), boundary.executor.flies = EITHER(), boundary.executor.gate.signs = EITHER();
    boundary.flights = (uint64_t)WITHIN(0, INT64_MAX);
    static const uint32_t bundles[] = {0, RT_MAX_PART, RT_MAX_BUNDLE - 5, RT_MAX_BUNDLE}, documents[] = {0, RT_MAX_PART, RT_MAX_DOCUMENT - 5, RT_MAX_DOCUMENT};
    int filled = Frama_C_interval(0, 3);
    //@ split filled;
    boundary.bundle_size = bundles[filled], boundary.document_size = documents[filled];
    boundary.document_count = SIZE(RT_MAX_REPLACEMENTS);
    if (EITHER()) {
        octets[0] = (uint8_t)(EITHER() ? SIZE(RT_CALL_AHEAD - 1) : RT_CALL_AHEAD + 1 + SIZE(UINT8_MAX - RT_CALL_AHEAD - 1));
        return (int)rt_answer(&boundary, (rt_bytes){octets, EXACT + SIZE(RT_MAX_CALL - EXACT)}, WITHIN(-1, INT64_MAX), out);
    }
    //@ split size;
    //@ merge filled;
    size = (uint32_t)rt_answer(&boundary, (rt_bytes){few + EXACT - size, size}, WITHIN(-1, INT64_MAX), out);
    return (int)rt_take_back(&boundary, out);
}
