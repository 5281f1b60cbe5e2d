/* What the trusted application uses of the TEE Internal Core API (GlobalPlatform, GPD_SPE_010), for the fuzz target `application.c`, which
   has the functions. The program that flies is built with OP-TEE's own header. */
#ifndef RT_FUZZ_TEE_INTERNAL_API_H
#define RT_FUZZ_TEE_INTERNAL_API_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef uint32_t TEE_Result;
typedef struct object *TEE_ObjectHandle;
typedef enum { TEE_DATA_SEEK_SET } TEE_Whence;
typedef struct {
    uint32_t seconds, millis;
} TEE_Time;
typedef union {
    struct {
        void *buffer;
        size_t size;
    } memref;
    struct {
        uint32_t a, b;
    } value;
} TEE_Param;

#define TEE_HANDLE_NULL ((TEE_ObjectHandle)0)
#define TEE_NUM_PARAMS 4
#define TEE_PARAM_TYPES(a, b, c, d) ((uint32_t)((a) | (b) << 4 | (c) << 8 | (d) << 12))
enum { TEE_PARAM_TYPE_NONE = 0, TEE_PARAM_TYPE_VALUE_INOUT = 3, TEE_PARAM_TYPE_MEMREF_INOUT = 7 };
enum { TEE_STORAGE_PRIVATE = 1, TEE_DATA_FLAG_ACCESS_READ = 1, TEE_DATA_FLAG_ACCESS_WRITE = 2 };
#define TEE_SUCCESS 0u
#define TEE_ERROR_BAD_PARAMETERS 0xFFFF0006u
#define TEE_ERROR_BAD_STATE 0xFFFF0007u
#define TEE_ERROR_ITEM_NOT_FOUND 0xFFFF0008u
#define TEE_ERROR_STORAGE_NO_SPACE 0xFFFF3041u

void TEE_GetSystemTime(TEE_Time *time);
void TEE_GenerateRandom(void *buffer, size_t size);
TEE_Result TEE_OpenPersistentObject(uint32_t storage, const void *name, size_t size, uint32_t flags, TEE_ObjectHandle *object);
TEE_Result TEE_CreatePersistentObject(uint32_t storage, const void *name, size_t size, uint32_t flags, TEE_ObjectHandle attributes,
                                      const void *data, size_t data_size, TEE_ObjectHandle *object);
TEE_Result TEE_SeekObjectData(TEE_ObjectHandle object, intmax_t offset, TEE_Whence whence);
TEE_Result TEE_ReadObjectData(TEE_ObjectHandle object, void *buffer, size_t size, size_t *count);
TEE_Result TEE_WriteObjectData(TEE_ObjectHandle object, const void *buffer, size_t size);

#endif
