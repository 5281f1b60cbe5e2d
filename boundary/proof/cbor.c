/* Frama-C's Eva runs this: cbor.c on any bytes, up to BYTES of them (`make -C boundary proof`). */
#include "__fc_builtin.h"
#include "wire/cbor.h"

static uint8_t input[BYTES];

int main(void) {
    Frama_C_make_unknown((char *)input, BYTES);
    uint32_t size = Frama_C_unsigned_int_interval(0, BYTES);
    //@ split size;
    rt_cursor cursor = {input, input + size};
    rt_bytes string;
    int64_t number;
    uint32_t count;
    bool truth;
    switch (Frama_C_interval(0, 10)) {
    case 0: return rt_cbor_valid((rt_bytes){input, size}, Frama_C_unsigned_int_interval(0, UINT32_MAX));
    case 1: return rt_take_int(&cursor, &number);
    case 2: return rt_take_octets(&cursor, &string);
    case 3: return rt_take_text(&cursor, &string);
    case 4: return rt_take_array(&cursor, &count);
    case 5: return rt_take_map(&cursor, &count);
    case 6: return rt_take_bool(&cursor, &truth);
    case 7: return rt_take_null(&cursor);
    case 8: return rt_take_struct(&cursor, 3);
    case 9: return rt_take_extended(&cursor, 4, 6, &count);
    default: break;
    }
    uint8_t out[RT_HEAD_BYTES];
    uint64_t high = Frama_C_unsigned_int_interval(0, UINT32_MAX), low = Frama_C_unsigned_int_interval(0, UINT32_MAX);
    rt_cbor_head(out, RT_MAJOR_TEXT, high << 32 | low);
    rt_cbor_int(out, Frama_C_long_interval(INT64_MIN, INT64_MAX));
    return 0;
}
