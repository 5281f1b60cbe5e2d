#include "cose.h"

#include "cbor.h"

#define TAG_18 0xD2 /* COSE_Sign1 */
#define ED25519 (-19) /* RFC 9864, section 2.2 */
enum { ALGORITHM = 1, CONTENT_TYPE = 3, KID = 4 }; /* header labels (RFC 9052, section 3.1) */
/* octets of a protected header at most, of which ours have less than 80; and the items of an envelope, and of a header */
enum { MAX_PROTECTED = 200, ENVELOPE_ITEMS = 5, HEADER_ITEMS = 7 };

static bool headers(rt_bytes protected, rt_envelope *claimed) {
    rt_cursor cursor = {protected.at, protected.at + protected.size};
    uint32_t count;
    int64_t label, algorithm;
    return protected.size <= MAX_PROTECTED && rt_cbor_valid(protected, HEADER_ITEMS) && rt_take_map(&cursor, &count) && count == 3 && rt_take_int(&cursor, &label) && label == ALGORITHM &&
           rt_take_int(&cursor, &algorithm) && algorithm == ED25519 && rt_take_int(&cursor, &label) && label == CONTENT_TYPE &&
           rt_take_text(&cursor, &claimed->content_type) && rt_take_int(&cursor, &label) && label == KID &&
           rt_take_octets(&cursor, &claimed->kid) && claimed->kid.size == RT_KID_BYTES;
}

rt_refusal rt_take_apart(rt_bytes envelope, uint32_t limit, rt_envelope *claimed) {
    if (envelope.size == 0 || envelope.at[0] != TAG_18) return "malformed";
    rt_bytes item = {envelope.at + 1, envelope.size - 1};
    rt_cursor cursor = {item.at, item.at + item.size};
    uint32_t unprotected;
    bool whole = item.size <= limit && rt_cbor_valid(item, ENVELOPE_ITEMS) && rt_take_struct(&cursor, 4) && rt_take_octets(&cursor, &claimed->protected) &&
                 rt_take_map(&cursor, &unprotected) && unprotected == 0 && rt_take_octets(&cursor, &claimed->payload) &&
                 rt_take_octets(&cursor, &claimed->signature) && claimed->signature.size == RT_SIGNATURE_BYTES &&
                 headers(claimed->protected, claimed);
    return whole ? NULL : "malformed";
}

/* The Sig_structure (RFC 9052, section 4.4), in parts. */
typedef struct {
    uint8_t heads[3][RT_HEAD_BYTES];
    rt_bytes parts[8];
} structure;

static void lay_out(structure *signed_, int64_t duty, rt_bytes protected, rt_bytes payload) {
    static const uint8_t context[] = "\x84\x6aSignature1", label[] = "rtshcua/duty/";
    uint8_t(*heads)[RT_HEAD_BYTES] = signed_->heads;
    rt_bytes name = rt_duty_name(duty);
    const rt_bytes parts[] = {
        {context, sizeof context - 1},
        {heads[0], rt_cbor_head(heads[0], RT_MAJOR_OCTETS, protected.size)},
        protected,
        {heads[1], rt_cbor_head(heads[1], RT_MAJOR_OCTETS, sizeof label - 1 + name.size)},
        {label, sizeof label - 1},
        name,
        {heads[2], rt_cbor_head(heads[2], RT_MAJOR_OCTETS, payload.size)},
        payload,
    };
    memcpy(signed_->parts, parts, sizeof parts);
}

bool rt_signed_by(const rt_envelope *envelope, int64_t duty, rt_bytes public) {
    structure signed_;
    lay_out(&signed_, duty, envelope->protected, envelope->payload);
    return rt_ed25519_verify(public.at, envelope->signature.at, signed_.parts, sizeof signed_.parts / sizeof signed_.parts[0]);
}

void rt_sign_for(int64_t duty, const uint8_t seed[RT_KEY_BYTES], rt_bytes protected, rt_bytes payload, uint8_t signature[RT_SIGNATURE_BYTES]) {
    structure signed_;
    lay_out(&signed_, duty, protected, payload);
    rt_ed25519_sign(seed, signed_.parts, sizeof signed_.parts / sizeof signed_.parts[0], signature);
}
