/* The boundary in the secure world of a Cortex-M33: start, protection, and the one way in. The core is the same as in every home.

   There is no storage here. What must outlive a start is handed to the normal world, sealed, with a counter; an old one that is put
   back shows only to who has seen a newer counter. QEMU's host is root over both worlds: this models the hardware and is not it. */
#include "board.h"
#include "world.h"

#include "crypto/crypto.h"

#include <arm_cmse.h>

/* ------------------------------------------------------------------------------------------------ time */

static int64_t started_us;       /* monotonic, as the setup names it; from then on it runs by itself */
static volatile uint64_t passed; /* ticks */
static uint32_t last_count;

static void count_ticks(void) {
    const uint32_t now = REGISTER(TIMER0 + TIMER_VALUE);
    passed += last_count - now; /* it counts down */
    last_count = now;
}

/* Only while interrupts are masked. */
static int64_t own_time_us(void) {
    count_ticks();
    return started_us + (int64_t)(passed / TICKS_PER_US);
}

void tick(void);
void tick(void) { count_ticks(); } /* the counter comes around in 214 s */

static void start_clock(void) {
    REGISTER(TIMER0 + TIMER_RELOAD) = 0xFFFFFFFFu;
    REGISTER(TIMER0 + TIMER_VALUE) = 0xFFFFFFFFu;
    REGISTER(TIMER0 + TIMER_CONTROL) = 1;
    last_count = REGISTER(TIMER0 + TIMER_VALUE);
    REGISTER(SYST_RELOAD) = 0xFFFFFF;
    REGISTER(SYST_VALUE) = 0;
    REGISTER(SYST_CONTROL) = 7;
}

extern const uint8_t code_start, code_end;

/* The image that runs: an emulator can look into it, so debugging counts as enabled. */
static rt_home measured(void) {
    static const char mode[] = "trustzone-m";
    rt_home home = {{(const uint8_t *)mode, sizeof mode - 1}, {0}, RT_DEBUG_ENABLED, 0};
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){&code_start, (uint32_t)(&code_end - &code_start)});
    rt_sha256_end(&hash, home.code);
    return home;
}

/* ------------------------------------------------------------------------------------------------ the way in */

static volatile uint32_t violations;

/* All that the normal world can ask. `mailbox` must be its own memory, of RT_MAILBOX_SIZE octets. */
uint32_t __attribute__((cmse_nonsecure_entry)) rt_gateway(uint32_t want, uint8_t *mailbox, uint32_t size);
uint32_t rt_gateway(uint32_t want, uint8_t *mailbox, uint32_t size) {
    /* Nothing interrupts: an interrupt of the normal world could call again, and change what this call has checked already. */
    __asm volatile("cpsid i" ::: "memory");
    uint32_t done = RT_WRONG;
    if (cmse_check_address_range(mailbox, RT_MAILBOX_SIZE, CMSE_NONSECURE | CMSE_MPU_READWRITE) != NULL)
        done = rt_world_answer(want, mailbox, size, own_time_us(), violations);
    __asm volatile("cpsie i" ::: "memory");
    return done;
}

/* ------------------------------------------------------------------------------------------------ protection */

/* Everything of a memory's second half, or all of it, is the normal world's. */
static void give_memory(uint32_t controller, bool all) {
    const uint32_t words = REGISTER(controller + MPC_LAST_BLOCK) + 1;
    for (uint32_t word = all ? 0 : words / 2; word < words; word++) {
        REGISTER(controller + MPC_INDEX) = word;
        REGISTER(controller + MPC_TABLE) = 0xFFFFFFFFu;
    }
    REGISTER(controller + MPC_CONTROL) |= 1u << 4;
}

static void set_region(uint32_t number, uint32_t first, uint32_t last, bool callable) {
    REGISTER(SAU_REGION) = number;
    REGISTER(SAU_BASE) = first & ~31u;
    REGISTER(SAU_LIMIT) = (last & ~31u) | (callable ? 2u : 0u) | 1u;
}

static void protect(void) {
    give_memory(MPC_CODE, false);
    give_memory(MPC_NONSECURE_RAM, true);
    REGISTER(MPC_SECURE_RAM + MPC_CONTROL) |= 1u << 4; /* all of it is secure from the reset on */
    REGISTER(SECURITY_CONTROL + NSC_CONFIG) = 1;
    REGISTER(SECURITY_CONTROL + APB_EXPANSION_1) = 1u << 5;
    set_region(0, NONSECURE_CODE, NONSECURE_CODE_END, false);
    set_region(1, NONSECURE_RAM, NONSECURE_RAM_END, false);
    set_region(2, GATEWAY, GATEWAY_END, true);
    set_region(3, UART0, UART0_END, false);
    set_region(4, RT_MAILBOX, RT_MAILBOX + RT_MAILBOX_SIZE - 1, false);
    REGISTER(SAU_CONTROL) = 1;
    REGISTER(SHCSR) |= 0xFu << 16; /* each kind of fault by its own handler */
    REGISTER(AIRCR) = 0x05FA0000u | 1u << 14 | 1u << 3; /* secure exceptions come first; only the secure world resets */
    REGISTER(ITNS1) |= 1u << (UART0_RECEIVED - 32u);
    __asm volatile("dsb\nisb" ::: "memory");
}

static void __attribute__((noreturn)) stop(void) {
    rt_world_wipe();
    REGISTER(AIRCR) = 0x05FA0000u | 1u << 2; /* QEMU ends (`-no-reboot`), and so the host learns of it */
    for (;;) __asm volatile("wfi");
}

static bool is_nonsecure_code(uint32_t address) { return address >= NONSECURE_CODE && address <= NONSECURE_CODE_END; }

/* The normal world did what it may not. It goes on behind that instruction, and gets no answer any more. Where it is not the normal
   world, or makes no sense, everything stops. */
void violated(uint32_t returns, uint32_t *main_frame, uint32_t *process_frame);
void violated(uint32_t returns, uint32_t *main_frame, uint32_t *process_frame) {
    uint32_t control;
    if (returns & 1u << 6) stop(); /* the secure world itself */
    __asm volatile("mrs %0, control_ns" : "=r"(control));
    uint32_t *frame = (returns & 1u << 3) && (control & 1u << 1) ? process_frame : main_frame; /* thread mode with a stack of its own */
    frame = cmse_check_address_range(frame, 32, CMSE_NONSECURE | CMSE_MPU_READWRITE);
    if (frame == NULL) stop();
    if (violations == 0) rt_world_wipe(); /* nothing is answered any more */
    violations += violations < 0xFFFFFFFFu;
    uint32_t at = frame[6];
    if (is_nonsecure_code(at)) {
        const uint32_t half = *(const volatile uint16_t *)(uintptr_t)at;
        frame[6] = at + (half >> 11 >= 0x1D ? 4 : 2);
    } else if (is_nonsecure_code(frame[5] & ~1u)) frame[6] = frame[5] & ~1u; /* it went to where nothing of its own is: back */
    else stop();
    REGISTER(0xE000ED28u) = 0xFFFFFFFFu; /* CFSR, */
    REGISTER(0xE000EDE4u) = 0xFFu;       /* and SFSR: what was the matter */
}

void fault(void);
void __attribute__((naked)) fault(void) {
    __asm volatile("mov r0, lr\nmrs r1, msp_ns\nmrs r2, psp_ns\npush {r3, lr}\nbl violated\npop {r3, pc}");
}

extern uint32_t stack_low, stack_top[2], data_start, data_end, data_image, bss_start, bss_end;
void reset(void);
static void unexpected(void) { stop(); }

typedef void (*handler)(void);
const struct { uint32_t *stack; handler handlers[15]; handler interrupts[96]; } vectors __attribute__((section(".vectors"), used)) = {
    stack_top, {reset, unexpected, fault, fault, fault, fault, fault, 0, 0, 0, unexpected, unexpected, 0, unexpected, tick}, {0}};

void reset(void) {
    for (uint32_t *to = &data_start, *from = &data_image; to < &data_end;) *to++ = *from++;
    for (uint32_t *to = &bss_start; to < &bss_end;) *to++ = 0;
    __asm volatile("msr msplim, %0" ::"r"(&stack_low));
    /* seals, so that a forged return finds no frame above the stack (Arm, "Secure stack sealing") */
    stack_top[0] = stack_top[1] = 0xFEF5EDA5u;
    __asm volatile("msr psp, %0\nmsr psplim, %0" ::"r"(stack_top));
    protect();
    start_clock();
    const rt_home home = measured();
    started_us = rt_world_begin((const uint8_t *)(uintptr_t)SETUP, SETUP_SIZE, &home);
    rt_wipe((void *)(uintptr_t)SETUP, SETUP_SIZE);
    REGISTER(VTOR_NS) = NONSECURE_CODE;
    const uint32_t *normal = (const uint32_t *)(uintptr_t)NONSECURE_CODE;
    __asm volatile("msr msp_ns, %0" ::"r"(normal[0]));
    typedef void __attribute__((cmse_nonsecure_call)) (*nonsecure)(void);
    const nonsecure enter = (nonsecure)cmse_nsfptr_create((void (*)(void))(uintptr_t)normal[1]);
    enter();
    stop();
}
