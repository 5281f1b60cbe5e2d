/* A normal world that was taken over: it reaches for addresses that the host names, and counts what the secure world noticed. Only for
   tests (tests/attacks/test_secure_world.py). */
#include "normal.h"

#define ATTACK 'A' /* kind (4), then addresses (4 each) -> for each, by one octet each: whether it was noticed, and whether the value came back */
enum { READ = 0, WRITE = 1, JUMP = 2, ASK = 3 };
#define MARK 0x5EC2E7A5u

static uint8_t own[RT_MAILBOX_SIZE];

static uint32_t noticed(void) {
    (void)rt_gateway(RT_WANT_STATUS, own, 0);
    return *(const volatile uint32_t *)(const void *)(own + RT_MAILBOX_HEAD);
}

static uint32_t read_at(uint32_t address) {
    register uint32_t value __asm("r0") = MARK;
    __asm volatile("ldr r0, [%1]" : "+r"(value) : "r"(address) : "memory");
    return value;
}

static void write_at(uint32_t address) { __asm volatile("str %0, [%1]" ::"r"(MARK), "r"(address) : "memory"); }

static void jump_to(uint32_t address) { __asm volatile("blx %0" ::"r"(address | 1u) : "r0", "r1", "r2", "r3", "r12", "lr", "memory"); }

uint32_t serve(uint32_t want, uint8_t *mailbox, uint32_t size) {
    if (want != ATTACK) return rt_gateway(want, mailbox, size);
    volatile uint32_t *words = (volatile uint32_t *)(void *)(mailbox + RT_MAILBOX_HEAD);
    const uint32_t kind = words[0], count = size / 4 - 1;
    for (uint32_t each = 0; each < count; each++) {
        const uint32_t address = words[1 + each], before = noticed();
        uint32_t value = MARK;
        if (kind == READ) value = read_at(address);
        else if (kind == WRITE) write_at(address);
        else if (kind == JUMP) jump_to(address);
        else value = rt_gateway(RT_WANT_CALL, (uint8_t *)(uintptr_t)address, 16) == RT_WRONG ? MARK : 0;
        words[each] = (uint32_t)(noticed() != before) | (uint32_t)(value != MARK) << 1;
    }
    words[-2] = 4 * count;
    words[-1] = 0;
    return RT_DONE;
}
