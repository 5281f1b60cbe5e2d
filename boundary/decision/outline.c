/* The edges of zones that are no circles, by horizontal bands: each edge is kept once for each band that it runs through, and
   there are fewer bands where that would be more than RT_REPEATS times the number of edges. Both questions (is a place inside, is
   a way clear of all edges?) look at few edges then. Edges that all run through nearly all heights are all looked at: 65,536 of
   them take a place about 0.2 ms. Slabs (outline.py) would take more tables than that is worth. */
#include "parts.h"

#define RT_FEW_EDGES 16

static int64_t band_of(const rt_prepared_zone *zone, int64_t y) {
    return rt_floor(y - zone->south, zone->height);
}

static uint32_t first_band(const rt_prepared_zone *zone, const rt_edge *edge) {
    return (uint32_t)band_of(zone, rt_min(edge->y0, edge->y1));
}

static uint32_t last_band(const rt_prepared_zone *zone, const rt_edge *edge) {
    return (uint32_t)band_of(zone, rt_max(edge->y0, edge->y1));
}

/* Build the bands of a zone from its edges; `entries` and `starts` are the numbers in use, of all zones. */
void rt_prepare_zone(rt_prepared_policy *prepared, uint32_t number, uint32_t *entries, uint32_t *starts) {
    rt_prepared_zone *zone = &prepared->zones[number];
    const rt_edge *edges = &prepared->edges[zone->first];
    int64_t north = edges[0].y0;
    zone->south = north;
    for (uint32_t at = 0; at < zone->count; at++) {
        zone->south = rt_min(zone->south, edges[at].y0);
        north = rt_max(north, edges[at].y0);
    }
    zone->bands = zone->count <= RT_FEW_EDGES ? 2 : 2 * (uint32_t)rt_root(zone->count);
    uint64_t total;
    do {
        zone->bands /= 2;
        zone->height = (north - zone->south) / zone->bands + 1;
        total = 0;
        for (uint32_t at = 0; at < zone->count; at++) total += last_band(zone, &edges[at]) - first_band(zone, &edges[at]) + 1;
    } while (total > (uint64_t)RT_REPEATS * zone->count);
    /* count, sum up, and fill from the end: then each start is the beginning of its band */
    uint32_t *start = &prepared->starts[*starts];
    zone->starts = *starts;
    *starts += zone->bands + 1;
    memset(start, 0, (zone->bands + 1) * sizeof *start);
    for (uint32_t at = 0; at < zone->count; at++)
        for (uint32_t band = first_band(zone, &edges[at]); band <= last_band(zone, &edges[at]); band++) start[band]++;
    for (uint32_t band = 0; band < zone->bands; band++) start[band] = *entries += start[band];
    start[zone->bands] = *entries;
    for (uint32_t at = 0; at < zone->count; at++)
        for (uint32_t band = first_band(zone, &edges[at]); band <= last_band(zone, &edges[at]); band++)
            prepared->entries[--start[band]] = (uint16_t)at;
}

static bool in_rings(const rt_prepared_policy *policy, const rt_prepared_zone *zone, int64_t x, int64_t y) {
    int64_t band = band_of(zone, y);
    bool inside = false;
    if (!rt_within(band, 0, zone->bands - 1)) return false;
    const uint32_t start = RT_AT(policy->starts, zone->starts + (uint32_t)band), end = RT_AT(policy->starts, zone->starts + (uint32_t)band + 1);
    for (uint32_t at = start; at < end; at++) {
        const rt_edge *edge = &RT_AT(policy->edges, zone->first + RT_AT(policy->entries, at));
        bool up = edge->y0 < edge->y1;
        int64_t x0 = up ? edge->x0 : edge->x1, y0 = up ? edge->y0 : edge->y1, x1 = up ? edge->x1 : edge->x0,
                y1 = up ? edge->y1 : edge->y0;
        if (y < y0 || y > y1) continue;
        int64_t side = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0);
        if (side == 0 && rt_within(x, rt_min(x0, x1), rt_max(x0, x1))) return false; /* an edge is outside */
        inside ^= y < y1 && side < 0;
    }
    return inside;
}

/* Whether a line in the direction (x, y) separates an edge from a leg that is widened by `error` on all sides. */
static bool parted(int64_t x, int64_t y, const rt_edge *edge, int64_t x0, int64_t y0, int64_t x1, int64_t y1, int64_t error) {
    int64_t a = x * edge->y0 - y * edge->x0, b = x * edge->y1 - y * edge->x1, c = x * y0 - y * x0, d = x * y1 - y * x1;
    int64_t reach = (rt_abs(x) + rt_abs(y)) * error;
    return rt_max(a, b) < rt_min(c, d) - reach || rt_min(a, b) > rt_max(c, d) + reach;
}

uint32_t rt_zone_compared(const rt_prepared_policy *policy, uint32_t number, int64_t y0, int64_t y1, int64_t error) {
    const rt_prepared_zone *zone = &RT_AT(policy->zones, number);
    if (zone->count == 0) return 0;
    int64_t first = rt_max(band_of(zone, rt_min(y0, y1) - error), 0), last = rt_min(band_of(zone, rt_max(y0, y1) + error), zone->bands - 1);
    if (first > last) return 0;
    return RT_AT(policy->starts, zone->starts + (uint32_t)last + 1) - RT_AT(policy->starts, zone->starts + (uint32_t)first);
}

static bool clear_of_rings(const rt_prepared_policy *policy, const rt_prepared_zone *zone, int64_t x0, int64_t y0, int64_t x1,
                           int64_t y1, int64_t error) {
    int64_t west = rt_min(x0, x1) - error, east = rt_max(x0, x1) + error, south = rt_min(y0, y1) - error,
            north = rt_max(y0, y1) + error;
    int64_t first = rt_max(band_of(zone, south), 0), last = rt_min(band_of(zone, north), zone->bands - 1);
    if (first > last) return true;
    const uint32_t start = RT_AT(policy->starts, zone->starts + (uint32_t)first), end = RT_AT(policy->starts, zone->starts + (uint32_t)last + 1);
    for (uint32_t at = start; at < end; at++) { /* an edge that spans several bands appears once in each */
        const rt_edge *edge = &RT_AT(policy->edges, zone->first + RT_AT(policy->entries, at));
        if (rt_max(edge->x0, edge->x1) < west || rt_min(edge->x0, edge->x1) > east) continue;
        if (rt_max(edge->y0, edge->y1) < south || rt_min(edge->y0, edge->y1) > north) continue;
        if (!parted(x1 - x0, y1 - y0, edge, x0, y0, x1, y1, error) &&
            !parted(edge->x1 - edge->x0, edge->y1 - edge->y0, edge, x0, y0, x1, y1, error))
            return false;
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------------------------ circles */

/* Whether a place, widened by `error`, is inside a circle: its corner farthest from the centre is. */
static bool in_circle(const rt_prepared_zone *zone, int64_t x, int64_t y, int64_t error) {
    int64_t dx = rt_abs(x - zone->x) + error, dy = rt_abs(y - zone->y) + error;
    return dx * dx + dy * dy < zone->square;
}

/* Whether a leg stays farther than `radius` from the centre; its length is rounded up, for safety. */
static bool outside_circle(const rt_prepared_zone *zone, int64_t x0, int64_t y0, int64_t x1, int64_t y1, int64_t radius) {
    int64_t ux = x1 - x0, uy = y1 - y0, vx = zone->x - x0, vy = zone->y - y0, wx = zone->x - x1, wy = zone->y - y1;
    int64_t along = ux * vx + uy * vy, square = ux * ux + uy * uy;
    if (along <= 0) return vx * vx + vy * vy > radius * radius;
    if (along >= square) return wx * wx + wy * wy > radius * radius;
    return rt_abs(ux * vy - uy * vx) > radius * ((int64_t)rt_root((uint64_t)square) + 1);
}

/* ------------------------------------------------------------------------------------------------------------------ all shapes */

/* Bounds: where x or y is further than 2**30 from home it is outside of every zone. Else differences are within 2**31, products
   with those of an edge's ends (2**30) within 2**61, squares of a circle within 2**62 and their sum below 2**63. */
bool rt_zone_contains(const rt_prepared_policy *policy, uint32_t number, int64_t x, int64_t y) {
    const int64_t most = 2 * RT_MAX_COORDINATE;
    if (x < -most || x > most || y < -most || y > most) return false;
    const rt_prepared_zone *zone = &RT_AT(policy->zones, number);
    return zone->count ? in_rings(policy, zone, x, y) : in_circle(zone, x, y, 0);
}

/* Whether a leg, widened by `error`, is completely inside or completely outside. Its ends are within RT_MAX_COORDINATE, so that
   differences are within 2**30, cross products within 2**61 and their sums with the error's within 2**62. */
bool rt_zone_clear(const rt_prepared_policy *policy, uint32_t number, int64_t x0, int64_t y0, int64_t x1, int64_t y1,
                   int64_t error) {
    const rt_prepared_zone *zone = &RT_AT(policy->zones, number);
    if (zone->count) return clear_of_rings(policy, zone, x0, y0, x1, y1, error);
    if (in_circle(zone, x0, y0, error) && in_circle(zone, x1, y1, error)) return true; /* a disc is convex */
    int64_t diagonal = rt_min(rt_root((uint64_t)(2 * error * error)), 2 * error); /* which it does not reach */
    return outside_circle(zone, x0, y0, x1, y1, zone->radius + diagonal + 1);
}
