/* Readers of the flat form for other artefacts. */
#ifndef RT_WIRE_FLAT_H
#define RT_WIRE_FLAT_H

#include "../model/flat.h"
#include "cbor.h"

/* A mission that is the next item; `payload` is what was signed. */
bool rt_take_mission(rt_cursor *cursor, rt_bytes payload, rt_mission *mission);

bool rt_take_ints(rt_cursor *cursor, rt_list *list);
bool rt_take_texts(rt_cursor *cursor, rt_list *list);
bool rt_take_octet_strings(rt_cursor *cursor, rt_list *list);

#endif
