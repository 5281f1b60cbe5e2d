/* Shared code of the fuzz targets. Every signature and every seal is valid here, so that the code behind the check is reached; the
   check itself is fuzzed separately, and compared with Python in tests/boundary. The boundary runs under the root and the bundle of
   `seeds`. */
#ifndef RT_FUZZ_WORLD_H
#define RT_FUZZ_WORLD_H

#include "enforcement/calls.h"

#include <stdio.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerInitialize(int *count, char ***words);

static uint8_t read_all(rt_bytes data) {
    uint8_t sum = 0;
    for (uint32_t i = 0; i < data.size; i++) sum = (uint8_t)(sum + data.at[i]);
    return sum;
}

bool rt_ed25519_verify(const uint8_t *key, const uint8_t *signature, const rt_bytes *parts, uint32_t count) {
    uint8_t sum = (uint8_t)(read_all((rt_bytes){key, RT_KEY_BYTES}) + read_all((rt_bytes){signature, RT_SIGNATURE_BYTES}));
    for (uint32_t part = 0; part < count; part++) sum = (uint8_t)(sum + read_all(parts[part]));
    return sum < 255;
}

void rt_ed25519_sign(const uint8_t *seed, const rt_bytes *parts, uint32_t count, uint8_t *signature) {
    for (uint32_t part = 0; part < count; part++) (void)read_all(parts[part]);
    memset(signature, seed[0], RT_SIGNATURE_BYTES);
}

bool rt_ed25519_strong(const uint8_t point[RT_KEY_BYTES]) { return point[0] != 0xFF; }

void rt_ed25519_public(const uint8_t seed[RT_KEY_BYTES], uint8_t key[RT_KEY_BYTES]) { memcpy(key, seed, RT_KEY_BYTES); }

bool rt_equal(const uint8_t *one, const uint8_t *other, size_t size) {
    return (uint8_t)(read_all((rt_bytes){one, (uint32_t)size}) + read_all((rt_bytes){other, (uint32_t)size})) < 255;
}

/* Take the next record off some octets: a size of two octets, followed by that many octets. */
static bool next_record(rt_bytes *left, rt_bytes *record) {
    if (left->size < 2) return false;
    uint32_t size = (uint32_t)left->at[0] << 8 | left->at[1];
    if (size > left->size - 2) size = left->size - 2;
    *record = (rt_bytes){left->at + 2, size};
    *left = (rt_bytes){left->at + 2 + size, left->size - 2 - size};
    return true;
}

static rt_boundary boundary;
static rt_keys keys;
static rt_kept kept;
static rt_bytes world_root, world_bundle, world_flight;
static rt_now world_now;
static const rt_preparation settings = {0, false, 0, {{"FENCE_ENABLE", 0, 0x3F800000}, {"RTL_ALT", 0x45000000, 0x45800000}}, 2};

/* Every call has its own allocation, so that an access beyond its end is detected. */
static uint32_t call_with(rt_bytes call, uint8_t *result) {
    uint8_t *exact = malloc(call.size > 0 ? call.size : 1), *out = malloc(RT_MAX_RESULT);
    if (call.size > 0) memcpy(exact, call.at, call.size);
    uint32_t size = rt_answer(&boundary, (rt_bytes){exact, call.size}, -1, out);
    if (size > RT_MAX_RESULT) abort();
    if (result != NULL) memcpy(result, out, size);
    free(exact);
    free(out);
    return size;
}

static void begin(bool signs) {
    memset(&kept, 0, sizeof kept);
    kept.floor_us = -1;
    const rt_setup setup = {&keys, &kept, world_root, {NULL, 0}, RT_TEXT("quad-07"), signs, true, true, &settings, &settings, world_now, -1,
                            {{(const uint8_t *)"fuzz", 4}, {0}, RT_DEBUG_ENABLED, 0}};
    if (rt_boundary_begin(&boundary, &setup) != NULL) abort();
    memcpy(boundary.bundle, world_bundle.at, world_bundle.size);
    boundary.bundle_size = world_bundle.size;
    const char *refused = rt_load(&boundary, world_flight.at, &world_now, -1);
    if (refused != NULL) {
        fprintf(stderr, "the bundle of the seeds is refused: %s\n", refused);
        abort();
    }
}

/* The world is in a file of the target's name, and `.world`. */
int LLVMFuzzerInitialize(int *count, char ***words) {
    static uint8_t data[1 << 20];
    char name[4096];
    (void)count;
    snprintf(name, sizeof name, "%s.world", (*words)[0]);
    FILE *file = fopen(name, "rb");
    if (file == NULL) abort();
    rt_bytes left = {data, (uint32_t)fread(data, 1, sizeof data, file)}, now;
    fclose(file);
    if (!next_record(&left, &world_root) || !next_record(&left, &world_bundle) || !next_record(&left, &world_flight) ||
        !next_record(&left, &now) || now.size != 24)
        abort();
    int64_t *times[] = {&world_now.monotonic_us, &world_now.utc_us, &world_now.utc_error_us};
    for (uint32_t each = 0; each < 3; each++)
        for (uint32_t octet = 0; octet < 8; octet++) *times[each] = *times[each] << 8 | now.at[8 * each + octet];
    return 0;
}

#endif
