/* The layout of a MAVLink 2 frame on the wire: https://mavlink.io/en/guide/serialization.html. `framing.py`, `layouts.py`. */
#ifndef RT_MAVLINK_FRAMING_H
#define RT_MAVLINK_FRAMING_H

#include "../base.h"
#include "layouts.h"

#define RT_MARKER 0xFD
#define RT_HEADER 10
#define RT_CHECKSUM 2
#define RT_SIGNATURE 13
#define RT_FLAGS 2
#define RT_FLAG_SIGNED 1
#define RT_LARGEST_FRAME (RT_HEADER + 255 + RT_CHECKSUM + RT_SIGNATURE)

/* One complete unsigned frame of a message in `rt_layouts`; the payload includes the trailing zeros that are not sent. */
typedef struct {
    uint8_t system, component;
    uint32_t message;
    uint8_t payload[64];
    bool has_target;
    uint8_t target_system, target_component;
} rt_frame;

/* The frame in these octets; false for anything else. The receiver checks the checksum. */
bool rt_read_frame(rt_bytes octets, rt_frame *frame);

uint16_t rt_u16(const rt_frame *frame, uint32_t at);
uint32_t rt_u32(const rt_frame *frame, uint32_t at); /* the bits of a float, too */
int32_t rt_i32(const rt_frame *frame, uint32_t at);

/* Give a frame other incompatibility flags and the matching checksum, in place. It has no signature. */
void rt_set_flags(uint8_t *frame, uint8_t flags);

#endif
