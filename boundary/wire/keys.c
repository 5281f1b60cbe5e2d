#include "keys.h"

#include "digest.h"
#include "names.h"

static const rt_bytes duties[RT_DUTIES] = {RT_TEXT("root"), RT_TEXT("policy"), RT_TEXT("mission"), RT_TEXT("approval"), RT_TEXT("log"), RT_TEXT("witness"), RT_TEXT("boundary")};

rt_bytes rt_duty_name(int64_t duty) { return RT_AT(duties, duty); }

void rt_key_id(int64_t duty, rt_bytes public, uint8_t kid[RT_KID_BYTES]) {
    static const uint8_t label[] = "rtshcua/duty/", nul = 0;
    uint8_t digest[RT_DIGEST_BYTES];
    rt_sha256 hash;
    rt_sha256_begin(&hash);
    rt_sha256_add(&hash, RT_DOMAIN("key"));
    rt_sha256_add(&hash, (rt_bytes){label, sizeof label - 1});
    rt_sha256_add(&hash, rt_duty_name(duty));
    rt_sha256_add(&hash, (rt_bytes){&nul, 1});
    rt_sha256_add(&hash, public);
    rt_sha256_end(&hash, digest);
    memcpy(kid, digest, RT_KID_BYTES);
}
