#include "parts.h"

/* A vehicle starts the way home this far below its return altitude, mm; within NEAR, or within a third of the height, the return may be
   lower. */
#define SHORT 2000
#define NEAR 10000
#define STEEP 3

static void plan(const rt_policy *policy, const rt_motion *motion, int64_t altitude, rt_planner *planner) {
    planner->has_altitude = motion->kind == RT_HOME || motion->altitude != -1;
    planner->altitude = motion->kind == RT_HOME ? policy->vehicle.return_altitude : altitude;
    planner->along = NULL;
    planner->first = planner->low = planner->high = planner->altitude;
    if (planner->kind == RT_HOME) {
        planner->x = planner->y = 0;
        planner->points = 1;
    }
    planner->farthest = planner->points ? planner->x * planner->x + planner->y * planner->y : 0;
}

void rt_plan_link(const rt_policy *policy, const rt_link *link, rt_planner *planner) {
    const rt_contract *contract = &policy->contracts[link->skill];
    const rt_motion *motion = &contract->motion;
    *planner = (rt_planner){.kind = motion->kind};
    if (motion->kind == RT_FLY) {
        uint32_t cell = (uint32_t)rt_first_cell(contract, RT_PLACE);
        planner->x = rt_int_at(link->arguments, cell);
        planner->y = rt_int_at(link->arguments, cell + 1);
        planner->points = 1;
    }
    plan(policy, motion, motion->altitude == -1 ? 0 : rt_int_at(link->arguments, (uint32_t)motion->altitude), planner);
}

void rt_plan_step(const rt_policy *policy, const rt_invocation *invocation, rt_planner *planner) {
    rt_list path = invocation->plan.path;
    int64_t x, y;
    *planner = (rt_planner){.kind = invocation->plan.kind, .points = path.count / 2, .path = path};
    if (rt_next_int(&path, &planner->x)) rt_next_int(&path, &planner->y);
    plan(policy, &invocation->contract.motion, invocation->plan.altitude, planner);
    rt_list heights = planner->heights = invocation->plan.heights;
    if (rt_next_int(&heights, &planner->first)) planner->low = planner->high = planner->first;
    while (rt_next_int(&heights, &x)) {
        planner->low = rt_min(planner->low, x);
        planner->high = rt_max(planner->high, x);
    }
    while (rt_next_int(&path, &x) && rt_next_int(&path, &y)) planner->farthest = rt_max(planner->farthest, x * x + y * y);
}

rt_volume rt_here(const rt_situation *situation) {
    const rt_vehicle *vehicle = &situation->policy->policy->vehicle;
    bool positioned = vehicle->position != -1;
    rt_value x = rt_slot(situation, vehicle->position), y = rt_slot(situation, positioned ? vehicle->position + 1 : -1);
    rt_value height = rt_slot(situation, vehicle->height);
    return (rt_volume){NULL, x.value, y.value, 0, x.known && y.known, height.known, false, 0, height.value, height.value, height.value, height.value};
}

/* The least height at which a return flies home: `across`. Near home it may climb less, or not at all. */
static int64_t across(const rt_vehicle *vehicle, const rt_volume *volume) {
    int64_t returns = vehicle->return_altitude, cone = rt_max(NEAR, (returns + STEEP - 1) / STEEP);
    bool near_home = rt_farthest(volume) <= cone + vehicle->home_within + vehicle->position_error;
    return near_home || returns == 0 ? volume->low : rt_max(volume->low, returns - SHORT);
}

rt_volume rt_plan_volume(const rt_situation *situation, const rt_planner *planner) {
    rt_volume volume = rt_here(situation);
    volume.error = situation->policy->policy->vehicle.position_error;
    if (planner == NULL) return volume;
    volume.planner = planner;
    if (planner->kind == RT_HOME) {
        if (planner->altitude) volume.high = rt_max(volume.high, planner->altitude);
        volume.leg_low = across(&situation->policy->policy->vehicle, &volume);
        volume.start_low = volume.low;
        volume.climbs = volume.leg_low != volume.start_low;
        volume.low = rt_min(volume.low, 0); /* there, it descends */
        volume.leg_high = volume.high;
        return volume;
    }
    if (planner->kind == RT_LAND) {
        volume.low = rt_min(volume.low, 0);
    } else if (planner->has_altitude) {
        volume.low = rt_min(volume.low, planner->first);
        volume.high = rt_max(volume.high, planner->first);
    }
    volume.leg_low = volume.low;
    volume.leg_high = volume.high;
    if (planner->heights.count > 0) {
        volume.low = rt_min(volume.low, planner->low);
        volume.high = rt_max(volume.high, planner->high);
    }
    return volume;
}

/* Places are within RT_MAX_COORDINATE, hence squares within 2**59. */
int64_t rt_farthest(const rt_volume *volume) {
    int64_t square = volume->x * volume->x + volume->y * volume->y;
    return rt_root_up(volume->planner ? rt_max(square, volume->planner->farthest) : square);
}
