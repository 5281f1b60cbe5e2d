/* The start of the normal world: it waits for an octet of the host, serves it, and says what became of it. */
#include "normal.h"

extern uint32_t normal_stack_top, normal_bss_start, normal_bss_end;
void normal_reset(void);
void received(void);
void halt(void);

static void send(uint32_t octet) {
    while (REGISTER(UART0 + UART_STATE) & 1u) {}
    REGISTER(UART0 + UART_DATA) = octet;
}

void received(void) {
    uint8_t *mailbox = (uint8_t *)(uintptr_t)RT_MAILBOX;
    REGISTER(UART0 + UART_INTERRUPT) = 2;
    while (REGISTER(UART0 + UART_STATE) & 2u) {
        const uint32_t want = REGISTER(UART0 + UART_DATA) & 0xFF;
        const uint32_t size = *(volatile uint32_t *)(uintptr_t)RT_MAILBOX;
        send(serve(want, mailbox, size));
    }
}

void halt(void) {
    for (;;) __asm volatile("wfi");
}

void ticked(void);
__attribute__((weak)) void ticked(void) { halt(); }

typedef void (*handler)(void);
const struct { uint32_t *stack; handler handlers[15]; handler interrupts[UART0_RECEIVED + 1]; } normal_vectors __attribute__((section(".vectors"), used)) = {
    &normal_stack_top, {normal_reset, halt, halt, halt, halt, halt, 0, 0, 0, 0, halt, halt, 0, halt, ticked}, {[UART0_RECEIVED] = received}};

void normal_reset(void) {
    for (uint32_t *to = &normal_bss_start; to < &normal_bss_end;) *to++ = 0;
    REGISTER(UART0 + UART_DIVISOR) = 16;
    REGISTER(UART0 + UART_CONTROL) = 1u | 2u | 8u; /* sends, receives, and interrupts for what comes */
    (void)REGISTER(UART0 + UART_DATA); /* QEMU takes in what the host sends once this was read */
    REGISTER(NVIC_ENABLE_1) = 1u << (UART0_RECEIVED - 32u);
    send('r'); /* ready */
    halt();
}
