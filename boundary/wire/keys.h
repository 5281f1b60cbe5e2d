/* Ed25519 keys, each bound to one duty. */
#ifndef RT_WIRE_KEYS_H
#define RT_WIRE_KEYS_H

#include "../crypto/crypto.h"

enum { RT_DUTY_ROOT, RT_DUTY_POLICY, RT_DUTY_MISSION, RT_DUTY_APPROVAL, RT_DUTY_LOG, RT_DUTY_WITNESS, RT_DUTY_BOUNDARY, RT_DUTIES };

/* A public key as the trust root names it: see `VerificationKey`. */
typedef struct {
    int64_t duty;
    rt_bytes public;
    rt_list roles, sources, vehicles, policies; /* texts */
    bool has_expiry;
    int64_t expires_us;
    bool development;
    rt_bytes person;
    uint8_t kid[RT_KID_BYTES];
} rt_key;

rt_bytes rt_duty_name(int64_t duty);

/* The name of a key, which depends on the duty too. */
void rt_key_id(int64_t duty, rt_bytes public, uint8_t kid[RT_KID_BYTES]);

#endif
