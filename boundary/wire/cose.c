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

static void lay_out(structure *signed_, rt_bytes label, rt_bytes name, rt_bytes protected, rt_bytes payload) {
    static const uint8_t context[] = "\x84\x6aSignature1";
    uint8_t(*heads)[RT_HEAD_BYTES] = signed_->heads;
    const rt_bytes parts[] = {
        {context, sizeof context - 1},
        {heads[0], rt_cbor_head(heads[0], RT_MAJOR_OCTETS, protected.size)},
        protected,
        {heads[1], rt_cbor_head(heads[1], RT_MAJOR_OCTETS, label.size + name.size)},
        label,
        name,
        {heads[2], rt_cbor_head(heads[2], RT_MAJOR_OCTETS, payload.size)},
        payload,
    };
    memcpy(signed_->parts, parts, sizeof parts);
}

static const uint8_t LABEL[] = "rtshcua/duty/";
static const rt_bytes DUTY = {LABEL, sizeof LABEL - 1}, NOTHING = {NULL, 0};

bool rt_signed_by(const rt_envelope *envelope, int64_t duty, rt_bytes public) {
    structure signed_;
    lay_out(&signed_, DUTY, rt_duty_name(duty), envelope->protected, envelope->payload);
    return rt_ed25519_verify(public.at, envelope->signature.at, signed_.parts, sizeof signed_.parts / sizeof signed_.parts[0]);
}

uint32_t rt_sign1(int64_t duty, bool labelled, const uint8_t seed[RT_KEY_BYTES], rt_bytes content_type, rt_bytes payload, uint8_t *out) {
    static const uint8_t outset[] = {0xD2, 0x84}, algorithm[] = {0xA3, 0x01, 0x32, 0x03};
    uint8_t protected[96], public[RT_KEY_BYTES], kid[RT_KID_BYTES], signature[RT_SIGNATURE_BYTES];
    structure signed_;
    rt_ed25519_public(seed, public);
    rt_key_id(duty, (rt_bytes){public, RT_KEY_BYTES}, kid);
    uint32_t header = sizeof algorithm;
    memcpy(protected, algorithm, sizeof algorithm);
    header += rt_cbor_string(protected + header, RT_MAJOR_TEXT, content_type);
    protected[header++] = KID;
    header += rt_cbor_string(protected + header, RT_MAJOR_OCTETS, (rt_bytes){kid, RT_KID_BYTES});
    lay_out(&signed_, labelled ? DUTY : NOTHING, labelled ? rt_duty_name(duty) : NOTHING, (rt_bytes){protected, header}, payload);
    rt_ed25519_sign(seed, signed_.parts, sizeof signed_.parts / sizeof signed_.parts[0], signature);
    memcpy(out, outset, sizeof outset);
    uint32_t size = sizeof outset;
    size += rt_cbor_string(out + size, RT_MAJOR_OCTETS, (rt_bytes){protected, header});
    out[size++] = 0xA0; /* nothing is unprotected */
    size += rt_cbor_string(out + size, RT_MAJOR_OCTETS, payload);
    return size + rt_cbor_string(out + size, RT_MAJOR_OCTETS, (rt_bytes){signature, RT_SIGNATURE_BYTES});
}
