#include "framing.h"

bool rt_read_frame(rt_bytes octets, rt_frame *frame) {
    const uint8_t *at = octets.at;
    if (octets.size < RT_HEADER || at[0] != RT_MARKER)
        return false;
    uint32_t length = at[1], message = at[7] | (uint32_t)at[8] << 8 | (uint32_t)at[9] << 16, known = 0;
    const uint32_t count = sizeof rt_layouts / sizeof *rt_layouts;
    while (known < count && rt_layouts[known].message != message)
        known++;
    if (known == count || at[2] != 0 || at[3] != 0 || octets.size != RT_HEADER + length + RT_CHECKSUM)
        return false;
    if (length > rt_layouts[known].size)
        return false;
    memset(frame, 0, sizeof *frame);
    frame->system = at[5];
    frame->component = at[6];
    frame->message = message;
    memcpy(frame->payload, at + RT_HEADER, length);
    const int16_t target = rt_layouts[known].target;
    if (target >= 0) {
        frame->has_target = true;
        frame->target_system = frame->payload[target];
        frame->target_component = frame->payload[target + 1];
    }
    return true;
}

uint16_t rt_u16(const rt_frame *frame, uint32_t at) {
    return (uint16_t)(frame->payload[at] | frame->payload[at + 1] << 8);
}

uint32_t rt_u32(const rt_frame *frame, uint32_t at) {
    return rt_u16(frame, at) | (uint32_t)rt_u16(frame, at + 2) << 16;
}

int32_t rt_i32(const rt_frame *frame, uint32_t at) {
    uint32_t bits = rt_u32(frame, at);
    return bits <= INT32_MAX ? (int32_t)bits : (int32_t)((int64_t)bits - (1LL << 32));
}

/* One octet of CRC-16/MCRF4XX. */
static uint16_t crc_on(uint16_t crc, uint8_t octet) {
    uint8_t mixed = (uint8_t)(octet ^ (crc & 0xFF));
    mixed = (uint8_t)(mixed ^ (uint8_t)(mixed << 4));
    return (uint16_t)(crc >> 8 ^ (uint16_t)(mixed << 8) ^ (uint16_t)(mixed << 3) ^ mixed >> 4);
}

void rt_set_flags(uint8_t *frame, uint8_t flags) {
    /* The checksum is linear: the effect of a changed octet depends only on that octet and its place. There are `end` octets from after
       the marker to the message's extra octet, and the second of them changes. */
    uint32_t end = RT_HEADER + (uint32_t)frame[1];
    uint16_t change = crc_on(0, 0);
    change = crc_on(change, (uint8_t)(frame[RT_FLAGS] ^ flags));
    for (uint32_t left = end - 2; left > 0; left--)
        change = crc_on(change, 0);
    frame[RT_FLAGS] = flags;
    frame[end] = (uint8_t)(frame[end] ^ (change & 0xFF));
    frame[end + 1] = (uint8_t)(frame[end + 1] ^ change >> 8);
}
