/* Responses of `enforce`: a decision, with a permit where it grants one, or a refusal to decide. `response.py`. */
#ifndef RT_WIRE_RESPONSE_H
#define RT_WIRE_RESPONSE_H

#include "model/flat.h"
#include "wire/permit.h"

#define RT_MAX_RESPONSE 192

/* Write a decision into `out` of RT_MAX_RESPONSE octets; `permit` has RT_PERMIT_BYTES, or is NULL; `evidence` is the new digest of the
   boundary's own evidence. Returns the size. */
uint32_t rt_write_answer(const rt_decision *decision, int64_t consumed, const uint8_t *permit, const uint8_t *evidence, uint8_t *out);

/* Write a refusal to decide: its status is not 0. */
uint32_t rt_write_refusal(uint8_t status, const uint8_t *evidence, uint8_t *out);

#endif
