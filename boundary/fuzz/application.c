/* What libFuzzer calls: the trusted application of OP-TEE, with what stands in secure storage, and commands of the normal world with any
   parameters. Seals and signatures count as good. Of each eight accesses to storage those fail whose bits the input sets.

   An input is records: how storage fails (1) and what it holds; then commands: which (1), types and room of the parameters (1), octets. */
#include "world.h"

#define __text_end __text_start /* no code to measure */
#include "home/optee/application.c"

TEE_Result TA_CreateEntryPoint(void);
void TA_DestroyEntryPoint(void);
TEE_Result TA_OpenSessionEntryPoint(uint32_t types, TEE_Param parameters[TEE_NUM_PARAMS], void **context);
void TA_CloseSessionEntryPoint(void *context);
TEE_Result TA_InvokeCommandEntryPoint(void *context, uint32_t want, uint32_t types, TEE_Param parameters[TEE_NUM_PARAMS]);

const uint8_t __text_start[1];

enum { ROOM = 0x4000 };
struct object {
    uint8_t octets[ROOM];
    size_t size, at;
};
static struct object storage;
static bool there;
static uint8_t fails;
static uint32_t accesses, milliseconds;

static bool failing(void) { return (fails >> (accesses++ & 7) & 1) != 0; }

void TEE_GetSystemTime(TEE_Time *time) {
    milliseconds += 7;
    *time = (TEE_Time){milliseconds / 1000, milliseconds % 1000};
}

void TEE_GenerateRandom(void *buffer, size_t size) { memset(buffer, 0x5A, size); }

TEE_Result TEE_OpenPersistentObject(uint32_t place, const void *object_name, size_t size, uint32_t flags, TEE_ObjectHandle *object) {
    (void)place, (void)object_name, (void)size, (void)flags;
    if (!there) return TEE_ERROR_ITEM_NOT_FOUND;
    if (failing()) return TEE_ERROR_STORAGE_NO_SPACE;
    storage.at = 0;
    *object = &storage;
    return TEE_SUCCESS;
}

TEE_Result TEE_CreatePersistentObject(uint32_t place, const void *object_name, size_t size, uint32_t flags, TEE_ObjectHandle attributes,
                                      const void *data, size_t data_size, TEE_ObjectHandle *object) {
    (void)place, (void)object_name, (void)size, (void)flags, (void)attributes;
    if (failing() || data_size > ROOM) return TEE_ERROR_STORAGE_NO_SPACE;
    memcpy(storage.octets, data, data_size);
    storage.size = data_size;
    there = true;
    *object = &storage;
    return TEE_SUCCESS;
}

TEE_Result TEE_SeekObjectData(TEE_ObjectHandle object, intmax_t offset, TEE_Whence whence) {
    (void)whence;
    if (object != &storage || offset < 0) abort();
    if (failing()) return TEE_ERROR_STORAGE_NO_SPACE;
    object->at = (size_t)offset;
    return TEE_SUCCESS;
}

TEE_Result TEE_ReadObjectData(TEE_ObjectHandle object, void *buffer, size_t size, size_t *count) {
    if (object != &storage) abort();
    if (failing()) return TEE_ERROR_STORAGE_NO_SPACE;
    *count = object->size - object->at < size ? object->size - object->at : size;
    memcpy(buffer, object->octets + object->at, *count);
    object->at += *count;
    return TEE_SUCCESS;
}

TEE_Result TEE_WriteObjectData(TEE_ObjectHandle object, const void *buffer, size_t size) {
    if (object != &storage || object->at + size > ROOM) abort();
    if (failing()) return TEE_ERROR_STORAGE_NO_SPACE;
    memcpy(object->octets + object->at, buffer, size);
    object->at += size;
    if (object->at > object->size) object->size = object->at;
    return TEE_SUCCESS;
}

static void begin_again(rt_bytes kept_record) {
    begun = waits = there = false;
    stored = TEE_HANDLE_NULL;
    fails = kept_record.size > 0 ? kept_record.at[0] : 0;
    accesses = milliseconds = 0;
    if (kept_record.size > 1) {
        storage.size = kept_record.size - 1 < ROOM ? kept_record.size - 1 : ROOM;
        memcpy(storage.octets, kept_record.at + 1, storage.size);
        there = true;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static const uint32_t right = TEE_PARAM_TYPES(TEE_PARAM_TYPE_MEMREF_INOUT, TEE_PARAM_TYPE_VALUE_INOUT, TEE_PARAM_TYPE_NONE, TEE_PARAM_TYPE_NONE);
    rt_bytes left = {data, (uint32_t)size}, record;
    if (!next_record(&left, &record)) return 0;
    begin_again(record);
    void *context = NULL;
    TEE_Param none[TEE_NUM_PARAMS] = {0};
    if (TA_CreateEntryPoint() != TEE_SUCCESS || TA_OpenSessionEntryPoint(0, none, &context) != TEE_SUCCESS) abort();
    while (next_record(&left, &record)) {
        if (record.size < 2) continue;
        const uint8_t how = record.at[1];
        const uint32_t octets = record.size - 2, room = how & 1 ? octets : RT_MAILBOX_SIZE;
        uint8_t *shared = malloc(room > 0 ? room : 1);
        memset(shared, 0xA5, room);
        memcpy(shared, record.at + 2, octets < room ? octets : room);
        TEE_Param parameters[TEE_NUM_PARAMS] = {{.memref = {shared, room}}, {.value = {how & 2 ? 0xFFFFFFF8u : how & 4 ? room : octets, 0}}};
        const TEE_Result found = TA_InvokeCommandEntryPoint(context, record.at[0], how & 8 ? right + 1 : right, parameters);
        if (found == TEE_SUCCESS && parameters[1].value.b > RT_MAILBOX_SIZE - RT_MAILBOX_HEAD) abort();
        free(shared);
    }
    TA_CloseSessionEntryPoint(context);
    TA_DestroyEntryPoint();
    return 0;
}
