/* Made by .make/limits from rtshcua/model/flat, rtshcua/wire and rtshcua/onboard: what fits on board, how far clocks may be
   off. A home with little memory defines smaller ones before (home/trustzone_m/limits.h). */
#ifndef RT_MODEL_LIMITS_H
#define RT_MODEL_LIMITS_H

#define RT_MAX_VALUE 9007199254740991LL
#define RT_MAX_MAGNITUDE 4611686018427387904LL
#define RT_MAX_SPEED 1048576
#define RT_MAX_DURATION 4398046511104LL
#define RT_FULL 10000
#define RT_DAY 86400000000LL
#define RT_WEEK 604800000000LL
#define RT_MAX_OFFSETS 256
#define RT_MAX_SLOTS 72
#define RT_MAX_SILENCE 3600000000LL
#define RT_MAX_STALE 4294967294LL
#ifndef RT_MAX_ROLES
#define RT_MAX_ROLES 64
#endif
#ifndef RT_MAX_ZONES
#define RT_MAX_ZONES 4096
#endif
#ifndef RT_MAX_TOTAL_VERTICES
#define RT_MAX_TOTAL_VERTICES 65536
#endif
#ifndef RT_MAX_TABLES
#define RT_MAX_TABLES 256
#endif
#ifndef RT_MAX_SETS
#define RT_MAX_SETS 4096
#endif
#define RT_MAX_MEMBERS 4096
#ifndef RT_MAX_CONTRACTS
#define RT_MAX_CONTRACTS 256
#endif
#define RT_MAX_PARAMETERS 32
#define RT_MAX_CELLS 64
#define RT_MAX_CLAUSES 64
#define RT_MAX_TEXT 400
#define RT_MAX_LINKS 8
#ifndef RT_MAX_RULES
#define RT_MAX_RULES 16384
#endif
#define RT_MAX_RULE_KEYS 262144
#ifndef RT_MAX_INVOCATIONS
#define RT_MAX_INVOCATIONS 16384
#endif
#define RT_MAX_PHASES 64
#define RT_MAX_PATH 8192
#define RT_MAX_COMPARED 8388608
#define RT_MAX_MONITORS 32
#define RT_MAX_WINDOW 600000000
#define RT_MAX_GAP 1000000
#define RT_MAX_PHASE_NAMES 64
#ifndef RT_MAX_KEYS
#define RT_MAX_KEYS 512
#endif
#define RT_MAX_REVOKED 4096
#ifndef RT_MAX_ANSWERS
#define RT_MAX_ANSWERS 4096
#endif
#ifndef RT_MAX_DISPATCHED
#define RT_MAX_DISPATCHED 65536
#endif
#define RT_MAX_STACK 16
#define RT_MAX_INSTRUCTIONS 128
#define RT_APART_US 2000000
#define RT_DRIFT_US 500
#define RT_UNIX_US 1000000000000000LL
#define RT_ARDUPILOT_US 1001000
#define RT_VEHICLE_US 6001000
#define RT_UTC_UNKNOWN_US 4503599627370496LL
#define RT_MAX_VERTICES 4096
#define RT_MAX_RINGS 1024
#ifndef RT_MAX_BUNDLE
#define RT_MAX_BUNDLE 16777216
#endif
#ifndef RT_MAX_DOCUMENT
#define RT_MAX_DOCUMENT 262144
#endif
#ifndef RT_MAX_ROOT
#define RT_MAX_ROOT 1048576
#endif
#ifndef RT_MAX_REPLACEMENTS
#define RT_MAX_REPLACEMENTS 256
#endif
#ifndef RT_MAX_PART
#define RT_MAX_PART 60000
#endif
#ifndef RT_MOST_AHEAD
#define RT_MOST_AHEAD 128
#endif
#ifndef RT_MOST_OPENED
#define RT_MOST_OPENED 4094
#endif
#ifndef RT_MOST_POLICIES
#define RT_MOST_POLICIES 256
#endif

#endif
