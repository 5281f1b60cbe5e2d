/* Frama-C's Eva runs this: preparation.c on any bytes, for every possible number of parameters. */
#include "__fc_builtin.h"
#include "wire/preparation.h"

static uint8_t input[RT_MAX_PREPARATION];
static rt_preparation preparation;

int main(void) {
    Frama_C_make_unknown((char *)input, sizeof input);
    uint32_t size = Frama_C_unsigned_int_interval(0, sizeof input);
    return rt_read_preparation((rt_bytes){input, size}, &preparation);
}
