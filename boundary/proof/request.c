/* Frama-C's Eva runs this: request.c on any bytes of any size, for the smallest, a middling and the largest state. */
#include "__fc_builtin.h"
#include "wire/request.h"

static uint8_t input[RT_MAX_REQUEST];
static rt_request request;

int main(void) {
    static const int64_t slots[] = {0, 9, RT_MAX_SLOTS};
    static const uint32_t monitors[] = {0, 2, RT_MAX_MONITORS};
    int number = Frama_C_interval(0, 2);
    //@ split number;
    Frama_C_make_unknown((char *)input, sizeof input);
    uint32_t size = Frama_C_unsigned_int_interval(0, sizeof input);
    //@ split size;
    return rt_read_request((rt_bytes){input + sizeof input - size, size}, slots[number], monitors[number], &request);
}
