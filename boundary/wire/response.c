#include "response.h"
#include "octets.h"

#define HEAD (4 + 4 + 4 + 8 + 1)
static const uint8_t ARTEFACT[] = {
    0x83, 0x70, 'r', 't', 's', 'h', 'c', 'u', 'a', '/', 'r', 'e', 's', 'p', 'o', 'n', 's', 'e', 2};

static uint32_t begin(uint8_t **at, uint32_t body) {
    uint8_t *out = *at;
    memcpy(out, ARTEFACT, sizeof ARTEFACT);
    *at += sizeof ARTEFACT;
    if (body >= 24)
        *(*at)++ = 0x58;
    *(*at)++ = (uint8_t)(body < 24 ? 0x40 | body : body);
    return (uint32_t)(*at - out);
}

uint32_t rt_write_answer(const rt_decision *decision, int64_t consumed, const uint8_t *permit, const uint8_t *evidence, uint8_t *out) {
    const uint32_t body = HEAD + RT_DIGEST_BYTES + (permit == NULL ? 0 : RT_PERMIT_BYTES), prefix = begin(&out, body);
    rt_put(&out, 0, 1);
    rt_put(&out, (uint64_t)decision->outcome, 1);
    rt_put(&out, (uint64_t)decision->reason, 1);
    rt_put(&out, (uint64_t)decision->step, 1);
    rt_put(&out, (uint64_t)decision->clause, 4);
    rt_put(&out, (uint64_t)decision->target, 4);
    rt_put(&out, (uint64_t)decision->valid_until_us, 8);
    rt_put(&out, (uint64_t)consumed, 1);
    if (permit != NULL) {
        memcpy(out, permit, RT_PERMIT_BYTES);
        out += RT_PERMIT_BYTES;
    }
    memcpy(out, evidence, RT_DIGEST_BYTES);
    return prefix + body;
}

uint32_t rt_write_refusal(uint8_t status, const uint8_t *evidence, uint8_t *out) {
    const uint32_t prefix = begin(&out, HEAD + RT_DIGEST_BYTES);
    memset(out, 0, HEAD);
    *out = status;
    memcpy(out + HEAD, evidence, RT_DIGEST_BYTES);
    return prefix + HEAD + RT_DIGEST_BYTES;
}
