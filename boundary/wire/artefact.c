#include "artefact.h"

const rt_artefact RT_ROOT = RT_ARTEFACT("root", 2, RT_MANY_ITEMS);
const rt_artefact RT_POLICY = RT_ARTEFACT("policy", 8, RT_ANY_ITEMS);
const rt_artefact RT_MISSION = RT_ARTEFACT("mission", 1, RT_ANY_ITEMS);
const rt_artefact RT_BUNDLE = RT_ARTEFACT("bundle", 1, RT_FEW_ITEMS);
const rt_artefact RT_APPROVAL = RT_ARTEFACT("approval", 2, RT_FEW_ITEMS);
const rt_artefact RT_RECALL = RT_ARTEFACT("recall", 2, RT_FEW_ITEMS);
const rt_artefact RT_REPLACEMENT = RT_ARTEFACT("replacement", 2, RT_ANY_ITEMS);
const rt_artefact RT_CANCELLATION = RT_ARTEFACT("cancellation", 1, RT_FEW_ITEMS);
const rt_artefact RT_RECEIPT = RT_ARTEFACT("receipt", 2, RT_FEW_ITEMS);
const rt_artefact RT_REQUEST = RT_ARTEFACT("request", 2, RT_ANY_ITEMS);
const rt_artefact RT_RESPONSE = RT_ARTEFACT("response", 2, RT_ANY_ITEMS);
const rt_artefact RT_STATEMENT = RT_ARTEFACT("statement", 2, RT_FEW_ITEMS);

rt_refusal rt_unwrap(const rt_artefact *artefact, rt_bytes data, rt_cursor *body) {
    rt_bytes name;
    int64_t version;
    *body = (rt_cursor){data.at, data.at + data.size};
    /* before the rest is read */
    if (!rt_take_struct(body, 3) || !rt_take_text(body, &name) || !rt_take_int(body, &version)) return "malformed";
    if (!rt_same(name, artefact->name)) return "unknown-format";
    if (version != artefact->version) return "unknown-version";
    return rt_cbor_valid(data, artefact->items) ? NULL : "malformed";
}

uint32_t rt_wrap(uint8_t out[RT_FRAME_BYTES], const rt_artefact *artefact) {
    uint32_t size = rt_cbor_head(out, RT_MAJOR_ARRAY, 3);
    size += rt_cbor_head(out + size, RT_MAJOR_TEXT, artefact->name.size);
    memcpy(out + size, artefact->name.at, artefact->name.size);
    size += artefact->name.size;
    return size + rt_cbor_int(out + size, artefact->version);
}
