/* Isolates a boundary's process from others and from the system (Linux). Measures that the kernel or the permissions do not allow are
   reported, and the others are applied. */
#ifndef RT_HOME_ISOLATION_H
#define RT_HOME_ISOLATION_H

#include <stdint.h>

/* bits of the measures in force */
enum {
    RT_OWN_USER = 1,      /* runs under a user of its own */
    RT_OWN_NETWORK = 2,   /* an empty network namespace */
    RT_LANDLOCK = 4,      /* only files that are already open */
    RT_SECCOMP = 8,       /* only the few system calls that it needs; any other kills it */
    RT_NOT_DUMPABLE = 16, /* no core dump, no ptrace and no /proc/PID/mem except for root */
    RT_LOCKED_MEMORY = 32, /* nothing is swapped out */
    RT_SECRET_MEMORY = 64  /* the keys are in memory that the kernel does not map (memfd_secret) */
};

/* Memory for keys; `*measures` says whether it is secret and locked. NULL if there is none. */
void *rt_key_memory(uint32_t size, uint32_t *measures);

/* Apply every possible measure; user 0 keeps the present one. Call it after everything is open. */
uint32_t rt_isolate(uint32_t user, uint32_t group);

/* Whether another user than ours connected this socket. */
int rt_is_anothers(int connection);

/* From now on the kernel kills this process when the thread that started it ends, even if it hangs or is stopped. Call it after
   rt_isolate, because a change of user undoes it. False if `parent`, its parent at the start, is gone already. */
int rt_end_with(int parent);

#endif
