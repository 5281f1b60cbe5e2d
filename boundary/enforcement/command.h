/* One bounded manoeuvre from the bundle: `Command` of onboard/ports.py. It only exists with a permit. */
#ifndef RT_ENFORCEMENT_COMMAND_H
#define RT_ENFORCEMENT_COMMAND_H

#include "model/flat.h"

/* A command to payload that a step sends while it flies: `PayloadFrame` of onboard/ports.py. `numbers` are the bits of its parameters;
   if `has_height`, the last is `height` (mm above home) in metres above what the autopilot expects. */
typedef struct {
    uint32_t numbers[7];
    uint16_t command;
    uint8_t addressee;
    bool has_height;
    int64_t height, most, interval_us;
} rt_payload_frame;

/* `path` is x0, y0, ... in local mm. If `has_place`, it is the single point `place`. Altitude mm above home, speed mm/s. `heights` and
   `headings` have one for each point, or are empty. */
typedef struct {
    uint64_t token;
    int64_t kind, altitude, speed;
    rt_list path, heights, headings;
    bool has_place;
    int64_t place[2];
    rt_projection projection;
    rt_payload_frame payload[RT_MAX_EMISSIONS];
    uint32_t payload_count;
    rt_list servos; /* the free servo outputs of the vehicle */
} rt_command;

/* A local place in 1e-7 degree: `unproject` of model/flat/zone.py. */
void rt_unproject(const rt_projection *projection, int64_t x, int64_t y, int64_t *latitude, int64_t *longitude);

/* The longitude relative to another one, at most 180 degrees: `meridian` of model/flat/zone.py, minus the other. */
int64_t rt_east_of(int64_t longitude, int64_t other);

/* A point of the path: 1e-7 degree, mm above home, and the heading of the nose in 1/100 degree, or RT_ALONG. */
typedef struct {
    int64_t latitude, longitude, height, heading;
} rt_waypoint;

/* The points of a path in order: `rt_next_waypoint` takes the first that is left. */
typedef struct {
    rt_list path, heights, headings;
    bool has_place;
} rt_way;

rt_way rt_way_of(const rt_command *command);
bool rt_next_waypoint(const rt_command *command, rt_way *way, rt_waypoint *point);
/* The point of this number; false if there is none. */
bool rt_waypoint_at(const rt_command *command, int64_t number, rt_waypoint *point);

#endif
