#include "parts.h"

uint32_t rt_cells(const rt_contract *contract) {
    rt_list left = contract->parameters;
    rt_parameter parameter;
    uint32_t cells = 0;
    while (rt_next_parameter(&left, &parameter)) cells += parameter.kind == RT_PLACE ? 2 : 1;
    return cells;
}

/* Whether every argument is in its parameter's range; a place is only bounded by the range of coordinates. The number of arguments is
   right. */
bool rt_fits(rt_list arguments, const rt_contract *contract) {
    rt_list left = contract->parameters;
    rt_parameter parameter;
    int64_t value;
    while (rt_next_parameter(&left, &parameter)) {
        bool place = parameter.kind == RT_PLACE;
        for (int cell = 0; cell < (place ? 2 : 1) && rt_next_int(&arguments, &value); cell++)
            if (!(place ? rt_within(value, -RT_MAX_COORDINATE, RT_MAX_COORDINATE)
                        : rt_within(value, parameter.low, parameter.high)))
                return false;
    }
    return true;
}

int64_t rt_first_cell(const rt_contract *contract, int64_t kind) {
    rt_list left = contract->parameters;
    rt_parameter parameter;
    while (rt_next_parameter(&left, &parameter))
        if (parameter.kind == kind) return parameter.cell;
    return -1;
}

int64_t rt_longest(const rt_contract *contract, const rt_vehicle *vehicle, int64_t limit_us) {
    return limit_us ? limit_us : contract->duration_us ? contract->duration_us : vehicle->endurance_us;
}

/* Whether the battery holds the charge to finish, to return and the reserve. */
rt_truth rt_charge_suffices(const rt_contract *contract, const rt_vehicle *vehicle, int64_t asked, rt_value battery,
                            rt_value drain, const rt_volume *volume) {
    bool stays = contract->motion.kind != RT_HOME && contract->motion.kind != RT_LAND;
    if (!battery.known || (stays && (!volume->located || (vehicle->has_speeds && !volume->level)))) return RT_UNKNOWN;
    int64_t left = battery.value - contract->energy - (stays ? vehicle->reserve : 0);
    int64_t taken = drain.known ? drain.value : 0;
    bool enough = stays ? rt_brings_home(vehicle, left, rt_farthest(volume), volume->low, volume->high, asked, taken) : left >= 0;
    return enough ? RT_TRUE : RT_FALSE;
}
