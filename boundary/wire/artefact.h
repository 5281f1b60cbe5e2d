/* The frame of every artefact: the array of format name, integer version and body. */
#ifndef RT_WIRE_ARTEFACT_H
#define RT_WIRE_ARTEFACT_H

#include "cbor.h"
#include "names.h"

/* The body of this artefact in this version: `malformed`, `unknown-format`, `unknown-version`. */
rt_refusal rt_unwrap(const rt_artefact *artefact, rt_bytes data, rt_cursor *body);

#define RT_FRAME_BYTES 32

/* The bytes before a body; returns their number. */
uint32_t rt_wrap(uint8_t out[RT_FRAME_BYTES], const rt_artefact *artefact);

#endif
