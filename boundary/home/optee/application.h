/* The trusted application, as its client calls it: one command for each wish of ../trustzone_m/mailbox.h, and three of its own.

   Parameter 0 is memory that both see, of RT_MAILBOX_SIZE octets: what is given, and the answer in its place. Parameter 1 are two
   numbers: the size of what is given; what becomes of it, and the size of the answer. */
#ifndef RT_OPTEE_APPLICATION_H
#define RT_OPTEE_APPLICATION_H

#define TA_UUID {0x7e1d2c5a, 0x0f5b, 0x4d0e, {0x9a, 0x61, 0x52, 0x54, 0x53, 0x48, 0x43, 0x55}}

enum {
    RT_WANT_BEGIN = 'B', /* the setup of ../trustzone_m/world.c, once; what was kept is taken from secure storage */
    RT_WANT_LOOK = 'L',  /* a copy of what is in secure storage: nothing of it is secret */
    RT_WANT_STORE = 'T'  /* write what waits to be kept: called when the answer has left, so that it does not wait for the disk */
};

#endif
