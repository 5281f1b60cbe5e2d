/* The formats, as `wire/names.py` has them; a test compares. */
#ifndef RT_WIRE_NAMES_H
#define RT_WIRE_NAMES_H

#include "../base.h"

typedef struct {
    rt_bytes name;
    int64_t version;
    rt_bytes content_type;
} rt_artefact;

#define RT_TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}
#define RT_ARTEFACT(name, version) {RT_TEXT("rtshcua/" name), version, RT_TEXT("application/vnd.rtshcua." name "+cbor")}

extern const rt_artefact RT_ROOT, RT_POLICY, RT_MISSION, RT_BUNDLE, RT_APPROVAL, RT_RECALL, RT_REPLACEMENT, RT_CANCELLATION, RT_RECEIPT, RT_REQUEST,
    RT_RESPONSE, RT_STATEMENT;

#endif
