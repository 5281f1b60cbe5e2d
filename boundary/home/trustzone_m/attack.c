/* A normal world that was taken over: it reaches for addresses that the host names, and counts what the secure world noticed. Only for
   tests (tests/attacks/test_secure_world.py). */
#include "normal.h"

#define ATTACK 'A' /* kind (4), then addresses (4 each) -> for each, by one octet each: whether it was noticed, and whether the value came back */
enum { READ = 0, WRITE = 1, JUMP = 2, ASK = 3 };
#define MARK 0x5EC2E7A5u

/* A second call that an interrupt makes while the first one is under way: `CARRY` gives its octets, `NEST` makes the first after so many
   ticks (4), `FIRED` says how often the interrupt came, and what became of its call. */
enum { CARRY = 'o', NEST = 'L', FIRED = 'F' };

static uint8_t own[RT_MAILBOX_SIZE], second[RT_MAILBOX_SIZE];
static uint32_t second_size;
static volatile uint32_t fired, second_done;

void ticked(void);
void ticked(void) {
    REGISTER(SYST_CONTROL) = 0;
    fired++;
    for (uint32_t at = 0; at < second_size; at++) own[RT_MAILBOX_HEAD + at] = second[at];
    second_done = rt_gateway(RT_WANT_CALL, own, second_size);
}

static uint32_t nested(uint8_t *mailbox, uint32_t size) {
    const uint32_t ticks = *(const uint32_t *)(const void *)(mailbox + RT_MAILBOX_HEAD);
    for (uint32_t at = 4; at < size; at++) mailbox[RT_MAILBOX_HEAD + at - 4] = mailbox[RT_MAILBOX_HEAD + at];
    *(volatile uint8_t *)(uintptr_t)(NVIC_PRIORITY + UART0_RECEIVED) = 0xE0; /* so that the timer interrupts us */
    fired = second_done = 0;
    REGISTER(SYST_RELOAD) = ticks;
    REGISTER(SYST_VALUE) = 0;
    REGISTER(SYST_CONTROL) = 7;
    const uint32_t done = rt_gateway(RT_WANT_CALL, mailbox, size - 4);
    REGISTER(SYST_CONTROL) = 0;
    return done;
}

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
    if (want == NEST) return nested(mailbox, size);
    if (want == CARRY) {
        for (second_size = 0; second_size < size; second_size++) second[second_size] = mailbox[RT_MAILBOX_HEAD + second_size];
        return RT_DONE;
    }
    if (want == FIRED) {
        ((uint32_t *)(void *)mailbox)[0] = 8;
        ((uint32_t *)(void *)mailbox)[1] = 0;
        ((uint32_t *)(void *)mailbox)[2] = fired;
        ((uint32_t *)(void *)mailbox)[3] = second_done;
        return RT_DONE;
    }
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
