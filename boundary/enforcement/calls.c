#include "calls.h"

#include "wire/octets.h"

/* The unread rest of a call. */
typedef struct {
    const uint8_t *at, *end;
    bool short_; /* more was read than available */
} reader;

static rt_bytes rest_of(const reader *call) { return (rt_bytes){call->at, (uint32_t)(call->end - call->at)}; }

static int64_t take(reader *call, uint32_t octets) {
    call->short_ = call->short_ || octets > rest_of(call).size;
    return call->short_ ? 0 : rt_take_signed(&call->at, octets);
}

static uint32_t refuse(rt_refusal slug, uint8_t *out) {
    const rt_bytes words = rt_words(slug);
    out[0] = 1;
    memcpy(out + 1, words.at, words.size);
    return 1 + words.size;
}

/* A time that a request may contain: computed values stay within 64 bits. */
static bool is_time(int64_t time) { return time >= 0 && time <= RT_MAX_VALUE; }

static uint32_t permitted(rt_refusal refused, const rt_permit *permit, uint8_t *out) {
    if (refused != NULL)
        return refuse(refused, out);
    uint8_t *at = out;
    rt_put(&at, 0, 1);
    rt_put(&at, (uint64_t)permit->kind, 1);
    rt_put(&at, (uint64_t)permit->step, 2);
    rt_put(&at, (uint64_t)permit->link, 2);
    rt_put(&at, permit->serial, 8);
    rt_put(&at, (uint64_t)permit->not_after_us, 8);
    return (uint32_t)(at - out);
}

static bool take_now(reader *call, rt_now *now) {
    now->monotonic_us = take(call, 8);
    now->utc_us = take(call, 8);
    now->utc_error_us = take(call, 8);
    return !call->short_ && is_time(now->monotonic_us) && is_time(now->utc_us) && is_time(now->utc_error_us);
}

static uint32_t observe(rt_boundary *boundary, rt_bytes frame, int64_t now_us, int64_t own_us, uint8_t *out) {
    uint8_t bare[RT_LARGEST_FRAME];
    rt_gate *gate = &boundary->executor.gate;
    rt_heard heard = RT_ACCEPTED;
    if (gate->signs) {
        heard = rt_accept_frame(&gate->signer, frame, now_us);
        const bool whole = frame.size > RT_HEADER && frame.size == RT_HEADER + (uint32_t)frame.at[1] + RT_CHECKSUM + RT_SIGNATURE;
        if (heard == RT_ACCEPTED && frame.size <= sizeof bare && whole) {
            const uint8_t link = frame.at[frame.size - RT_SIGNATURE];
            memcpy(bare, frame.at, frame.size);
            rt_set_flags(bare, 0);
            frame = (rt_bytes){bare, frame.size - RT_SIGNATURE};
            const bool known = gate->autopilot == RT_MAV_AUTOPILOT_ARDUPILOTMEGA && gate->system == frame.at[5];
            if (own_us >= 0) rt_clock_hear(&boundary->clock, frame, link, known ? RT_ARDUPILOT_US : RT_VEHICLE_US, own_us);
        }
    }
    if (heard == RT_ACCEPTED)
        rt_gate_observe(gate, frame, now_us);
    out[0] = 0;
    out[1] = (uint8_t)heard;
    return 2;
}

/* A part follows the previous ones; the first one begins anew. */
static rt_refusal stage(rt_boundary *boundary, int64_t what, int64_t at, rt_bytes part) {
    bool document = what == RT_CALL_PRESENT;
    uint32_t *size = document ? &boundary->document_size : &boundary->bundle_size;
    const uint32_t most = document ? RT_MAX_DOCUMENT : RT_MAX_BUNDLE;
    if (!document && what != RT_CALL_LOAD) return "malformed";
    if (document ? !boundary->loaded : boundary->loaded && boundary->executor.flies) return document ? "not-loaded" : "flies";
    if (!document) {
        if (rt_give_back(boundary)) boundary->to_keep = true; /* a bundle of which nothing was sent may be loaded again, after a crash
                                                                 too */
        boundary->loaded = false;
    }
    if (at == 0) *size = 0;
    if (at != *size) return "malformed";
    if (part.size > most - *size) return "too-large";
    uint8_t *into = document ? boundary->documents[boundary->document_count] : boundary->bundle;
    if (part.size > 0) memcpy(into + *size, part.at, part.size);
    *size += part.size;
    return NULL;
}

/* An unpredictable value: the keyed digest of a word and a count. */
static void draw(const rt_boundary *boundary, rt_bytes domain, uint64_t number, uint8_t digest[RT_DIGEST_BYTES]) {
    uint8_t count[8];
    for (uint32_t octet = 0; octet < 8; octet++) count[octet] = (uint8_t)(number >> 8 * octet & 0xFF);
    const rt_bytes parts[] = {domain, {count, sizeof count}};
    rt_hmac_sha256((rt_bytes){boundary->keys->session, RT_KEY_BYTES}, parts, 2, digest);
}

/* The id of the next flight, which cannot be chosen to equal an earlier one. */
static void next_flight(const rt_boundary *boundary, uint8_t flight[RT_FLIGHT_BYTES]) {
    static const uint8_t domain[] = "rtshcua/flight";
    uint8_t digest[RT_DIGEST_BYTES];
    draw(boundary, (rt_bytes){domain, sizeof domain}, boundary->flights, digest);
    memcpy(flight, digest, RT_FLIGHT_BYTES);
}

/* TIME: the time, and the challenge for the vehicle if the time is not known and its link has a key. */
static uint32_t answer_time(rt_boundary *boundary, bool settle, int64_t own_us, uint8_t *out) {
    static const uint8_t domain[] = "rtshcua/challenge";
    static const rt_now nobody = {0, 0, RT_UTC_UNKNOWN_US};
    uint8_t digest[RT_DIGEST_BYTES], *at = out;
    rt_clock *clock = &boundary->clock;
    rt_now now;
    if (own_us >= 0 && settle) rt_clock_settle(clock, own_us);
    if (own_us >= 0 && boundary->executor.gate.signs && rt_clock_asks(clock, own_us)) {
        draw(boundary, (rt_bytes){domain, sizeof domain}, boundary->challenges++, digest);
        int64_t number = 0;
        for (uint32_t octet = 0; octet < 7; octet++) number = number << 8 | digest[octet];
        rt_clock_challenge(clock, number + 1, own_us);
    }
    const int64_t source = rt_own_now(boundary, &nobody, own_us, &now);
    rt_put(&at, 0, 1);
    rt_put(&at, (uint64_t)source, 1);
    rt_put(&at, (uint64_t)now.monotonic_us, 8);
    rt_put(&at, (uint64_t)now.utc_us, 8);
    rt_put(&at, (uint64_t)now.utc_error_us, 8);
    rt_put(&at, (uint64_t)(own_us < 0 ? 0 : rt_clock_number(clock)), 8);
    return (uint32_t)(at - out);
}

static uint32_t load(rt_boundary *boundary, const rt_now *now, int64_t own_us, uint8_t *out) {
    rt_refusal refused;
    next_flight(boundary, out + 1);
    refused = rt_load(boundary, out + 1, now, own_us);
    if (refused != NULL) return refuse(refused, out);
    boundary->flights++;
    out[0] = 0;
    out[1 + RT_FLIGHT_BYTES] = boundary->opened ? 1 : 0;
    return 2 + RT_FLIGHT_BYTES;
}

/* LOAD and PRESENT: for data that was transferred in parts. */
static uint32_t answer_staged(rt_boundary *boundary, int64_t kind, reader *left, int64_t own_us, uint8_t *out) {
    rt_now now;
    const bool timed = take_now(left, &now);
    int64_t released = kind == RT_CALL_PRESENT ? take(left, 4) : 0;
    int64_t size = take(left, 4);
    bool sound = !left->short_ && left->at == left->end && released >= 0;
    if (!sound || !timed) return refuse("malformed", out);
    if (size != (kind == RT_CALL_LOAD ? boundary->bundle_size : boundary->document_size)) return refuse("malformed", out);
    if (rt_is_apart(now.monotonic_us, own_us)) return refuse("time-apart", out);
    if (kind == RT_CALL_LOAD) return load(boundary, &now, own_us, out);
    if (!boundary->loaded) return refuse("not-loaded", out);
    out[0] = 0;
    return 1 + rt_present(boundary, &now, released, own_us, out + 1);
}

/* Parameters that are set before a flight, and restored after it. */
static uint32_t answer_preparation(rt_boundary *boundary, int64_t kind, reader *left, int64_t own_us, uint8_t *out) {
    uint32_t size = 0;
    rt_refusal refused = NULL;
    int64_t now_us = kind == RT_CALL_PREPARED ? 0 : take(left, 8);
    if (left->short_ || !is_time(now_us)) return refuse("malformed", out);
    if (kind != RT_CALL_PREPARED && rt_is_apart(now_us, own_us))
        return refuse(kind == RT_CALL_PREPARE ? rt_prepare_apart(&boundary->executor) : "time-apart", out);
    if (kind == RT_CALL_PERMIT)
        refused = rt_permit_preparation(&boundary->issuer, boundary->executor.key, rest_of(left), now_us, out + 1, &size);
    else if (kind == RT_CALL_PREPARE) refused = rt_executor_prepare(&boundary->executor, rest_of(left), now_us);
    else rt_gate_prepared(&boundary->executor.gate);
    if (refused != NULL) return refuse(refused, out);
    out[0] = 0;
    return 1 + size;
}

/* Calls for the flight's executor, about a permit or the end of a command. */
static uint32_t answer_executor(rt_boundary *boundary, int64_t kind, reader *left, int64_t own_us, uint8_t *out) {
    rt_executor *executor = &boundary->executor;
    rt_permit permit;
    if (kind == RT_CALL_ENDED && left->at == left->end) rt_ended(executor);
    else if (kind == RT_CALL_ENDED) rt_ended_command(executor, (uint64_t)take(left, 8));
    else if (kind == RT_CALL_LANDED) rt_landed(executor);
    else if (kind == RT_CALL_RELEASE) rt_release(executor);
    else {
        int64_t now_us = take(left, 8);
        if (left->short_ || !is_time(now_us)) return refuse("malformed", out);
        if (rt_is_apart(now_us, own_us)) return refuse(rt_dispatch_apart(executor, now_us), out);
        if (kind == RT_CALL_WITHDRAW) {
            rt_refusal refused = rt_withdraw(executor, &boundary->session, rest_of(left), now_us);
            if (refused != NULL) return refuse(refused, out);
            out[0] = 0;
            return 1;
        }
        if (kind == RT_CALL_DISPATCH) return permitted(rt_dispatch(executor, rest_of(left), now_us, &permit), &permit, out);
        int64_t what = take(left, 1), link = take(left, 1);
        return permitted(rt_stand_in(executor, rest_of(left), what, link, now_us, &permit), &permit, out);
    }
    out[0] = 0;
    return 1;
}

/* AHEAD: all frames of one link, or none. */
static uint32_t answer_ahead(rt_boundary *boundary, reader *left, int64_t own_us, uint8_t *out) {
    rt_executor *executor = &boundary->executor;
    rt_permit permit;
    rt_command command;
    uint8_t *at = out;
    int64_t now_us = take(left, 8), kind = take(left, 1), link = take(left, 1);
    if (left->short_ || rest_of(left).size < RT_PERMIT_BYTES || !is_time(now_us)) return refuse("malformed", out);
    if (rt_is_apart(now_us, own_us)) return refuse("time-apart", out);
    const rt_bytes sealed = {left->at, RT_PERMIT_BYTES};
    left->at += RT_PERMIT_BYTES;
    rt_refusal refused = rt_may_stand_in(executor, sealed, kind, link, now_us, &permit, &command);
    if (refused != NULL) return refuse(refused, out);
    rt_put(&at, 0, 1);
    rt_put(&at, permit.serial, 8);
    for (uint32_t count = 0; left->at < left->end; count++) {
        int64_t size = take(left, 2);
        if (left->short_ || size < 0 || size > left->end - left->at || count == RT_MOST_AHEAD) return refuse("malformed", out);
        //@ split size;
        refused = rt_gate_sign_ahead(&executor->gate, &command, (rt_bytes){left->at, (uint32_t)size}, now_us, at);
        if (refused != NULL) return refuse(refused, out);
        left->at += size;
        at += executor->gate.signs ? RT_SIGNATURE : 0;
    }
    return (uint32_t)(at - out);
}

uint32_t rt_answer(rt_boundary *boundary, rt_bytes call, int64_t own_us, uint8_t *out) {
    reader left = {call.at, call.at + call.size, false};
    int64_t kind = take(&left, 1), now_us;
    rt_now now;
    rt_refusal refused = "malformed";
    uint32_t size = 0;
    switch (kind) {
    case RT_CALL_PART: {
        int64_t what = take(&left, 1), at = take(&left, 4);
        refused = left.short_ ? "malformed" : stage(boundary, what, at, rest_of(&left));
        break;
    }
    case RT_CALL_LOAD:
    case RT_CALL_PRESENT:
        return answer_staged(boundary, kind, &left, own_us, out);
    case RT_CALL_ENFORCE:
        if (!boundary->loaded) return refuse("not-loaded", out);
        size = rt_enforce(boundary, rest_of(&left), own_us, out + 1);
        refused = NULL;
        break;
    case RT_CALL_AHEAD:
        return boundary->loaded ? answer_ahead(boundary, &left, own_us, out) : refuse("not-loaded", out);
    case RT_CALL_DISPATCH:
    case RT_CALL_STAND_IN:
    case RT_CALL_ENDED:
    case RT_CALL_LANDED:
    case RT_CALL_RELEASE:
    case RT_CALL_WITHDRAW:
        return boundary->loaded ? answer_executor(boundary, kind, &left, own_us, out) : refuse("not-loaded", out);
    case RT_CALL_PERMIT:
    case RT_CALL_PREPARE:
    case RT_CALL_PREPARED:
        return boundary->loaded ? answer_preparation(boundary, kind, &left, own_us, out) : refuse("not-loaded", out);
    case RT_CALL_STANDS:
    case RT_CALL_OBSERVE: /* and frames that always pass do so before a bundle is in force too */
    case RT_CALL_SEAL:
        now_us = take(&left, 8);
        if (left.short_ || !is_time(now_us)) break;
        refused = "time-apart";
        if (rt_is_apart(now_us, own_us)) break;
        if (kind == RT_CALL_STANDS) {
            out[1] = rt_gate_stands(&boundary->executor.gate, now_us) ? 1 : 0;
            size = 1;
            refused = NULL;
            break;
        }
        if (kind == RT_CALL_OBSERVE) return observe(boundary, rest_of(&left), now_us, own_us, out);
        refused = rt_gate_seal(&boundary->executor.gate, rest_of(&left), now_us, out + 1, &size);
        break;
    case RT_CALL_BEGIN:
        if (!boundary->loaded || left.end - left.at != 8 + RT_DIGEST_BYTES) break;
        now_us = take(&left, 8);
        if (!is_time(now_us)) break; /* a number within the same bounds */
        refused = rt_attest(boundary, now_us, left.at) ? NULL : "no-boundary-key";
        for (uint32_t octet = 0; octet < 8; octet++) out[1 + octet] = (uint8_t)((uint64_t)boundary->attestation >> (56 - 8 * octet) & 0xFF);
        memcpy(out + 9, boundary->before, RT_DIGEST_BYTES);
        size = 8 + RT_DIGEST_BYTES;
        break;
    case RT_CALL_STATEMENT: {
        const bool final = take(&left, 1) != 0;
        if (!take_now(&left, &now)) break;
        size = rt_attested(boundary, &now, own_us, final, out + 1);
        refused = size > 0 ? NULL : "no-boundary-key";
        break;
    }
    case RT_CALL_HOME:
        size = boundary->loaded ? rt_attest_home(boundary, out + 1) : 0;
        refused = size > 0 ? NULL : "no-boundary-key";
        break;
    case RT_CALL_TIME:
        return left.end - left.at == 1 ? answer_time(boundary, take(&left, 1) != 0, own_us, out) : refuse("malformed", out);
    case RT_CALL_FLIGHT:
        next_flight(boundary, out + 1);
        size = RT_FLIGHT_BYTES;
        refused = NULL;
        break;
    case RT_CALL_LOG:
        if (!boundary->loaded) return refuse("not-loaded", out);
        refused = rt_begin_log(boundary, rest_of(&left), out + 1);
        size = RT_SIGNATURE_BYTES;
        break;
    case RT_CALL_DIGEST:
        memcpy(out + 1, boundary->chain.digest, RT_DIGEST_BYTES);
        size = RT_DIGEST_BYTES;
        refused = NULL;
        break;
    default:
        break;
    }
    if (refused != NULL) return refuse(refused, out);
    out[0] = 0;
    return 1 + size;
}

uint32_t rt_take_back(rt_boundary *boundary, uint8_t *out) {
    rt_release(&boundary->executor);
    boundary->executor.called_off = true;
    return refuse("not-kept", out);
}
