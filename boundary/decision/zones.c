#include "parts.h"

rt_truth rt_zone_along(const rt_prepared_policy *policy, uint32_t zone, rt_list path, int64_t error) {
    int64_t x = 0, y = 0, to_x, to_y;
    rt_next_int(&path, &x);
    rt_next_int(&path, &y);
    rt_truth truth = rt_zone_contains(policy, zone, x, y) ? RT_TRUE : RT_FALSE;
    if (path.count == 0) return error == 0 || rt_zone_clear(policy, zone, x, y, x, y, error) ? truth : RT_MIXED;
    while (rt_next_int(&path, &to_x) && rt_next_int(&path, &to_y)) {
        if (!rt_zone_clear(policy, zone, x, y, to_x, to_y, error)) return RT_MIXED;
        x = to_x;
        y = to_y;
    }
    return truth;
}

/* The same for the leg to a planner's path. */
static rt_truth along_leg(const rt_prepared_policy *policy, uint32_t zone, const rt_volume *volume) {
    bool leads = volume->planner && volume->planner->points;
    int64_t x = volume->x, y = volume->y, to_x = leads ? volume->planner->x : x, to_y = leads ? volume->planner->y : y;
    if ((leads || volume->error) && !rt_zone_clear(policy, zone, x, y, to_x, to_y, volume->error)) return RT_MIXED;
    return rt_zone_contains(policy, zone, x, y) ? RT_TRUE : RT_FALSE;
}

/* The same for the path; cached, because it depends on nothing else. */
static rt_truth along_path(const rt_prepared_policy *policy, uint32_t zone, const rt_volume *volume) {
    const rt_planner *planner = volume->planner;
    rt_truth truth;
    uint8_t *known = planner->along ? &planner->along[zone % RT_MAX_ZONES] : NULL;
    if (known && *known) return *known;
    if (planner->points > 1) {
        truth = rt_zone_along(policy, zone, planner->path, volume->error);
    } else {
        rt_volume end = *volume;
        end.planner = NULL;
        end.x = planner->x;
        end.y = planner->y;
        truth = along_leg(policy, zone, &end);
    }
    if (known) *known = (uint8_t)truth;
    return truth;
}

/* Whether the heights low..high lie between floor and ceiling. A zone with neither does not read the height. */
static rt_truth between(const rt_zone *zone, int64_t low, int64_t high, bool known) {
    if (zone->floor == RT_LOWEST && zone->ceiling == RT_HIGHEST) return RT_TRUE;
    if (!known) return RT_UNKNOWN;
    if (low > zone->floor && high < zone->ceiling) return RT_TRUE;
    return high <= zone->floor || low >= zone->ceiling ? RT_FALSE : RT_MIXED;
}

/* Whether the legs of a path whose points have heights of their own are inside: each is at the heights between those of its ends. */
static rt_truth along_levels(const rt_prepared_policy *policy, uint32_t number, const rt_volume *volume) {
    const rt_planner *planner = volume->planner;
    const rt_zone *zone = &RT_AT(policy->policy->zones, number);
    uint8_t *known = planner->along && volume->level && volume->located ? &planner->along[number % RT_MAX_ZONES] : NULL;
    if (known && *known) return *known;
    rt_list path = planner->path, heights = planner->heights;
    rt_volume leg = {.error = volume->error};
    int64_t height = 0, to_height;
    rt_truth truth = 0;
    rt_next_int(&path, &leg.x);
    rt_next_int(&path, &leg.y);
    rt_next_int(&heights, &height);
    do {
        rt_planner to = {.points = 1, .x = leg.x, .y = leg.y};
        bool leads = rt_next_int(&path, &to.x) && rt_next_int(&path, &to.y); /* not from the only point of a path */
        to_height = height;
        rt_next_int(&heights, &to_height);
        leg.planner = leads ? &to : NULL;
        rt_truth vertical = between(zone, rt_min(height, to_height), rt_max(height, to_height), volume->level);
        if (vertical == RT_FALSE) truth |= RT_FALSE;
        else truth |= rt_and(vertical, volume->located ? along_leg(policy, number, &leg) : RT_UNKNOWN);
        leg.x = to.x;
        leg.y = to.y;
        height = to_height;
    } while (path.count > 0);
    if (known) *known = (uint8_t)truth;
    return truth;
}

rt_truth rt_zone_holds(const rt_situation *situation, uint32_t number, const rt_volume *volume, int64_t through_us) {
    const rt_prepared_policy *policy = situation->policy;
    const rt_zone *zone = &RT_AT(policy->policy->zones, number);
    rt_truth truth = 0, vertical = between(zone, volume->leg_low, volume->leg_high, volume->level);
    if (vertical == RT_FALSE) truth = RT_FALSE;
    else truth = rt_and(vertical, volume->located ? along_leg(policy, number, volume) : RT_UNKNOWN);
    if (volume->climbs) {
        rt_volume start = *volume;
        start.planner = NULL;
        vertical = between(zone, volume->start_low, volume->high, volume->level);
        if (vertical == RT_FALSE) truth |= RT_FALSE;
        else truth |= rt_and(vertical, volume->located ? along_leg(policy, number, &start) : RT_UNKNOWN);
    }
    if (volume->planner && volume->planner->heights.count > 0) {
        truth |= along_levels(policy, number, volume);
    } else if (volume->planner && volume->planner->points) {
        vertical = between(zone, volume->low, volume->high, volume->level);
        if (vertical == RT_FALSE) truth |= RT_FALSE;
        else truth |= rt_and(vertical, volume->located ? along_path(policy, number, volume) : RT_UNKNOWN);
    }
    if (!rt_zone_timed(zone)) return truth;
    int64_t utc = situation->utc_us;
    return rt_and(truth, rt_zone_exists(&policy->policy->vehicle, zone, utc, utc + through_us, situation->error_us));
}

rt_truth rt_airspace_keeps(const rt_situation *situation, const rt_volume *volume, int64_t through_us) {
    const rt_airspace *airspace = &situation->policy->policy->airspace;
    rt_list inside = airspace->inside, outside = airspace->outside;
    rt_truth truth = RT_TRUE;
    int64_t zone;
    while (rt_next_int(&inside, &zone)) truth = rt_and(truth, rt_zone_holds(situation, (uint32_t)zone, volume, through_us));
    while (rt_next_int(&outside, &zone))
        truth = rt_and(truth, rt_not(rt_zone_holds(situation, (uint32_t)zone, volume, through_us)));
    return truth;
}
