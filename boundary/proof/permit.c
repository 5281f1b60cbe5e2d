/* Frama-C's Eva runs this: permits of any octets of any size, and the octets of any permit. */
#include "seal.h"
#include "wire/permit.h"

static uint8_t octets[RT_PERMIT_BYTES + 1], key[RT_KEY_BYTES], sealed[RT_PERMIT_BYTES];

int main(void) {
    rt_permit permit;
    ANY(octets);
    ANY(key);
    uint32_t size = SIZE(sizeof octets);
    //@ split size;
    if (rt_open_permit((rt_bytes){octets + sizeof octets - size, size}, key, &permit)) rt_seal_permit(&permit, key, sealed);
    ANY(permit);
    rt_seal_permit(&permit, key, sealed);
    return 0;
}
