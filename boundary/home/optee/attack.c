/* A normal world that was taken over, in place of the client: root of the guest's Linux reaches for what is in the secure world. It writes
   one line for each attempt to the serial port, and READ or WRITTEN only where something of the secure world came out or was changed.

       rtshcua-attack PORT */
#include "../trustzone_m/mailbox.h"
#include "application.h"

#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <tee_client_api.h>
#include <unistd.h>

#define PAGE 0x1000u

static sigjmp_buf back;
static void fault(int number) { siglongjmp(back, number); }

typedef struct {
    const char *name;
    unsigned long from, to;
} range;

/* by QEMU's `virt` with secure=on: one device of the normal world (fw_cfg), for comparison, then what only the secure world has */
static const range RANGES[] = {
    {"device of the normal world", 0x09020000, 0x09021000},
    {"flash of the firmware", 0x00000000, 0x00100000}, {"secure UART", 0x09040000, 0x09041000}, {"secure GPIO", 0x090B0000, 0x090B1000},
    {"secure RAM", 0x0E000000, 0x0F000000},
};

/* Whether a word could be read, or written. */
static int try_to(volatile uint32_t *word, int writes) {
    if (sigsetjmp(back, 1) != 0) return 0;
    if (writes) *word = 0x41414141;
    else (void)*word;
    return 1;
}

static void reach(int port, int memory, const range *where) {
    unsigned long pages = 0, faults = 0, unmapped = 0, could_read = 0, could_write = 0;
    for (unsigned long at = where->from; at < where->to; at += PAGE, pages++) {
        uint32_t *page = mmap(NULL, PAGE, PROT_READ | PROT_WRITE, MAP_SHARED, memory, (off_t)at);
        if (page == MAP_FAILED) {
            unmapped++;
            continue;
        }
        const int reads = try_to(page, 0), writes = try_to(page + 1, 1);
        could_read += (unsigned long)reads;
        could_write += (unsigned long)writes;
        faults += (unsigned long)(2 - reads - writes);
        munmap(page, PAGE);
    }
    dprintf(port, "%s: %lu pages, %lu faults, %lu not mapped, %lu READ, %lu WRITTEN\n", where->name, pages, faults, unmapped, could_read, could_write);
}

static uint32_t ask(TEEC_Session *session, TEEC_SharedMemory *memory, uint32_t want, uint32_t size, uint32_t types, uint32_t *code) {
    TEEC_Operation asked;
    uint32_t origin;
    memset(&asked, 0, sizeof asked);
    asked.paramTypes = types;
    asked.params[0].memref.parent = memory;
    asked.params[1].value.a = size;
    const uint32_t found = TEEC_InvokeCommand(session, want, &asked, &origin);
    *code = asked.params[1].value.a;
    return found;
}

int main(int count, char **words) {
    const int port = count == 2 ? open(words[1], O_RDWR) : -1, memory = open("/dev/mem", O_RDWR | O_SYNC);
    const TEEC_UUID application = TA_UUID;
    const uint32_t usual = TEEC_PARAM_TYPES(TEEC_MEMREF_WHOLE, TEEC_VALUE_INOUT, TEEC_NONE, TEEC_NONE);
    TEEC_Context context;
    TEEC_Session session, other;
    uint32_t origin, code;
    if (port < 0 || TEEC_InitializeContext(NULL, &context) != TEEC_SUCCESS) return 1;
    if (TEEC_OpenSession(&context, &session, &application, TEEC_LOGIN_PUBLIC, NULL, NULL, &origin) != TEEC_SUCCESS) return 2;
    dprintf(port, "second session: %08x\n", TEEC_OpenSession(&context, &other, &application, TEEC_LOGIN_PUBLIC, NULL, NULL, &origin));

    TEEC_SharedMemory shared = {.size = RT_MAILBOX_SIZE, .flags = TEEC_MEM_INPUT | TEEC_MEM_OUTPUT};
    TEEC_SharedMemory small = {.size = PAGE, .flags = TEEC_MEM_INPUT | TEEC_MEM_OUTPUT};
    if (TEEC_AllocateSharedMemory(&context, &shared) != TEEC_SUCCESS || TEEC_AllocateSharedMemory(&context, &small) != TEEC_SUCCESS) return 3;
    dprintf(port, "call before the setup: %08x\n", ask(&session, &shared, RT_WANT_CALL, 1, usual, &code));
    dprintf(port, "look before the setup: %08x\n", ask(&session, &shared, RT_WANT_LOOK, 0, usual, &code));
    dprintf(port, "setup of no size: %08x\n", ask(&session, &shared, RT_WANT_BEGIN, 0, usual, &code));
    dprintf(port, "more than there is: %08x\n", ask(&session, &shared, RT_WANT_BEGIN, 0xFFFFFFFF, usual, &code));
    dprintf(port, "memory that is too small: %08x\n", ask(&session, &small, RT_WANT_BEGIN, 232, usual, &code));
    dprintf(port, "other parameters: %08x\n",
            ask(&session, &shared, RT_WANT_CALL, 1, TEEC_PARAM_TYPES(TEEC_VALUE_INOUT, TEEC_VALUE_INOUT, TEEC_NONE, TEEC_NONE), &code));
    memset(shared.buffer, 0, RT_MAILBOX_SIZE);
    dprintf(port, "setup of zeros: %08x\n", ask(&session, &shared, RT_WANT_BEGIN, 232, usual, &code));
    dprintf(port, "a second setup: %08x\n", ask(&session, &shared, RT_WANT_BEGIN, 232, usual, &code));
    dprintf(port, "call after a refused setup: %08x", ask(&session, &shared, RT_WANT_CALL, 1, usual, &code));
    dprintf(port, " %c\n", (int)code);

    signal(SIGBUS, fault);
    signal(SIGSEGV, fault);
    for (size_t each = 0; each < sizeof RANGES / sizeof *RANGES; each++) reach(port, memory, &RANGES[each]);
    dprintf(port, "end\n");
    return 0;
}
