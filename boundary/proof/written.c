/* Frama-C's Eva runs this: the writers of responses, receipts, and statements of the boundary's own evidence, with any numbers. */
#include "seal.h"
#include "wire/boundary_chain.h"
#include "wire/receipt.h"
#include "wire/response.h"

#define MOST 96
#define MOST_WORDS 48 /* octets of a slug: callers have room for 256 */

static uint8_t octets[MOST], out[RT_MAX_STATEMENT], receipt_out[256], response[RT_MAX_RESPONSE];
static rt_chain chain;

int main(void) {
    rt_decision decision;
    rt_receipt receipt;
    rt_now now;
    rt_bytes any = {octets, SIZE(MOST)};
    ANY(octets);
    switch (Frama_C_interval(0, 4)) {
    case 0:
        ANY(decision);
        return (int)rt_write_answer(&decision, WITHIN(0, 1), EITHER() ? octets : NULL, octets, response);
    case 1: return (int)rt_write_refusal((uint8_t)SIZE(UINT8_MAX), octets, response);
    case 2:
        ANY(receipt);
        receipt.slug = receipt.text = (rt_bytes){octets, SIZE(MOST_WORDS)};
        receipt.evidence = (rt_bytes){octets, RT_DIGEST_BYTES};
        return (int)rt_write_receipt(&receipt, receipt_out);
    default:
        ANY(chain);
        chain.marked = SIZE(RT_MOST_MARKS);
        chain.count = WITHIN(0, INT64_MAX - 1), chain.frames = WITHIN(0, INT64_MAX - 1), chain.repeated = WITHIN(0, INT64_MAX - 1);
        chain.declined = WITHIN(0, INT64_MAX - 1), chain.stopped = WITHIN(0, INT64_MAX - 1);
        rt_chain_add(&chain, (uint8_t)SIZE(UINT8_MAX), any, any);
        rt_chain_repeat(&chain, any, any);
        rt_chain_decline(&chain, any);
        rt_chain_stop(&chain, any);
        rt_chain_leave(&chain, any);
        ANY(now);
        return (int)rt_sign_statement(&chain, octets, octets, WITHIN(INT64_MIN, INT64_MAX), octets, WITHIN(0, 4), &now, EITHER(), out);
    }
}
