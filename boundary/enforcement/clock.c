#include "clock.h"

#include "mavlink/framing.h"
#include "model/limits.h"

#define SECOND_US 1000000
#define CHALLENGE_US 5000000LL
#define TIMES 16 /* the octets of a payload that are read */

static void take(rt_clock *clock, int64_t source, int64_t ahead_us, int64_t error_us, int64_t since_us) {
    clock->source = source;
    clock->ahead_us = ahead_us;
    clock->error_us = error_us;
    clock->since_us = since_us;
}

void rt_clock_begin(rt_clock *clock, const rt_now *machine, int64_t stated_us) {
    memset(clock, 0, sizeof *clock);
    clock->stated_us = stated_us;
    take(clock, RT_UTC_UNKNOWN, machine->utc_us - machine->monotonic_us, RT_UTC_UNKNOWN_US, 0);
    rt_clock_look(clock, machine);
}

void rt_clock_look(rt_clock *clock, const rt_now *machine) {
    if (clock->source == RT_UTC_UNKNOWN && machine->utc_error_us < RT_UTC_UNKNOWN_US)
        take(clock, RT_UTC_KERNEL, machine->utc_us - machine->monotonic_us, machine->utc_error_us, machine->monotonic_us);
}

void rt_clock_settle(rt_clock *clock, int64_t monotonic_us) {
    if (clock->source == RT_UTC_UNKNOWN && clock->stated_us >= 0)
        take(clock, RT_UTC_OPERATOR, clock->ahead_us, clock->stated_us, monotonic_us);
}

void rt_clock_now(const rt_clock *clock, int64_t monotonic_us, rt_now *now) {
    int64_t error_us = clock->error_us;
    if (clock->source != RT_UTC_UNKNOWN)
        error_us += rt_max(0, monotonic_us - clock->since_us) / SECOND_US * RT_DRIFT_US +
                    rt_max(0, monotonic_us - clock->since_us) % SECOND_US * RT_DRIFT_US / SECOND_US;
    *now = (rt_now){monotonic_us, rt_max(0, monotonic_us + clock->ahead_us), rt_min(error_us, RT_UTC_UNKNOWN_US)};
}

bool rt_clock_asks(const rt_clock *clock, int64_t monotonic_us) {
    return clock->source == RT_UTC_UNKNOWN && (clock->number == 0 || monotonic_us - clock->drawn_us > CHALLENGE_US);
}

void rt_clock_challenge(rt_clock *clock, int64_t number, int64_t monotonic_us) {
    clock->number = number;
    clock->drawn_us = monotonic_us;
    clock->answered = false;
}

int64_t rt_clock_number(const rt_clock *clock) { return clock->source == RT_UTC_UNKNOWN ? clock->number : 0; }

static uint64_t le64(const uint8_t *at) {
    uint64_t value = 0;
    for (uint32_t octet = 0; octet < 8; octet++) value |= (uint64_t)at[octet] << 8 * octet;
    return value;
}

/* Message and first octets of a complete frame of an autopilot, including trailing zeros that are not sent; false for another. */
static bool of_autopilot(rt_bytes frame, uint32_t *message, uint8_t body[TIMES]) {
    if (frame.size < RT_HEADER || frame.at[0] != RT_MARKER || frame.at[6] != RT_MAV_COMP_ID_AUTOPILOT1) return false;
    const uint32_t length = frame.at[1];
    if (frame.size != RT_HEADER + length + RT_CHECKSUM) return false;
    memset(body, 0, TIMES);
    memcpy(body, frame.at + RT_HEADER, length < TIMES ? length : TIMES);
    *message = frame.at[7] | (uint32_t)frame.at[8] << 8 | (uint32_t)frame.at[9] << 16;
    return true;
}

void rt_clock_hear(rt_clock *clock, rt_bytes frame, uint8_t link, int64_t vehicle_us, int64_t monotonic_us) {
    uint32_t message;
    uint8_t body[TIMES];
    if (clock->source != RT_UTC_UNKNOWN || clock->number == 0 || monotonic_us - clock->drawn_us > CHALLENGE_US) return;
    if (!of_autopilot(frame, &message, body)) return;
    if (message == RT_MSG_TIMESYNC) {
        const uint64_t clock_ns = le64(body + RT_TIMESYNC_TC1), number = le64(body + RT_TIMESYNC_TS1);
        if (clock_ns == 0 || clock_ns > INT64_MAX || number != (uint64_t)clock->number) return;
        clock->answered = true;
        clock->system = frame.at[5];
        clock->component = frame.at[6];
        clock->link = link;
    } else if (message == RT_MSG_SYSTEM_TIME && clock->answered && frame.at[5] == clock->system && frame.at[6] == clock->component &&
               link == clock->link) {
        const uint64_t utc_us = le64(body + RT_SYSTEM_TIME_TIME_UNIX_USEC);
        if (utc_us < RT_UNIX_US || utc_us > RT_MAX_VALUE) return;
        const int64_t open_us = rt_max(0, monotonic_us - clock->drawn_us);
        take(clock, RT_UTC_VEHICLE, (int64_t)utc_us - monotonic_us + open_us / 2, vehicle_us + open_us - open_us / 2, monotonic_us);
    }
}

bool rt_bears_out(const rt_now *own, const rt_now *named) {
    if (own->utc_error_us >= RT_UTC_UNKNOWN_US) /* an error that is so large covers every year from 1970 to 2112 */
        return named->utc_error_us >= RT_UTC_UNKNOWN_US && named->utc_us <= RT_UTC_UNKNOWN_US;
    return rt_abs(named->utc_us - own->utc_us) + own->utc_error_us <= named->utc_error_us + RT_APART_US;
}
