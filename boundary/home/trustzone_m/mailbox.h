/* How the normal world reaches the boundary in the secure world: one function, and a piece of memory that both see.

   The normal world puts octets into the mailbox and calls `rt_gateway` with what it wants and how many they are. The answer stands where
   the octets stood, its size in the first four octets, little-endian. */
#ifndef RT_TRUSTZONE_M_MAILBOX_H
#define RT_TRUSTZONE_M_MAILBOX_H

#include <stdint.h>

/* what is wanted: also the octet that the host sends as a doorbell */
enum {
    RT_WANT_GREETING = 'G', /* the first message (../common.h), then the counter of what is kept (8) */
    RT_WANT_CALL = 'C',     /* octets of a call (enforcement/calls.h), and its answer */
    RT_WANT_KEPT = 'K',     /* what was handed out to be kept is on the disk: the answer that was held back */
    RT_WANT_NOT_KEPT = 'N', /* it is not: the answer is a refusal now */
    RT_WANT_END = 'E',      /* nothing more is wanted: what is to be kept, exactly */
    RT_WANT_STATUS = 'S'    /* how often the normal world reached for what is not its own (4) */
};

/* what becomes of it: also the octet that the host is sent */
enum {
    RT_DONE = 'd',       /* the answer is in the mailbox */
    RT_DONE_KEEP = 'k',  /* likewise; behind it a newer sealed blob, to be kept when there is time */
    RT_KEEP_FIRST = 'f', /* no answer before the sealed blob in the mailbox is kept */
    RT_WRONG = 'w',      /* no such thing is wanted now, or not with such a mailbox */
    RT_VIOLATED = 'v',   /* the normal world reached for what is not its own: nothing is answered any more */
    RT_NOT_BEGUN = 'b'   /* the boundary did not begin; the answer is one octet, the code of ../process/main.c that says why */
};

#define RT_MAILBOX 0x80000000u
#ifndef RT_MAILBOX_SIZE
#define RT_MAILBOX_SIZE 0x10000u
#endif
#define RT_BLOB_SIZE 6224u /* rtshcua/adapters/boundary/trustzone_m.py */
#define RT_MAILBOX_HEAD 8 /* size of the answer (4), size of the blob behind it (4) */

#endif
