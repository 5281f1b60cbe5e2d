/* The gate that frames leave by, opened and closed by the executor alone. `frames.py`. */
#ifndef RT_ENFORCEMENT_FRAMES_H
#define RT_ENFORCEMENT_FRAMES_H

#include "allow_list.h"
#include "mavlink/signing.h"
#include "wire/boundary_chain.h"
#include "wire/preparation.h"

typedef struct {
    rt_chain *chain; /* where what leaves is chained */
    bool signs;
    rt_signed_link signer;
    bool open; /* a command is permitted, */
    rt_command command;
    int64_t not_after_us; /* its first frame leaves by then, monotonic */
    bool begun;           /* a frame of it left */
    int64_t leg;          /* the last point of its path that was sent, -1 before */
    bool here_known;
    rt_point here;
    bool let_out; /* a frame left, or was signed ahead, since a command was permitted last */
    bool started; /* a session was opened: fences stay as they are */
    uint8_t system, autopilot, kind; /* of its heartbeat */
    bool armed;
    int64_t armed_us, stands_us;
    bool types_known;
    uint32_t types;
    rt_setting prepared[RT_MAX_WRITES];
    uint32_t prepared_count;
    int64_t prepared_us;
    bool home_known, settled_known;
    int64_t home_amsl, settled_amsl; /* mm */
} rt_gate;

void rt_gate_open(rt_gate *gate, const rt_command *command, int64_t not_after_us);
void rt_gate_close(rt_gate *gate);
/* Let these parameters be set, as long as the vehicle stands on the ground; then let none be set any more. */
void rt_gate_prepare(rt_gate *gate, const rt_preparation *preparation);
void rt_gate_prepared(rt_gate *gate);
/* Whether it is known to be on the ground, disarmed, and nothing that was permitted is under way. */
bool rt_gate_stands(const rt_gate *gate, int64_t now_us);

/* Take in one good frame from the link, its signature verified where there is a key. */
void rt_gate_observe(rt_gate *gate, rt_bytes frame, int64_t now_us);

/* Why a frame is not sent at a monotonic time, NULL where it is; `out`, of RT_LARGEST_FRAME octets, is what to send then. */
rt_refusal rt_gate_seal(rt_gate *gate, rt_bytes frame, int64_t now_us, uint8_t *out, uint32_t *size);

/* Sign a frame of a command ahead, to be sent only when no boundary is there any more: why not, or NULL, and its
   signature in `out`, of RT_SIGNATURE octets, where the link has a key. The gate stays as it is. */
rt_refusal rt_gate_sign_ahead(rt_gate *gate, const rt_command *command, rt_bytes frame, int64_t now_us, uint8_t *out);

#endif
