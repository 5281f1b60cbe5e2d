/* Receipts: the boundary's answer to a document. `receipt.py`. */
#ifndef RT_WIRE_RECEIPT_H
#define RT_WIRE_RECEIPT_H

#include "../base.h"

enum { RT_OF_UNKNOWN = 0, RT_OF_APPROVAL = 1, RT_OF_RECALL = 2, RT_OF_REPLACEMENT = 3, RT_OF_CANCELLATION = 4 };

#define RT_RECEIPT_BYTES(text) (64 + 9 * 5 + 2 + 32 + (text)) /* the greatest size of slug and text together */

/* `slug` is `accepted` or the reason of the refusal. Unused fields are -1, and `expires_us` 0. */
typedef struct {
    int64_t kind;
    rt_bytes slug, text;
    int64_t step, role, granted, expires_us;
    rt_bytes evidence; /* the digest of the boundary's own evidence after it */
} rt_receipt;

/* Write a receipt into `out` of RT_RECEIPT_BYTES; returns its size. */
uint32_t rt_write_receipt(const rt_receipt *receipt, uint8_t *out);

#endif
