/* What every home of the boundary does: what it says first, and what it keeps of the link's timestamps. */
#ifndef RT_HOME_COMMON_H
#define RT_HOME_COMMON_H

#include "enforcement/boundary.h"

/* How far ahead of what was used the link's timestamp is kept, in its units of 10 us, and how often: signing.py. A home that takes long to
   write has its own (boundary/Makefile). */
#ifndef RT_RESERVE
#define RT_RESERVE 300000LL
#define RT_KEEP_EVERY_US 1000000LL
#endif
_Static_assert(RT_RESERVE * 10 > RT_KEEP_EVERY_US, "what is used until the next time is covered");

#define RT_GREETING_BYTES (4 + RT_LINK_NAME + 2 * RT_KEY_BYTES + 1)

/* The first message of a home: the measures in force (4, little-endian), the name of the link's key, the public halves of the log's key
   and of its own, zeros for keys that it does not have, and whether it decides by a clock of its own. */
void rt_greet(const rt_setup *setup, uint32_t measures, bool own_clock, uint8_t greeting[RT_GREETING_BYTES]);

/* Take the link's timestamps into what is kept: ours `ahead` of what was used, each peer's as it was last heard (signing.py says why). */
void rt_gather_link(rt_boundary *boundary, int64_t ahead);

/* Whether what must outlive the home has to be written after an answer, at a time `now_us`, where it was last at `kept_us`. */
bool rt_is_to_be_kept(const rt_boundary *boundary, int64_t now_us, int64_t kept_us);

#endif
