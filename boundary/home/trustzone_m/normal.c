/* What the normal world does: it passes everything on. */
#include "normal.h"

uint32_t serve(uint32_t want, uint8_t *mailbox, uint32_t size) { return rt_gateway(want, mailbox, size); }
