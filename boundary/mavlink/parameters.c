#include "parameters.h"

#define EXPONENT 0x7F800000U
#define FRACTION 0x007FFFFFU

bool rt_is_finite(uint32_t bits) { return (bits & EXPONENT) != EXPONENT; }

bool rt_is_nan(uint32_t bits) { return !rt_is_finite(bits) && (bits & FRACTION) != 0; }

bool rt_is_zero(uint32_t bits) { return (bits << 1) == 0; }

/* A finite float is `mantissa` (below 2**24) times 2**`exponent`. */
static uint64_t mantissa_of(uint32_t bits, int *exponent) {
    uint32_t stored = (bits & EXPONENT) >> 23;
    *exponent = stored == 0 ? -149 : (int)stored - 150;
    return stored == 0 ? bits & FRACTION : (bits & FRACTION) | (FRACTION + 1);
}

static int64_t with_sign(uint32_t bits, uint64_t size) { return bits >> 31 ? -(int64_t)size : (int64_t)size; }

bool rt_cut(uint32_t bits, int64_t *value) {
    int exponent;
    uint64_t mantissa = mantissa_of(bits, &exponent);
    if (!rt_is_finite(bits) || exponent > 38) /* 24 bits and 38 stay below 2**62 */
        return false;
    uint64_t size = exponent >= 0 ? mantissa << exponent : exponent > -24 ? mantissa >> -exponent : 0;
    *value = with_sign(bits, size);
    return true;
}

bool rt_is_whole(uint32_t bits, int64_t value) {
    int exponent;
    uint64_t mantissa = mantissa_of(bits, &exponent);
    int64_t cut = 0;
    if (!rt_cut(bits, &cut) || cut != value)
        return false;
    if (exponent >= 0)
        return true;
    return exponent > -24 ? (mantissa & ((1ULL << -exponent) - 1)) == 0 : mantissa == 0;
}

bool rt_multiplied(uint32_t bits, uint32_t factor, int64_t *value) {
    int exponent;
    uint64_t product = mantissa_of(bits, &exponent) * factor; /* below 2**44 */
    if (!rt_is_finite(bits) || exponent > 16)
        return false;
    uint64_t size = 0;
    if (exponent >= 0) {
        size = product << exponent;
    } else if (exponent > -46) {
        uint64_t rest = product & ((1ULL << -exponent) - 1), half = 1ULL << (-exponent - 1);
        size = product >> -exponent;
        if (rest > half || (rest == half && (size & 1) != 0))
            size++;
    }
    *value = with_sign(bits, size);
    return true;
}

/* The bits of the float nearest to an integer of 32 bits, ties to even. */
static uint32_t nearest(int64_t value) {
    uint64_t size = value < 0 ? (uint64_t)-value : (uint64_t)value;
    uint32_t sign = value < 0 ? 0x80000000U : 0, shift = 0;
    if (size == 0)
        return 0;
    while (shift < 8 && size >> shift >= 1ULL << 24)
        shift++;
    uint64_t mantissa = size >> shift, rest = size & ((1ULL << shift) - 1);
    if (shift > 0 && (rest > 1ULL << (shift - 1) || (rest == 1ULL << (shift - 1) && (mantissa & 1) != 0)))
        mantissa++; /* 2**24 is right too: it carries into the exponent below */
    uint32_t exponent = 150 + shift;
    while (mantissa < 1ULL << 23) {
        mantissa <<= 1;
        exponent--;
    }
    if (mantissa == 1ULL << 24) {
        mantissa >>= 1;
        exponent++;
    }
    return sign | exponent << 23 | ((uint32_t)mantissa & FRACTION);
}

uint32_t rt_nearest_bits(int64_t numerator, int64_t denominator) {
    const uint64_t size = (uint64_t)rt_abs(numerator), by = (uint64_t)denominator;
    uint64_t mantissa = size / by, rest = size % by;
    uint32_t exponent = 150, cut = 0;
    if (size == 0)
        return 0;
    for (; mantissa < 1ULL << 23; exponent--) {
        rest *= 2;
        mantissa = 2 * mantissa + (rest >= by);
        rest -= rest >= by ? by : 0;
    }
    while (cut < 30 && mantissa >> cut >= 1ULL << 24)
        cut++;
    bool above, half; /* whether what is cut off is more than half of the last place, or exactly half */
    if (cut == 0) {
        above = 2 * rest > by;
        half = 2 * rest == by;
    } else {
        uint64_t low = mantissa & ((1ULL << cut) - 1), middle = 1ULL << (cut - 1);
        above = low > middle || (low == middle && rest > 0);
        half = low == middle && rest == 0;
    }
    mantissa >>= cut;
    exponent += cut;
    mantissa += above || (half && (mantissa & 1) != 0);
    if (mantissa == 1ULL << 24) {
        mantissa >>= 1;
        exponent++;
    }
    return (numerator < 0 ? 0x80000000U : 0) | exponent << 23 | ((uint32_t)mantissa & FRACTION);
}

/* A number with the same order as finite floats; -0 is 0. */
static int64_t order_of(uint32_t bits) { return with_sign(bits, bits & 0x7FFFFFFFU); }

bool rt_lies_within(uint32_t bits, int32_t first, int32_t last) {
    return rt_is_finite(bits) && order_of(bits) >= order_of(nearest(first)) && order_of(bits) <= order_of(nearest(last));
}

bool rt_bits_of(uint32_t raw, uint8_t kind, bool bytewise, uint32_t *bits) {
    if (bytewise && kind >= 1 && kind <= 6) { /* MAV_PARAM_TYPE: UINT8, INT8, UINT16, INT16, UINT32, INT32 */
        static const uint8_t widths[] = {8, 8, 16, 16, 32, 32};
        uint32_t width = widths[kind - 1];
        int64_t value = (int64_t)(raw & (uint32_t)((1ULL << width) - 1));
        if (kind % 2 == 0 && value >> (width - 1) != 0)
            value -= 1LL << width;
        *bits = nearest(value);
        return true;
    }
    if (!rt_is_finite(raw))
        return false;
    *bits = rt_is_zero(raw) ? 0 : raw;
    return true;
}
