/* Definitions of the programs in proof/: values of which only the range is known. */
#ifndef RT_PROOF_ANY_H
#define RT_PROOF_ANY_H

#include "__fc_builtin.h"
#include "base.h"
#include "model/limits.h"

#define ANY(thing) Frama_C_make_unknown((char *)&(thing), sizeof(thing))
#define WITHIN(low, high) Frama_C_long_interval(low, high)
#define SIZE(most) ((uint32_t)Frama_C_unsigned_int_interval(0, most))
#define EITHER() (Frama_C_interval(0, 1) != 0)

/* The first item of a table, standing for all of it. */
static void fill(void *table, size_t size, size_t whole) {
    //@ loop unroll 20;
    for (; 2 * size <= whole; size *= 2) memcpy((char *)table + size, table, size);
}
#define FILL(table) fill(table, sizeof *(table), sizeof(table))

#endif
