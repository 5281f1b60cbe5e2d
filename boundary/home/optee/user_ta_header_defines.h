/* What OP-TEE's kit compiles into the header of the trusted application. */
#ifndef RT_USER_TA_HEADER_DEFINES_H
#define RT_USER_TA_HEADER_DEFINES_H

#include "application.h"

/* one instance and one session: a second one is refused as busy */
#define TA_FLAGS TA_FLAG_SINGLE_INSTANCE
#define TA_STACK_SIZE (48 * 1024)
#define TA_DATA_SIZE (16 * 1024) /* heap: of the library of OP-TEE alone, the core has none */
#define TA_VERSION "1"
#define TA_DESCRIPTION "enforcement boundary"

#endif
