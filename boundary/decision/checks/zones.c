/* Zones, tables of derived zones, and the projection; and the rings that bound an area: each simple, no two with a common point,
   outer ones counter-clockwise, holes clockwise.

   A line sweeps the plane from south to north, and the edges that it crosses are kept in order, in an array. Bisection finds a
   place in it, so comparisons grow as n log n; what lies behind is moved by memcpy, at most 128 KiB for a corner. 65,536 corners of which
   the line crosses all at once take about 0.3 s, a tenth of that in comparing them: the worst that a policy can hold. */
#include "../parts.h"

#define RT_MAX_FACTOR (32LL << RT_SHIFT) /* 1e-7 degree is about 11 mm at the equator */

/* Corners and edges of one zone by number: edge n leads from corner n to the next of its ring. */
typedef struct {
    const rt_edge *edges;
    rt_scratch *scratch;
    uint32_t crossed; /* the number of crossed edges, from west to east */
} sweep;

/* An edge from its southern end; from its western end if both have the same height. */
static rt_edge upward(const sweep *of, uint32_t number) {
    rt_edge e = of->edges[number];
    return e.y0 < e.y1 || (e.y0 == e.y1 && e.x0 < e.x1) ? e : (rt_edge){e.x1, e.y1, e.x0, e.y0};
}

/* Positive where an upward edge passes east of a place, negative where it passes west. */
static int64_t side(const rt_edge *edge, int64_t x, int64_t y) {
    return ((int64_t)edge->x1 - edge->x0) * (y - edge->y0) - ((int64_t)edge->y1 - edge->y0) * (x - edge->x0);
}

static bool apart(const rt_edge *a, const rt_edge *b) {
    int64_t start = side(a, b->x0, b->y0), end = side(a, b->x1, b->y1);
    return (start > 0 && end > 0) || (start < 0 && end < 0);
}

/* Whether a crossed edge and its neighbour share a point; a common end from which they lead apart does not count. */
static bool meets(const sweep *of, int64_t at) {
    if (!rt_within(at, 0, (int64_t)of->crossed - 2)) return false;
    rt_edge a = upward(of, of->scratch->crossed[at]), b = upward(of, of->scratch->crossed[at + 1]);
    if ((a.x0 == b.x0 && a.y0 == b.y0) || (a.x1 == b.x1 && a.y1 == b.y1))
        return side(&a, b.x0, b.y0) == 0 && side(&a, b.x1, b.y1) == 0;
    return !apart(&a, &b) && !apart(&b, &a);
}

/* The number of crossed edges west of a corner. */
static uint32_t place(const sweep *of, int64_t x, int64_t y) {
    uint32_t low = 0, high = of->crossed;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        rt_edge edge = upward(of, of->scratch->crossed[middle]);
        if (side(&edge, x, y) < 0) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* Move the crossed edges from `from` on to `at`. */
static void move(sweep *of, uint32_t from, uint32_t to) {
    uint16_t *crossed = of->scratch->crossed, *moved = of->scratch->moved;
    size_t size = (of->crossed - from) * sizeof *crossed;
    memcpy(moved, crossed + from, size);
    memcpy(crossed + to, moved, size);
    of->crossed = of->crossed - from + to;
}

/* Two edges begin at a corner. The area lies between them if an even number of edges is west of them: to the left of each. */
static bool begin(sweep *of, uint16_t incoming, uint16_t outgoing, int64_t x, int64_t y) {
    uint32_t at = place(of, x, y);
    rt_edge a = upward(of, incoming), b = upward(of, outgoing);
    int64_t turn = ((int64_t)a.x1 - a.x0) * ((int64_t)b.y1 - b.y0) - ((int64_t)a.y1 - a.y0) * ((int64_t)b.x1 - b.x0);
    if (turn == 0 || (turn < 0) != (at % 2 == 0)) return false;
    if (at < of->crossed) {
        rt_edge next = upward(of, of->scratch->crossed[at]);
        if (side(&next, x, y) == 0) return false;
    }
    move(of, at, at + 2);
    of->scratch->crossed[at] = turn < 0 ? incoming : outgoing;
    of->scratch->crossed[at + 1] = turn < 0 ? outgoing : incoming;
    return !meets(of, (int64_t)at - 1) && !meets(of, at + 1);
}

static bool go_on(sweep *of, uint16_t old, uint16_t new, int64_t x, int64_t y) {
    uint32_t at = place(of, x, y);
    if (at >= of->crossed || of->scratch->crossed[at] != old) return false;
    of->scratch->crossed[at] = new;
    return !meets(of, (int64_t)at - 1) && !meets(of, at);
}

static bool end(sweep *of, uint16_t one, uint16_t other, int64_t x, int64_t y) {
    uint32_t at = place(of, x, y);
    const uint16_t *crossed = of->scratch->crossed;
    if (at + 2 > of->crossed ||
        !((crossed[at] == one && crossed[at + 1] == other) || (crossed[at] == other && crossed[at + 1] == one)))
        return false;
    move(of, at + 2, at);
    return !meets(of, (int64_t)at - 1);
}

static bool further(const void *edges, uint16_t one, uint16_t other) {
    const rt_edge *a = (const rt_edge *)edges + one, *b = (const rt_edge *)edges + other;
    return a->y0 > b->y0 || (a->y0 == b->y0 && a->x0 > b->x0);
}

/* Whether the rings of a zone are well-formed; `before` is there: the edge that leads to each corner. */
static bool check_rings(const rt_edge *edges, uint32_t count, rt_scratch *scratch) {
    sweep of = {edges, scratch, 0};
    const rt_edge *last = NULL;
    for (uint32_t at = 0; at < count; at++) scratch->order[at] = (uint16_t)at;
    rt_sort(scratch->order, count, further, edges);
    for (uint32_t at = 0; at < count; at++) {
        uint16_t outgoing = scratch->order[at], incoming = scratch->before[outgoing];
        const rt_edge *corner = &edges[outgoing];
        int64_t x = corner->x0, y = corner->y0;
        if (last && last->x0 == x && last->y0 == y) return false;
        last = corner;
        rt_edge in = upward(&of, incoming), out = upward(&of, outgoing);
        bool in_begins = in.x0 == x && in.y0 == y, out_begins = out.x0 == x && out.y0 == y;
        bool good = in_begins && out_begins ? begin(&of, incoming, outgoing, x, y)
                    : out_begins            ? go_on(&of, incoming, outgoing, x, y)
                    : in_begins             ? go_on(&of, outgoing, incoming, x, y)
                                            : end(&of, incoming, outgoing, x, y);
        if (!good) return false;
    }
    return true;
}

/* ------------------------------------------------------------------------------------------------------------------ geometry */

static bool on_earth(int64_t latitude, int64_t longitude) {
    return rt_within(latitude, -900000000, 900000000) && rt_within(longitude, -RT_HALF_TURN, RT_HALF_TURN);
}

/* A local place that may be flown to must have a latitude and a longitude, within half around the earth. Coordinates are within 2**30,
   factors within 2**25, so that no value exceeds 2**56. */
bool rt_check_place(const rt_projection *projection, int64_t x, int64_t y) {
    int64_t east = projection->east, north = projection->north, one = 1 << RT_SHIFT;
    if (rt_abs(x) * one >= RT_HALF_TURN * east) return false;
    int64_t longitude = projection->longitude + rt_floor(x * one + east / 2, east);
    if (rt_abs(longitude) > RT_HALF_TURN) longitude = rt_modulo(longitude + RT_HALF_TURN, RT_TURN) - RT_HALF_TURN;
    return on_earth(projection->latitude + rt_floor(y * one + north / 2, north), longitude);
}

/* A lower bound of the number of vertices, computed before anything else about a zone is known. */
static int64_t vertices(const rt_zone *zone) {
    int64_t counts =
        zone->shape == RT_AREA && zone->data.count ? 1 + rt_min(rt_max(rt_int_at(zone->data, 0), 0), RT_MAX_RINGS) : 0;
    return rt_max(zone->data.count - counts, 0) / 2;
}

/* Take the corners of a ring off a list, as edges from `first` on; false for a coordinate out of range. */
static bool take_ring(rt_list *data, uint32_t count, rt_edge *edges, uint32_t first, rt_scratch *scratch) {
    for (uint32_t at = first; at < first + count; at++) {
        int64_t x = 0, y = 0;
        if (!rt_next_int(data, &x) || !rt_next_int(data, &y)) return false;
        if (!rt_within(x, -RT_MAX_COORDINATE, RT_MAX_COORDINATE) || !rt_within(y, -RT_MAX_COORDINATE, RT_MAX_COORDINATE))
            return false;
        uint32_t before = at == first ? first + count - 1 : at - 1;
        scratch->before[at] = (uint16_t)before;
        edges[at].x0 = edges[before].x1 = (int32_t)x;
        edges[at].y0 = edges[before].y1 = (int32_t)y;
    }
    return true;
}

/* Read the edges of a zone into the table after those of the others, if there is room; returns their number. */
static bool take_edges(const rt_zone *zone, rt_edge *edges, uint32_t room, uint32_t *count, rt_scratch *scratch) {
    rt_list data = zone->data, counts = zone->data;
    int64_t rings = 1, corners = data.count / 2;
    *count = 0;
    if (zone->shape == RT_POLYGON) {
        if (data.count % 2 || !rt_within(corners, 3, RT_MAX_VERTICES)) return false;
    } else if (!rt_next_int(&data, &rings) || !rt_within(rings, 1, RT_MAX_RINGS) || rings > data.count) {
        return false;
    } else {
        rt_next_int(&counts, &corners);
        for (int64_t ring = 0; ring < rings; ring++) rt_next_int(&data, &corners);
    }
    for (int64_t ring = 0; ring < rings; ring++) {
        if (zone->shape == RT_AREA) rt_next_int(&counts, &corners);
        if (!rt_within(corners, 3, (int64_t)room - *count) || !take_ring(&data, (uint32_t)corners, edges, *count, scratch))
            return false;
        *count += (uint32_t)corners;
    }
    return data.count == 0;
}

static bool check_times(const rt_zone *zone) {
    if ((zone->daily.count != 0 && zone->daily.count != 2) || (zone->dates.count != 0 && zone->dates.count != 2)) return false;
    if (zone->daily.count && zone->weekly.count) return false;
    if (zone->weekly.count && !rt_windows_fit(zone->weekly)) return false;
    if (zone->daily.count &&
        !(rt_within(rt_int_at(zone->daily, 0), 0, RT_DAY - 1) && rt_within(rt_int_at(zone->daily, 1), 0, RT_DAY)))
        return false;
    if (!zone->dates.count) return true;
    int64_t start = rt_int_at(zone->dates, 0), end_us = rt_int_at(zone->dates, 1);
    return start >= 0 && start <= end_us && end_us <= RT_MAX_VALUE;
}

static bool check_circle(const rt_zone *zone, rt_prepared_zone *prepared) {
    rt_list data = zone->data;
    if (data.count != 3) return false;
    rt_next_int(&data, &prepared->x);
    rt_next_int(&data, &prepared->y);
    rt_next_int(&data, &prepared->square);
    prepared->radius = rt_root_up(prepared->square);
    return rt_within(prepared->square, 1, RT_MAX_COORDINATE * RT_MAX_COORDINATE) &&
           rt_within(prepared->x, -RT_MAX_COORDINATE, RT_MAX_COORDINATE) &&
           rt_within(prepared->y, -RT_MAX_COORDINATE, RT_MAX_COORDINATE);
}

/* Whether the geometry of a policy is well-formed; also returns where the edges of each zone are. */
bool rt_check_zones(const rt_policy *policy, rt_prepared_policy *prepared) {
    const rt_projection *projection = &policy->projection;
    uint32_t first = 0, entries = 0, starts = 0;
    int64_t total = 0, entry;
    if (!on_earth(projection->latitude, projection->longitude) || !rt_within(projection->east, 1, RT_MAX_FACTOR) ||
        !rt_within(projection->north, 1, RT_MAX_FACTOR))
        return false;
    if (!rt_within(policy->declared, 0, policy->zone_count)) return false;
    for (uint32_t at = 0; at < policy->zone_count; at++) total += vertices(&policy->zones[at]);
    if (total > RT_MAX_TOTAL_VERTICES) return false;
    for (uint32_t at = 0; at < policy->zone_count; at++) {
        const rt_zone *zone = &policy->zones[at];
        rt_prepared_zone *made = &prepared->zones[at];
        *made = (rt_prepared_zone){.first = first};
        if (!rt_within(zone->floor, RT_LOWEST, RT_HIGHEST) || !rt_within(zone->ceiling, zone->floor, RT_HIGHEST) ||
            !check_times(zone))
            return false;
        if (zone->shape == RT_CIRCLE) {
            if (!check_circle(zone, made)) return false;
            continue;
        }
        if (zone->shape != RT_POLYGON && zone->shape != RT_AREA) return false;
        if (!take_edges(zone, &prepared->edges[first], RT_MAX_TOTAL_VERTICES - first, &made->count, &prepared->scratch))
            return false;
        if (!check_rings(&prepared->edges[first], made->count, &prepared->scratch)) return false;
        first += made->count;
        rt_prepare_zone(prepared, at, &entries, &starts);
    }
    for (uint32_t at = 0; at < policy->table_count; at++) {
        rt_list table = policy->tables[at];
        if (table.count != policy->declared) return false;
        while (rt_next_int(&table, &entry))
            if (!rt_within(entry, 0, (int64_t)policy->zone_count - 1)) return false;
    }
    return true;
}
