/* The normal world's stead. The runtime itself is on the host; whoever takes this over has what the runtime has. */
#ifndef RT_TRUSTZONE_M_NORMAL_H
#define RT_TRUSTZONE_M_NORMAL_H

#include "board.h"
#include "mailbox.h"

/* The way into the secure world (secure.c). */
uint32_t rt_gateway(uint32_t want, uint8_t *mailbox, uint32_t size);

/* What becomes of an octet of the host, with so many octets in the mailbox. */
uint32_t serve(uint32_t want, uint8_t *mailbox, uint32_t size);

#endif
