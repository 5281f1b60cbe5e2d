/* The boundary's own time of day, never the runtime's. `wire/clock.py`. */
#ifndef RT_ENFORCEMENT_CLOCK_H
#define RT_ENFORCEMENT_CLOCK_H

#include "../base.h"
#include "../model/flat.h"
#include "../model/limits.h"

/* its source */
enum { RT_UTC_UNKNOWN = 0, RT_UTC_KERNEL = 1, RT_UTC_VEHICLE = 2, RT_UTC_OPERATOR = 3, RT_UTC_SHARED = 4 };

typedef struct {
    int64_t source;
    int64_t stated_us; /* the error of the machine's clock as stated by an operator, -1 if not stated */
    int64_t ahead_us;  /* UTC minus monotonic time */
    int64_t error_us, since_us;
    int64_t number, drawn_us; /* the challenge that the vehicle must return, 0 if none was drawn, and its time */
    bool answered;            /* the stream that returned it */
    uint8_t system, component, link;
} rt_clock;

/* `machine` is the machine's clock, with the error reported by the kernel: RT_UTC_UNKNOWN_US if it is not synchronised. */
void rt_clock_begin(rt_clock *clock, const rt_now *machine, int64_t stated_us);
/* Read the machine's clock again: it is used if it is synchronised, and no source was used before. */
void rt_clock_look(rt_clock *clock, const rt_now *machine);
/* Stop waiting: the operator's statement holds, if there is no better source. */
void rt_clock_settle(rt_clock *clock, int64_t monotonic_us);

void rt_clock_now(const rt_clock *clock, int64_t monotonic_us, rt_now *now);

/* Whether to draw a number for the next challenge, positive and unpredictable; then set it; and read it, 0 if the vehicle must return
   none. */
bool rt_clock_asks(const rt_clock *clock, int64_t monotonic_us);
void rt_clock_challenge(rt_clock *clock, int64_t number, int64_t monotonic_us);
int64_t rt_clock_number(const rt_clock *clock);

/* A frame with a verified signature came in by a link of this id; its signature is removed. The vehicle's UTC may be off by
   RT_ARDUPILOT_US, and for any other autopilot by RT_VEHICLE_US. */
void rt_clock_hear(rt_clock *clock, rt_bytes frame, uint8_t link, int64_t vehicle_us, int64_t monotonic_us);

/* Whether a claimed time of day may be used in a decision. */
bool rt_bears_out(const rt_now *own, const rt_now *named);

#endif
