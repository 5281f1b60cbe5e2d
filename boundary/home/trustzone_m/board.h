/* The board: MPS2 with the FPGA image AN505 (Arm DAI 0505B), a Cortex-M33 with SSE-200, as QEMU has it (`-M mps2-an505`). Addresses of
   the secure world have bit 28 set. */
#ifndef RT_TRUSTZONE_M_BOARD_H
#define RT_TRUSTZONE_M_BOARD_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

#define NONSECURE_CODE 0x00200000u
#define NONSECURE_CODE_END 0x003FFFFFu
#define NONSECURE_RAM 0x28200000u
#define NONSECURE_RAM_END 0x283FFFFFu
#define GATEWAY 0x100FF000u /* one page of entries from the normal world */
#define GATEWAY_END 0x100FFFFFu
#define SETUP 0x38180000u /* where the host puts what the boundary is given */
#define SETUP_SIZE 0x80000u

/* memory protection controllers: of code, of the secure RAM, of the normal world's */
#define MPC_CODE 0x58007000u
#define MPC_SECURE_RAM 0x58008000u
#define MPC_NONSECURE_RAM 0x58009000u
#define MPC_CONTROL 0x00u /* bit 4: what is not allowed is a bus error; bit 8: the table's index goes on by itself */
#define MPC_LAST_BLOCK 0x10u
#define MPC_INDEX 0x18u
#define MPC_TABLE 0x1Cu

#define SECURITY_CONTROL 0x50080000u
#define NSC_CONFIG 0x14u
#define APB_EXPANSION_1 0x84u /* bit 5: UART0 */

#define UART0 0x40200000u
#define UART0_END 0x40200FFFu
#define UART0_RECEIVED 32u /* the number of its interrupt */
#define UART_DATA 0x0u
#define UART_STATE 0x4u /* bit 0: sending, bit 1: something came */
#define UART_CONTROL 0x8u
#define UART_INTERRUPT 0xCu
#define UART_DIVISOR 0x10u

#define TIMER0 0x50000000u /* CMSDK timer, counts down at 20 MHz */
#define TIMER_CONTROL 0x0u
#define TIMER_VALUE 0x4u
#define TIMER_RELOAD 0x8u
#define TICKS_PER_US 20u

#define SAU_CONTROL 0xE000EDD0u
#define SAU_REGION 0xE000EDD8u
#define SAU_BASE 0xE000EDDCu
#define SAU_LIMIT 0xE000EDE0u
#define VTOR_NS 0xE002ED08u
#define AIRCR 0xE000ED0Cu
#define SHCSR 0xE000ED24u
#define ITNS1 0xE000E384u
#define SYST_CONTROL 0xE000E010u
#define SYST_RELOAD 0xE000E014u
#define SYST_VALUE 0xE000E018u
#define NVIC_ENABLE_1 0xE000E104u
#define NVIC_PRIORITY 0xE000E400u /* one octet for each interrupt */

#endif
