/* What keeps others out of a boundary's process, and it away from everything else (Linux). Each measure that the kernel or the
   rights do not allow is named, and the others are taken. */
#ifndef RT_HOME_ISOLATION_H
#define RT_HOME_ISOLATION_H

#include <stdint.h>

/* bits of what is in force */
enum {
    RT_OWN_USER = 1,      /* runs under a user of its own */
    RT_OWN_NETWORK = 2,   /* a network namespace in which there is nothing */
    RT_LANDLOCK = 4,      /* no file but what is open */
    RT_SECCOMP = 8,       /* the few system calls that it needs; any other kills it */
    RT_NOT_DUMPABLE = 16, /* no core dump, no ptrace and no /proc/PID/mem but by root */
    RT_LOCKED_MEMORY = 32, /* nothing is swapped out */
    RT_SECRET_MEMORY = 64  /* the keys lie where the kernel itself does not look (memfd_secret) */
};

/* A place for keys of so many octets; `*measures` says whether it is secret and locked. NULL where there is none. */
void *rt_key_memory(uint32_t size, uint32_t *measures);

/* Take every measure that can be taken; 0 for a user keeps the present one. Call it with everything open. */
uint32_t rt_isolate(uint32_t user, uint32_t group);

/* Whether another user than ours connected this socket. */
int rt_is_anothers(int connection);

/* From now on the kernel kills this process when the thread that started it ends, also one that hangs or is stopped. Call it after
   rt_isolate: a change of user undoes it. False where `parent`, its parent at its start, is gone already. */
int rt_end_with(int parent);

#endif
