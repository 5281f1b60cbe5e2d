#include "command.h"

int64_t rt_east_of(int64_t longitude, int64_t other) {
    return rt_modulo(longitude - other + RT_HALF_TURN, RT_TURN) - RT_HALF_TURN;
}

void rt_unproject(const rt_projection *projection, int64_t x, int64_t y, int64_t *latitude, int64_t *longitude) {
    /* |x| <= 2**29, so that x << 20 has 50 bits; a projection's factors are checked to lie in 1 .. 32 << 20 */
    int64_t east = projection->east, north = projection->north;
    *latitude = projection->latitude + rt_floor(y * (1LL << RT_SHIFT) + north / 2, north);
    *longitude = projection->longitude + rt_floor(x * (1LL << RT_SHIFT) + east / 2, east);
    if (*longitude < -RT_HALF_TURN || *longitude > RT_HALF_TURN)
        *longitude = rt_east_of(*longitude, 0);
}

rt_way rt_way_of(const rt_command *command) {
    return (rt_way){command->path, command->heights, command->headings, command->has_place};
}

bool rt_next_waypoint(const rt_command *command, rt_way *way, rt_waypoint *point) {
    int64_t x = command->place[0], y = command->place[1];
    if (!way->has_place && (!rt_next_int(&way->path, &x) || !rt_next_int(&way->path, &y)))
        return false;
    if (way->has_place)
        way->path.count = 0;
    way->has_place = false;
    point->height = command->altitude;
    point->heading = RT_ALONG;
    rt_next_int(&way->heights, &point->height);
    rt_next_int(&way->headings, &point->heading);
    rt_unproject(&command->projection, x, y, &point->latitude, &point->longitude);
    return true;
}

bool rt_waypoint_at(const rt_command *command, int64_t number, rt_waypoint *point) {
    rt_way way = rt_way_of(command);
    bool found = false;
    for (int64_t at = 0; at <= number; at++)
        if (!(found = rt_next_waypoint(command, &way, point)))
            break;
    return found;
}
