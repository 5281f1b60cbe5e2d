/* Windows of the local day or week, and the existence of zones. A moment t with an error e is somewhere in t - e..t + e: a window holds
   when all of that range is inside it, fails when all of it is outside, and is unknown otherwise. Moments and errors are within 2**53,
   windows and offsets within a week. */
#include "parts.h"

#define RT_MONDAY (3 * RT_DAY) /* 1970 began on a Thursday; weeks begin with Monday */

/* The queried range, and the run of windows that may continue: from..to. */
typedef struct {
    int64_t low, high, error, first, from, to;
    bool begun;
    rt_truth truth;
} asked;

/* From start until before end, the truth is `value`. */
static void judge(asked *of, int64_t start, int64_t end, rt_truth value) {
    int64_t e = of->error;
    if (rt_max(of->low, start + e) <= rt_min(of->high, end - 1 - e)) of->truth |= value;
    if (start > of->first && rt_max(of->low, start - e) <= rt_min(of->high, start + e - 1)) of->truth |= RT_UNKNOWN;
}

/* The next of the moments at which the offset changes, and the offset from it on; the last moment has none. */
static bool next_offset(rt_list *left, int64_t *moment, int64_t *offset) {
    return rt_next_int(left, moment) && rt_next_int(left, offset);
}

/* The next of some windows, from a list or, if that is empty, from a table. */
static void take(rt_list *left, const int64_t fixed[4], uint32_t pair, int64_t *start, int64_t *over) {
    *start = fixed[2 * pair % 4];
    *over = fixed[2 * pair % 4 + 1];
    if (rt_next_int(left, start)) rt_next_int(left, over);
}

/* Windows from the first of `windows` to before the second, and so on; if there are none, of `fixed`. Local time is known from the
   first moment of `offsets` to before the last. */
static rt_truth in_windows(const rt_vehicle *vehicle, rt_list windows, const int64_t fixed[4], uint32_t pairs, int64_t period,
                           int64_t low, int64_t high, int64_t error) {
    rt_list offsets = vehicle->offsets;
    const bool zoned = offsets.count != 0;
    asked of = {.low = low, .high = high, .error = error, .first = low - error};
    int64_t at = of.first, end = high + error + 1, last = end, start, over, begins = 0, ends = 0;
    const rt_truth all = error ? RT_TRUE | RT_FALSE | RT_UNKNOWN : RT_MIXED;
    /* no run of windows or gap lasts longer than this: a period, and at each change of the offset another period and two days; with a
       greater error, a window that begins or ends is always UNKNOWN */
    const int64_t longest = zoned ? (int64_t)1 << 48 : RT_WEEK;
    rt_list left = windows;
    take(&left, fixed, 0, &start, &over);
    const bool everything = pairs == 1 && start == 0 && over == period;
    if (zoned) {
        int64_t from = rt_int_at(offsets, 0), until = rt_int_at(offsets, offsets.count - 1);
        if (from > of.first || until <= high + error) of.truth |= RT_UNKNOWN;
        if (at < rt_min(from, last)) judge(&of, at, rt_min(from, last), RT_UNKNOWN);
        at = rt_min(rt_max(at, from), last);
        last = rt_min(last, until);
    }
    int64_t moment, offset = vehicle->utc_offset_us, next = last;
    bool more = true;
    moment = at;
    if (zoned) more = next_offset(&offsets, &moment, &offset);
    for (; more; moment = next, more = zoned && rt_next_int(&offsets, &offset)) {
        int64_t first = rt_max(at, moment), behind = last, shift = offset + RT_MONDAY;
        if (zoned) {
            if (!rt_next_int(&offsets, &next)) break;
            behind = rt_min(last, next);
        }
        if (first >= behind) continue;
        for (int64_t number = rt_floor(first + shift, period); number <= rt_floor(behind - 1 + shift, period); number++) {
            left = windows;
            for (uint32_t pair = 0; pair < pairs; pair++) {
                take(&left, fixed, pair, &start, &over);
                begins = everything ? first : rt_max(first, number * period + start - shift);
                ends = everything ? behind : rt_min(behind, number * period + over - shift);
                if (begins >= ends) continue;
                if (of.begun && of.to == begins) {
                    of.to = ends;
                    continue;
                }
                if (of.begun) {
                    judge(&of, of.from, of.to, RT_TRUE);
                    at = of.to;
                }
                if (at < begins) judge(&of, at, begins, RT_FALSE);
                of.begun = true;
                of.from = begins;
                of.to = ends;
                if ((of.truth & all) == all || (!everything && error > longest && (of.truth & RT_UNKNOWN))) return of.truth;
            }
            if (everything) break;
        }
    }
    if (of.begun) {
        judge(&of, of.from, of.to, RT_TRUE);
        at = of.to;
    }
    if (at < last) judge(&of, at, last, RT_FALSE);
    if (rt_max(of.first, last) < end) judge(&of, rt_max(of.first, last), end, RT_UNKNOWN);
    return of.truth;
}

/* From start to end, both included; over midnight where start > end. */
rt_truth rt_time_of_day(const rt_vehicle *vehicle, int64_t start, int64_t end, int64_t low, int64_t high, int64_t error) {
    int64_t after = rt_min(end + 1, RT_DAY);
    int64_t once[4] = {start, after, 0, 0}, twice[4] = {0, after, start, RT_DAY}, always[4] = {0, RT_DAY, 0, 0};
    const int64_t *windows = start < after ? once : after < start ? twice : always;
    return in_windows(vehicle, (rt_list){NULL, NULL, 0}, windows, after < start ? 2 : 1, RT_DAY, low, high, error);
}

rt_truth rt_time_of_week(const rt_vehicle *vehicle, rt_list windows, int64_t low, int64_t high, int64_t error) {
    const int64_t none[4] = {0, 0, 0, 0};
    return in_windows(vehicle, windows, none, windows.count / 2, RT_WEEK, low, high, error);
}

static rt_truth in_dates(rt_list dates, int64_t low, int64_t high, int64_t error) {
    int64_t start = rt_int_at(dates, 0), end = rt_int_at(dates, 1);
    rt_truth truth = 0;
    if (rt_max(low, start + error) <= rt_min(high, end - error)) truth |= RT_TRUE;
    if (low < start - error || high > end + error) truth |= RT_FALSE;
    if (error && ((start - error <= high && low < start + error) || (end - error < high && low <= end + error)))
        truth |= RT_UNKNOWN;
    return truth;
}

bool rt_zone_timed(const rt_zone *zone) {
    return zone->daily.count || zone->weekly.count || zone->dates.count;
}

rt_truth rt_zone_exists(const rt_vehicle *vehicle, const rt_zone *zone, int64_t low, int64_t high, int64_t error) {
    rt_truth truth = RT_TRUE;
    if (zone->daily.count)
        truth = rt_time_of_day(vehicle, rt_int_at(zone->daily, 0), rt_int_at(zone->daily, 1), low, high, error);
    else if (zone->weekly.count) truth = rt_time_of_week(vehicle, zone->weekly, low, high, error);
    return zone->dates.count ? rt_and(truth, in_dates(zone->dates, low, high, error)) : truth;
}
