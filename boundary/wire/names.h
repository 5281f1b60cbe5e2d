/* The formats, as in `wire/names.py`; a test compares them. */
#ifndef RT_WIRE_NAMES_H
#define RT_WIRE_NAMES_H

#include "../base.h"

typedef struct {
    rt_bytes name;
    int64_t version;
    rt_bytes content_type;
    uint32_t items; /* the limit of CBOR items, beyond which the data is refused */
} rt_artefact;

#define RT_TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}
#define RT_ARTEFACT(name, version, items) {RT_TEXT("rtshcua/" name), version, RT_TEXT("application/vnd.rtshcua." name "+cbor"), items}

enum { RT_FEW_ITEMS = 64, RT_MANY_ITEMS = 1 << 16, RT_ANY_ITEMS = 1 << 24 /* as many as fit */ };

extern const rt_artefact RT_ROOT, RT_POLICY, RT_MISSION, RT_BUNDLE, RT_APPROVAL, RT_RECALL, RT_REPLACEMENT, RT_CANCELLATION, RT_RECEIPT, RT_REQUEST,
    RT_RESPONSE, RT_STATEMENT;

#endif
