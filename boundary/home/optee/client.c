/* The client in the Linux of the normal world: passes the host's wishes on to the trusted application.

       rtshcua-client PORT        PORT: the serial port to the host

   Both sides write a wish or what becomes of it (1 octet), a size (4, little-endian), and so many octets. The first message is the
   client's, when the application is there: RT_READY. It ends when the port is closed, or the application is gone. */
#include "../trustzone_m/mailbox.h"
#include "application.h"

#include <fcntl.h>
#include <string.h>
#include <tee_client_api.h>
#include <unistd.h>

enum { RT_READY = 'r', HEAD = 5 };
static const uint8_t damaged[] = {78}; /* as in ../process/main.c */

static int transfer(int port, uint8_t *octets, size_t size, int out) {
    while (size > 0) {
        const ssize_t done = out ? write(port, octets, size) : read(port, octets, size);
        if (done <= 0) return 0;
        octets += done;
        size -= (size_t)done;
    }
    return 1;
}

static int say(int port, uint8_t code, uint32_t size, const uint8_t *octets) {
    static uint8_t message[HEAD + RT_MAILBOX_SIZE];
    message[0] = code;
    for (int octet = 0; octet < 4; octet++) message[1 + octet] = (uint8_t)(size >> 8 * octet & 0xFF);
    if (size > 0) memcpy(message + HEAD, octets, size);
    return transfer(port, message, HEAD + size, 1);
}

static int invoke(TEEC_Session *session, TEEC_SharedMemory *memory, uint32_t want, uint32_t size, TEEC_Operation *done) {
    uint32_t origin;
    memset(done, 0, sizeof *done);
    done->paramTypes = TEEC_PARAM_TYPES(TEEC_MEMREF_WHOLE, TEEC_VALUE_INOUT, TEEC_NONE, TEEC_NONE);
    done->params[0].memref.parent = memory;
    done->params[1].value.a = size;
    return TEEC_InvokeCommand(session, want, done, &origin) == TEEC_SUCCESS;
}

int main(int count, char **words) {
    TEEC_Context context;
    TEEC_Session session;
    TEEC_Operation done;
    TEEC_SharedMemory memory = {0};
    const TEEC_UUID application = TA_UUID;
    uint32_t origin;
    uint8_t head[HEAD];
    const int port = count == 2 ? open(words[1], O_RDWR) : -1;
    if (port < 0 || TEEC_InitializeContext(NULL, &context) != TEEC_SUCCESS) return 1;
    if (TEEC_OpenSession(&context, &session, &application, TEEC_LOGIN_PUBLIC, NULL, NULL, &origin) != TEEC_SUCCESS) return 2;
    memory.size = RT_MAILBOX_SIZE;
    memory.flags = TEEC_MEM_INPUT | TEEC_MEM_OUTPUT;
    if (TEEC_AllocateSharedMemory(&context, &memory) != TEEC_SUCCESS || !say(port, RT_READY, 0, NULL)) return 3;
    while (transfer(port, head, sizeof head, 0)) {
        const uint32_t size = head[1] | (uint32_t)head[2] << 8 | (uint32_t)head[3] << 16 | (uint32_t)head[4] << 24;
        if (size > RT_MAILBOX_SIZE || !transfer(port, memory.buffer, size, 0)) return 4;
        if (!invoke(&session, &memory, head[0], size, &done)) {
            /* OP-TEE ends an application that opens a damaged object: nothing else of the beginning can fail */
            if (head[0] == RT_WANT_BEGIN) (void)say(port, RT_NOT_BEGUN, sizeof damaged, damaged);
            return 5;
        }
        if (head[0] == RT_WANT_BEGIN) {
            memset(memory.buffer, 0, RT_MAILBOX_SIZE); /* it had the keys */
            if (!say(port, RT_READY, 0, NULL)) return 4;
            continue;
        }
        const uint32_t code = done.params[1].value.a;
        if (done.params[1].value.b > RT_MAILBOX_SIZE) return 5;
        if (!say(port, (uint8_t)(code == RT_DONE_KEEP ? RT_DONE : code), done.params[1].value.b, memory.buffer)) return 4;
        if (code == RT_DONE_KEEP && !invoke(&session, &memory, RT_WANT_STORE, 0, &done)) return 5;
    }
    return 0;
}
