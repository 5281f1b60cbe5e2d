/* The checkpoint of a log's first record, as it is signed: `note.py`, `heads.py`. */
#ifndef RT_EVIDENCE_NOTE_H
#define RT_EVIDENCE_NOTE_H

#include "../base.h"

/* Whether a text is exactly the checkpoint that begins the log of this flight on this vehicle: no record precedes it, and the key of
   the first epoch follows. */
bool rt_begins_log(rt_bytes text, rt_bytes vehicle, const uint8_t flight[RT_FLIGHT_BYTES]);

#endif
