#include "receipt.h"

#include "artefact.h"

static uint32_t write_text(rt_bytes text, uint8_t *out) {
    uint32_t size = rt_cbor_head(out, RT_MAJOR_TEXT, text.size);
    if (text.size > 0) memcpy(out + size, text.at, text.size);
    return size + text.size;
}

uint32_t rt_write_receipt(const rt_receipt *receipt, uint8_t *out) {
    uint32_t size = rt_wrap(out, &RT_RECEIPT);
    size += rt_cbor_head(out + size, RT_MAJOR_ARRAY, 8);
    size += rt_cbor_int(out + size, receipt->kind);
    size += write_text(receipt->slug, out + size);
    size += write_text(receipt->text, out + size);
    size += rt_cbor_int(out + size, receipt->step);
    size += rt_cbor_int(out + size, receipt->role);
    size += rt_cbor_int(out + size, receipt->granted);
    size += rt_cbor_int(out + size, receipt->expires_us);
    size += rt_cbor_head(out + size, RT_MAJOR_OCTETS, receipt->evidence.size);
    if (receipt->evidence.size > 0) memcpy(out + size, receipt->evidence.at, receipt->evidence.size);
    return size + receipt->evidence.size;
}
