/* Which frames to cameras, gimbals and other payload may leave, and how often. `payload_gate.py`. */
#ifndef RT_ENFORCEMENT_PAYLOAD_H
#define RT_ENFORCEMENT_PAYLOAD_H

#include "command.h"
#include "mavlink/framing.h"

#define RT_RETRIES 3
#define RT_MOST_ENDINGS (1 + RT_MAX_EMISSIONS) /* how many commands may be left that end what others began: of a whole step */

/* How often a declared command was sent. */
typedef struct {
    rt_payload_frame frame;
    int64_t sent, last_us;
    uint32_t retries;
} rt_sendings;

/* The command that ends what another one began: to which component, and how often it may still be sent. */
typedef struct {
    uint16_t command;
    uint32_t numbers[7];
    uint8_t component;
    uint32_t left;
} rt_ending;

typedef struct {
    rt_sendings open[1 + RT_MAX_EMISSIONS]; /* what the present step may send; the first one may take control of a gimbal */
    uint32_t count;
    rt_list servos;
    rt_ending endings[RT_MOST_ENDINGS]; /* the oldest first */
    uint32_t ending_count;
    uint8_t camera, gimbal; /* the components that were heard, 0 before */
} rt_payload_gate;

/* The commands to payload of a step, and the vehicle's free servo outputs. */
void rt_payload_of(const rt_invocation *invocation, const rt_policy *policy, rt_command *command);

void rt_payload_open(rt_payload_gate *gate, const rt_command *command, uint8_t system);
void rt_payload_close(rt_payload_gate *gate);
/* A heartbeat of a component of the vehicle's system other than the autopilot. */
void rt_payload_hear(rt_payload_gate *gate, const rt_frame *heartbeat);
bool rt_payload_has(const rt_payload_gate *gate, uint8_t component);
bool rt_is_payload(const rt_frame *frame);
/* Why a command to payload is refused at a monotonic time; NULL if it passes, and then it counts as sent. */
rt_refusal rt_payload_refuse(rt_payload_gate *gate, const rt_frame *frame, int64_t now_us, uint8_t autopilot, bool home_known,
                             int64_t home_amsl);

#endif
