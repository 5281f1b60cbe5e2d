/* The secure world without its hardware: what it is given at the start, and what it answers through the mailbox. */
#ifndef RT_TRUSTZONE_M_WORLD_H
#define RT_TRUSTZONE_M_WORLD_H

#include "mailbox.h"
#include "wire/attestation.h"

#ifdef __ARM_FEATURE_CMSE
#define RT_KEY_PAGES __attribute__((section(".keys"))) /* keys fill pages of their own, so that a test can name them */
#else
#define RT_KEY_PAGES
#endif

/* Begin with a setup, and answer the monotonic time that it names. Whether it began, the answers say. */
int64_t rt_world_begin(const uint8_t *setup, uint32_t size, const rt_home *home);

/* Serve one wish of the normal world at a monotonic time; `mailbox` is its memory, of RT_MAILBOX_SIZE octets, and may change meanwhile.
   `violations`: how often it reached for what is not its own. */
uint32_t rt_world_answer(uint32_t want, uint8_t *mailbox, uint32_t size, int64_t now_us, uint32_t violations);

/* Forget all keys. */
void rt_world_wipe(void);

#endif
