#include "receipt.h"

#include "artefact.h"

uint32_t rt_write_receipt(const rt_receipt *receipt, uint8_t *out) {
    uint32_t size = rt_wrap(out, &RT_RECEIPT);
    size += rt_cbor_head(out + size, RT_MAJOR_ARRAY, 8);
    size += rt_cbor_int(out + size, receipt->kind);
    size += rt_cbor_string(out + size, RT_MAJOR_TEXT, receipt->slug);
    size += rt_cbor_string(out + size, RT_MAJOR_TEXT, receipt->text);
    size += rt_cbor_int(out + size, receipt->step);
    size += rt_cbor_int(out + size, receipt->role);
    size += rt_cbor_int(out + size, receipt->granted);
    size += rt_cbor_int(out + size, receipt->expires_us);
    return size + rt_cbor_string(out + size, RT_MAJOR_OCTETS, receipt->evidence);
}
