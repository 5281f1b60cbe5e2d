/* Floats of MAVLink's fields, as the 32 bits that they are: nothing here computes with a float. `parameters.py`. */
#ifndef RT_MAVLINK_PARAMETERS_H
#define RT_MAVLINK_PARAMETERS_H

#include "../base.h"

bool rt_is_finite(uint32_t bits);
bool rt_is_nan(uint32_t bits);
bool rt_is_zero(uint32_t bits);             /* -0 too */
bool rt_lies_within(uint32_t bits, int32_t first, int32_t last); /* a number from the one to the other, both counting */
bool rt_is_whole(uint32_t bits, int64_t value); /* whether it is just this integer */
/* The integer that is left when what is behind the point is cut off; false for what is beyond 2**62, or no number. */
bool rt_cut(uint32_t bits, int64_t *value);
/* 1,000 times it, to the nearest integer, ties to even; false for what is beyond 2**50, or no number. */
bool rt_thousandfold(uint32_t bits, int64_t *value);
/* What a PARAM_SET or PARAM_VALUE means, as the bits of the float that is nearest; false for no number. */
bool rt_bits_of(uint32_t raw, uint8_t kind, bool bytewise, uint32_t *bits);

#endif
