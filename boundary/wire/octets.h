/* Integers in fixed layouts, big-endian. */
#ifndef RT_WIRE_OCTETS_H
#define RT_WIRE_OCTETS_H

#include "../base.h"

static inline void rt_put(uint8_t **at, uint64_t value, uint32_t octets) {
    while (octets-- > 0)
        *(*at)++ = (uint8_t)(value >> 8 * octets & 0xFF);
}

static inline uint64_t rt_take(const uint8_t **at, uint32_t octets) {
    uint64_t value = 0;
    while (octets-- > 0)
        value = value << 8 | *(*at)++;
    return value;
}

/* The same with a sign, in two's complement. */
static inline int64_t rt_take_signed(const uint8_t **at, uint32_t octets) {
    uint64_t value = rt_take(at, octets), half = 1ULL << (8 * octets - 1);
    return value < half ? (int64_t)value : -1 - (int64_t)(half - 1 - (value - half));
}

#endif
