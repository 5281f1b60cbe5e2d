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

bool rt_point_at(const rt_command *command, int64_t number, int64_t *latitude, int64_t *longitude) {
    int64_t x = command->place[0], y = command->place[1];
    if (number < 0 || number >= (command->has_place ? 1 : (int64_t)command->path.count / 2))
        return false;
    if (!command->has_place) {
        rt_list left = command->path;
        for (int64_t at = 0; at <= number; at++) {
            rt_next_int(&left, &x);
            rt_next_int(&left, &y);
        }
    }
    rt_unproject(&command->projection, x, y, latitude, longitude);
    return true;
}
