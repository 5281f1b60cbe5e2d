/* How long flying takes at most, and whether a charge is enough for it. A height may be anything within RT_MAX_VALUE, so times
   are counted in 128 bits: a distance is below 2**54, its time in us below 2**74, and the sum of a few of them times RT_FULL below
   2**91. A quotient rounded up is at most a bound exactly where the dividend is at most the bound times the divisor, so nothing
   of 128 bits is divided. What is measured to be taken in a minute is counted to 60 times RT_FULL, below 2**20. */
#include "parts.h"

#define RT_BEGINS RT_SECOND
#define RT_SETTLES (4 * RT_SECOND)
#define RT_OVER_HOME (5 * RT_SECOND)
#define RT_LANDED (8 * RT_SECOND)
#define RT_MINUTE (60 * RT_SECOND)
#define RT_MOST_DRAIN (60 * RT_FULL)

typedef struct {
    uint64_t high, low;
} rt_wide;

static rt_wide times(uint64_t a, uint64_t b) {
    const uint64_t half = 0xFFFFFFFF;
    uint64_t low = (a & half) * (b & half), one = (a >> 32) * (b & half), other = (a & half) * (b >> 32);
    uint64_t middle = (low >> 32) + (one & half) + (other & half);
    return (rt_wide){(a >> 32) * (b >> 32) + (one >> 32) + (other >> 32) + (middle >> 32), middle << 32 | (low & half)};
}

static rt_wide plus(rt_wide a, rt_wide b) {
    uint64_t low = a.low + b.low;
    return (rt_wide){a.high + b.high + (low < a.low), low};
}

static rt_wide scaled(rt_wide a, uint64_t by) {
    rt_wide low = times(a.low, by);
    return (rt_wide){low.high + a.high * by, low.low};
}

static bool at_most(rt_wide a, rt_wide b) {
    return a.high < b.high || (a.high == b.high && a.low <= b.low);
}

static rt_wide narrow(int64_t value) {
    return (rt_wide){0, (uint64_t)value};
}

uint32_t rt_root(uint64_t square) {
    uint64_t root = 0, rest = square;
    for (uint64_t bit = (uint64_t)1 << 62; bit; bit >>= 2) {
        if (rest >= root + bit) {
            rest -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
    }
    return (uint32_t)root;
}

/* How long so many mm (not below 0) take at mm in a second, rounded up; `speed` is at most RT_MAX_SPEED. */
static rt_wide over(int64_t distance, int64_t speed) {
    return plus(times((uint64_t)(distance / speed), RT_SECOND), narrow((distance % speed * RT_SECOND + speed - 1) / speed));
}

static rt_wide leg_us(const rt_speeds *speeds, int64_t distance, int64_t speed) {
    int64_t a = speeds->acceleration;
    if (distance >= (RT_MAX_SPEED * (int64_t)RT_MAX_SPEED) || distance * a >= speed * speed)
        return plus(over(distance, speed), over(speed, a));
    /* isqrt(4 d s s / a) + 1: the greatest r with r r a <= 4 d s s, below 2 s v < 2**41 as d a < v v; `end` times a is below 2**63 */
    rt_wide most = times((uint64_t)(4 * distance), RT_SECOND * RT_SECOND);
    uint64_t root = 0, end = (uint64_t)1 << 42;
    while (end - root > 1) {
        uint64_t middle = root + (end - root) / 2;
        if (at_most(times(middle * (uint64_t)a, middle), most)) root = middle;
        else end = middle;
    }
    return narrow((int64_t)end);
}

static rt_wide rising_us(const rt_speeds *speeds, int64_t height) {
    return height > 0 ? leg_us(speeds, height, speeds->climb) : narrow(0);
}

static rt_wide landing_us(const rt_speeds *speeds, int64_t height) {
    int64_t slow = rt_min(rt_max(height, 0), speeds->landing_below);
    rt_wide sinking = height > slow ? leg_us(speeds, height - slow, speeds->descent) : narrow(0);
    return plus(plus(sinking, over(slow, speeds->landing)), narrow(RT_LANDED));
}

static rt_wide home_us(const rt_vehicle *vehicle, int64_t distance, int64_t low, int64_t high, int64_t asked) {
    const rt_speeds *speeds = &vehicle->speeds;
    int64_t homeward = rt_min(asked ? asked : speeds->homeward, speeds->homeward);
    int64_t speed = rt_max(1, rt_min(homeward, speeds->air - speeds->wind));
    rt_wide up = rising_us(speeds, vehicle->return_altitude - low), way = leg_us(speeds, distance + vehicle->home_within, speed);
    rt_wide down = landing_us(speeds, rt_max(high, vehicle->return_altitude));
    return plus(plus(plus(up, way), down), narrow(RT_BEGINS + RT_SETTLES + RT_OVER_HOME));
}

bool rt_brings_home(const rt_vehicle *vehicle, int64_t charge, int64_t distance, int64_t low, int64_t high, int64_t asked,
                    int64_t drain) {
    if (charge < 0) return false; /* no way home takes less than nothing */
    uint64_t left = (uint64_t)charge, taken = (uint64_t)rt_min(rt_max(drain, 0), RT_MOST_DRAIN); /* below 2**20 */
    if (vehicle->has_speeds) {
        rt_wide home = home_us(vehicle, distance, low, high, asked);
        return at_most(scaled(home, RT_FULL), times(left, (uint64_t)vehicle->speeds.flight_us)) &&
               at_most(scaled(home, taken), times(left, RT_MINUTE));
    }
    uint64_t speed = (uint64_t)vehicle->speed; /* times an endurance below 2**62, times a minute in us below 2**53 */
    return at_most(times((uint64_t)distance, RT_SECOND * RT_FULL), times(left, speed * (uint64_t)vehicle->endurance_us)) &&
           at_most(times((uint64_t)distance, RT_SECOND * taken), times(left, speed * RT_MINUTE));
}
