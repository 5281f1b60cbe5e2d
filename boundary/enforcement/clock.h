/* The time of day that the boundary holds to: its own, never what the runtime names. `wire/clock.py`. */
#ifndef RT_ENFORCEMENT_CLOCK_H
#define RT_ENFORCEMENT_CLOCK_H

#include "../base.h"
#include "../model/flat.h"
#include "../model/limits.h"

/* where it is from */
enum { RT_UTC_UNKNOWN = 0, RT_UTC_KERNEL = 1, RT_UTC_VEHICLE = 2, RT_UTC_OPERATOR = 3, RT_UTC_SHARED = 4 };

typedef struct {
    int64_t source;
    int64_t stated_us; /* what an operator says that the machine's clock is off by at most, -1 for nothing */
    int64_t ahead_us;  /* UTC less monotonic time */
    int64_t error_us, since_us;
    int64_t number, drawn_us; /* that the vehicle is to send back, 0 where none was drawn, and since when */
    bool answered;            /* it did, by a stream of these */
    uint8_t system, component, link;
} rt_clock;

/* `machine` is the machine's clock, its error as the kernel says it: RT_UTC_UNKNOWN_US where that is not synchronised. */
void rt_clock_begin(rt_clock *clock, const rt_now *machine, int64_t stated_us);
/* The machine's clock, once more: it is taken where it is synchronised, and nothing was taken before. */
void rt_clock_look(rt_clock *clock, const rt_now *machine);
/* No more is waited for: what the operator stated holds, if nothing better was told. */
void rt_clock_settle(rt_clock *clock, int64_t monotonic_us);

void rt_clock_now(const rt_clock *clock, int64_t monotonic_us, rt_now *now);

/* Whether a number is to be drawn for the next challenge, above 0 and not to be guessed; then that it was; and which it is, 0 where
   the vehicle is to send none back. */
bool rt_clock_asks(const rt_clock *clock, int64_t monotonic_us);
void rt_clock_challenge(rt_clock *clock, int64_t number, int64_t monotonic_us);
int64_t rt_clock_number(const rt_clock *clock);

/* A frame of which the link's signature was verified came in by a link of this id; its signature is off. The vehicle's own UTC may be
   off by so much: RT_ARDUPILOT_US, and RT_VEHICLE_US for any other autopilot. */
void rt_clock_hear(rt_clock *clock, rt_bytes frame, uint8_t link, int64_t vehicle_us, int64_t monotonic_us);

/* Whether a time of day that is named may be decided by. */
bool rt_bears_out(const rt_now *own, const rt_now *named);

#endif
