/* The gate for outgoing frames; only the executor opens and closes it. `frames.py`. */
#ifndef RT_ENFORCEMENT_FRAMES_H
#define RT_ENFORCEMENT_FRAMES_H

#include "allow_list.h"
#include "mavlink/signing.h"
#include "payload_gate.h"
#include "wire/boundary_chain.h"
#include "wire/preparation.h"

typedef struct {
    rt_chain *chain; /* the chain of the frames that pass */
    bool signs;
    rt_signed_link signer;
    bool open; /* a command is permitted, */
    rt_command command;
    int64_t not_after_us; /* the latest time of its first frame, monotonic */
    bool begun;           /* a frame of it was sent */
    int64_t leg;          /* the last point of its path that was sent, -1 before */
    bool here_known;
    rt_point here;
    int64_t above_home; /* mm */
    rt_payload_gate payload;
    bool let_out; /* a frame was sent or signed ahead since the last permit */
    bool started; /* a session was opened: fences are no longer changed */
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
/* Allow these parameters to be set while the vehicle is on the ground; then no longer. */
void rt_gate_prepare(rt_gate *gate, const rt_preparation *preparation);
void rt_gate_prepared(rt_gate *gate);
/* Whether the vehicle is known to be on the ground and disarmed, without a permitted command under way. */
bool rt_gate_stands(const rt_gate *gate, int64_t now_us);

/* Process a valid frame from the link, with a verified signature if there is a key. */
void rt_gate_observe(rt_gate *gate, rt_bytes frame, int64_t now_us);

/* Why a frame is refused at a monotonic time, NULL if it passes; `out`, of RT_LARGEST_FRAME octets, is then the frame to send. */
rt_refusal rt_gate_seal(rt_gate *gate, rt_bytes frame, int64_t now_us, uint8_t *out, uint32_t *size);

/* Sign a frame of a command ahead, for use after the loss of the boundary: returns the reason of a refusal, or NULL, and its signature
   in `out`, of RT_SIGNATURE octets, if the link has a key. The gate does not change. */
rt_refusal rt_gate_sign_ahead(rt_gate *gate, const rt_command *command, rt_bytes frame, int64_t now_us, uint8_t *out);

#endif
