/* Which frames may be sent without a permit, and which carry out the permitted command. `allow_list.py`. */
#ifndef RT_ENFORCEMENT_ALLOW_LIST_H
#define RT_ENFORCEMENT_ALLOW_LIST_H

#include "command.h"
#include "mavlink/framing.h"

#define RT_NAME_OCTETS 16
#define RT_DATUM_MOVES 2000 /* mm */

typedef struct {
    int64_t latitude, longitude; /* 1e-7 degree */
} rt_point;

/* A parameter and the 32 bits of its value; `is_number` is false for a value that is not a number. The name is padded with NULs. */
typedef struct {
    uint8_t name[RT_NAME_OCTETS];
    uint32_t value;
    bool is_number;
} rt_setting;

bool rt_is_housekeeping(const rt_frame *frame);
/* Whether it requests one report of a camera that is a component of its own. */
bool rt_asks_camera(const rt_frame *frame);
bool rt_is_greeting(const rt_frame *frame);
/* `types` are the bits of the last received FENCE_TYPE, if `types_known`. */
bool rt_is_of_fence(const rt_frame *frame, bool types_known, uint32_t types);
/* The parameter of a PARAM_SET or a PARAM_VALUE; false for another message. */
bool rt_setting_of(const rt_frame *frame, bool bytewise, rt_setting *setting);
bool rt_is_forced_arming(const rt_frame *frame);
/* `home_amsl`, mm, is valid if `home_known`. */
bool rt_carries_out(const rt_frame *frame, const rt_command *command, uint8_t autopilot, bool home_known, int64_t home_amsl);
/* The target of a frame that carries out a command; false if the vehicle stays where it is. */
bool rt_point_of(const rt_frame *frame, rt_point *point);
bool rt_is_near(rt_point here, rt_point point);
/* Whether place, height and heading in a frame that carries out a command are those of this point. */
bool rt_leads_to(const rt_frame *frame, const rt_waypoint *point, bool home_known, int64_t home_amsl);

#endif
