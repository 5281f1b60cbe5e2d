/* The boundary as a trusted application of OP-TEE. The core is the same as in every home, and `../trustzone_m/world.c` is what it shares
   with the other secure world: the setup, and the wishes of the normal world.

   What must outlive it is a persistent object in secure storage (TEE_STORAGE_PRIVATE), encrypted and authenticated by OP-TEE, in files of
   the normal world. QEMU has no monotonic counter and no RPMB: who puts older files back is not noticed. */
#include "../trustzone_m/world.h"
#include "application.h"

#include "crypto/crypto.h"
#include "enforcement/kept.h"

#include <tee_internal_api.h>

#define KEPT_SIZE ((uint32_t)(sizeof(rt_kept) + RT_DIGEST_BYTES))
/* in the setup: the entropy of this start, and the size of what was kept (world.c) */
enum { SETUP_ENTROPY = 8, SETUP_SIZES = 200, SETUP_HEAD = 232 };

static uint8_t mailbox[RT_MAILBOX_SIZE];
static uint8_t waiting[KEPT_SIZE]; /* to be kept when there is time */
static bool begun, waits;
static int64_t began_us;
static TEE_Time began;
static TEE_ObjectHandle stored = TEE_HANDLE_NULL;
static const char name[] = "kept";

extern const uint8_t __text_start[], __text_end[];

/* The code that runs: an emulator can look into it, so debugging counts as enabled. */
static rt_home measured(void) {
    static const char mode[] = "optee";
    rt_home home = {{(const uint8_t *)mode, sizeof mode - 1}, {0}, RT_DEBUG_ENABLED, 0};
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, (rt_bytes){__text_start, (uint32_t)(__text_end - __text_start)});
    rt_sha256_end(&hash, home.code);
    return home;
}

/* ------------------------------------------------------------------------------------------------ secure storage */

static bool store(const uint8_t *blob, uint32_t size) {
    if (stored != TEE_HANDLE_NULL)
        return TEE_SeekObjectData(stored, 0, TEE_DATA_SEEK_SET) == TEE_SUCCESS && TEE_WriteObjectData(stored, blob, size) == TEE_SUCCESS;
    const uint32_t flags = TEE_DATA_FLAG_ACCESS_READ | TEE_DATA_FLAG_ACCESS_WRITE;
    return TEE_CreatePersistentObject(TEE_STORAGE_PRIVATE, name, sizeof name, flags, TEE_HANDLE_NULL, blob, size, &stored) == TEE_SUCCESS;
}

/* What was stored, into `blob`; nothing on a first start. False where it is damaged. */
static bool restore(uint8_t blob[KEPT_SIZE + 1], size_t *size) {
    const uint32_t flags = TEE_DATA_FLAG_ACCESS_READ | TEE_DATA_FLAG_ACCESS_WRITE;
    const TEE_Result found = TEE_OpenPersistentObject(TEE_STORAGE_PRIVATE, name, sizeof name, flags, &stored);
    *size = 0;
    if (found == TEE_ERROR_ITEM_NOT_FOUND) return true;
    return found == TEE_SUCCESS && TEE_ReadObjectData(stored, blob, KEPT_SIZE + 1, size) == TEE_SUCCESS && *size == KEPT_SIZE;
}

/* ------------------------------------------------------------------------------------------------ the wishes */

static uint32_t word(const uint8_t *at) { return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24; }

static int64_t own_time_us(void) {
    TEE_Time now;
    TEE_GetSystemTime(&now);
    return began_us + ((int64_t)now.seconds - (int64_t)began.seconds) * 1000000 + ((int64_t)now.millis - (int64_t)began.millis) * 1000;
}

/* Begin with the setup in the mailbox; the client draws no key and says nothing about what was kept. */
static bool begin_once(uint32_t size) {
    size_t kept = 0;
    if (begun || size < SETUP_HEAD || size > RT_MAILBOX_SIZE - KEPT_SIZE - 1 || word(mailbox + SETUP_SIZES + 20) != 0) return false;
    begun = true;
    TEE_GenerateRandom(mailbox + SETUP_ENTROPY, RT_KEY_BYTES);
    if (!restore(mailbox + size, &kept)) kept = 1; /* damage: world.c says so */
    for (int octet = 0; octet < 4; octet++) mailbox[SETUP_SIZES + 20 + octet] = (uint8_t)(kept >> 8 * octet & 0xFF);
    const rt_home home = measured();
    TEE_GetSystemTime(&began);
    began_us = rt_world_begin(mailbox, size + (uint32_t)kept, &home);
    rt_wipe(mailbox, sizeof mailbox);
    return true;
}

static uint32_t look(uint32_t *size) {
    size_t found = 0;
    uint8_t *into = mailbox + RT_MAILBOX_HEAD;
    const bool fine = stored != TEE_HANDLE_NULL && TEE_SeekObjectData(stored, 0, TEE_DATA_SEEK_SET) == TEE_SUCCESS &&
                      TEE_ReadObjectData(stored, into, KEPT_SIZE, &found) == TEE_SUCCESS;
    *size = (uint32_t)found;
    return fine ? RT_DONE : RT_WRONG;
}

/* Serve one wish; `size` is that of the answer afterwards. */
static uint32_t serve(uint32_t want, uint32_t *size) {
    uint32_t code = rt_world_answer(want, mailbox, *size, own_time_us(), 0);
    if (code == RT_KEEP_FIRST) {
        const bool kept = store(mailbox + RT_MAILBOX_HEAD, word(mailbox + 4));
        waits = false; /* that was older */
        code = rt_world_answer(kept ? RT_WANT_KEPT : RT_WANT_NOT_KEPT, mailbox, 0, own_time_us(), 0);
    }
    *size = code == RT_WRONG ? 0 : word(mailbox);
    if (code == RT_DONE_KEEP) {
        memcpy(waiting, mailbox + RT_MAILBOX_HEAD + *size, sizeof waiting);
        waits = true;
    }
    return code;
}

TEE_Result TA_CreateEntryPoint(void) { return TEE_SUCCESS; }

void TA_DestroyEntryPoint(void) { rt_world_wipe(); }

TEE_Result TA_OpenSessionEntryPoint(uint32_t types, TEE_Param parameters[TEE_NUM_PARAMS], void **context) {
    (void)types, (void)parameters, (void)context;
    return TEE_SUCCESS;
}

void TA_CloseSessionEntryPoint(void *context) { (void)context; }

TEE_Result TA_InvokeCommandEntryPoint(void *context, uint32_t want, uint32_t types, TEE_Param parameters[TEE_NUM_PARAMS]) {
    (void)context;
    if (types != TEE_PARAM_TYPES(TEE_PARAM_TYPE_MEMREF_INOUT, TEE_PARAM_TYPE_VALUE_INOUT, TEE_PARAM_TYPE_NONE, TEE_PARAM_TYPE_NONE))
        return TEE_ERROR_BAD_PARAMETERS;
    uint8_t *shared = parameters[0].memref.buffer;
    uint32_t size = parameters[1].value.a;
    const size_t head = want == RT_WANT_BEGIN ? 0 : RT_MAILBOX_HEAD;
    if (parameters[0].memref.size < RT_MAILBOX_SIZE || size > RT_MAILBOX_SIZE - head) return TEE_ERROR_BAD_PARAMETERS;
    if (want == RT_WANT_STORE) {
        if (waits) (void)store(waiting, sizeof waiting); /* the next one is tried again */
        waits = false;
        return TEE_SUCCESS;
    }
    memcpy(mailbox + head, shared, size); /* what is looked at is a copy: the normal world may go on writing there */
    if (want == RT_WANT_BEGIN) return begin_once(size) ? TEE_SUCCESS : TEE_ERROR_BAD_STATE;
    if (!begun) return TEE_ERROR_BAD_STATE;
    parameters[1].value.a = want == RT_WANT_LOOK ? look(&size) : serve(want, &size);
    parameters[1].value.b = size;
    memcpy(shared, mailbox + RT_MAILBOX_HEAD, size);
    return TEE_SUCCESS;
}
