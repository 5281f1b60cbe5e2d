/* Floats of MAVLink's fields, as their 32 bits: no code here computes with floats. `parameters.py`. */
#ifndef RT_MAVLINK_PARAMETERS_H
#define RT_MAVLINK_PARAMETERS_H

#include "../base.h"

#define RT_NAN 0x7FC00000U /* as everybody writes it */
/* The bits of the float nearest to a fraction, ties to even: the numerator is within 2**53, the denominator from 1 to 2**30. */
uint32_t rt_nearest_bits(int64_t numerator, int64_t denominator);
bool rt_is_finite(uint32_t bits);
bool rt_is_nan(uint32_t bits);
bool rt_is_zero(uint32_t bits);             /* -0 too */
bool rt_lies_within(uint32_t bits, int32_t first, int32_t last); /* a number in this range, both ends included */
bool rt_is_whole(uint32_t bits, int64_t value); /* whether it is exactly this integer */
/* The integer part; false for a value beyond 2**62, or not a number. */
bool rt_cut(uint32_t bits, int64_t *value);
/* The value times a factor up to 10**6, to the nearest integer, ties to even; false from 2**40 on, or not a number. */
bool rt_multiplied(uint32_t bits, uint32_t factor, int64_t *value);
/* The value of a PARAM_SET or PARAM_VALUE, as the bits of the nearest float; false if it is not a number. */
bool rt_bits_of(uint32_t raw, uint8_t kind, bool bytewise, uint32_t *bits);

#endif
