"""Random worlds with features that `worlds` omits.

These are declared speeds, time zones, days of the week, rings with holes, clocks without a source, and numbers at the
ends of their ranges.
"""

from random import Random

from msgspec.structs import replace

from reference import flat_case as flat
from reference import outlines, worlds
from reference.flat_case import H, M, S
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY, MAX_SPEED, MAX_VALUE, WEEK
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Airspace, Policy, RuleKind, Speeds, VehicleLimits
from rtshcua.model.flat.signal import DRAIN
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Context, Now, State
from rtshcua.model.flat.zone import HIGHEST, LOWEST, MAX_COORDINATE, POLYGON, Zone

_ANY = (MAX_VALUE, -MAX_VALUE, 0, 1, -1, MAX_COORDINATE, -MAX_COORDINATE, MAX_COORDINATE + 1, 9_999_999_999)


def speeds(of: Random) -> Speeds:
    """Mostly the speeds of a quadrotor; sometimes any well-formed ones."""
    if of.random() < 0.7:
        return Speeds(
            8 * M,
            2 * M,
            of.choice([1, 2]) * M,
            500,
            of.choice([0, 10 * M]),
            8 * M,
            2 * M,
            15 * M,
            of.choice([0, 14_999]),
            900 * S,
        )

    def any_speed() -> int:
        return of.choice([1, 2, 1_000, of.randrange(1, MAX_SPEED), MAX_SPEED])

    landing_below = of.choice([0, 10 * M, HIGHEST])
    kept = [any_speed() for _ in range(4)]
    return Speeds(
        *kept,
        landing_below,
        any_speed(),
        any_speed(),
        any_speed(),
        any_speed(),
        of.choice([1, 60 * S, 900 * S, 1 << 42]),
    )


def offsets(of: Random, near: int) -> tuple[int, ...]:
    """The offsets of a time zone that changes near a moment, or at random."""
    moments = sorted(
        {
            max(near + of.choice([-400, -3, -2, -1, 0, 1, 2, 3, 400]) * DAY + of.choice([-1, 0, 1, H]), 0)
            for _ in range(of.randrange(2, 6))
        }
    )
    if len(moments) < 2:
        return (0, 2 * H, MAX_VALUE)
    return (
        *(part for moment in moments[:-1] for part in (moment, of.choice([-DAY, -H, 0, H, 2 * H, H // 2, DAY]))),
        moments[-1],
    )


def vehicle(of: Random, plain: VehicleLimits) -> VehicleLimits:
    """A vehicle with random speeds, return altitude and local time."""
    made = replace(
        plain,
        speeds=speeds(of) if of.random() < 0.7 else None,
        return_altitude=of.choice([0, 30 * M, 100 * M, HIGHEST]),
        home_within=of.choice([0, 50 * M, MAX_COORDINATE]),
        position_error=of.choice([0, 1, 3 * M, 3 * M, 1 << 20]),
        endurance_us=of.choice([plain.endurance_us, 1, 1 << 42]),
    )
    if of.random() < 0.5:
        return replace(made, utc_offset_us=of.choice([-DAY, -H, 0, 1, 2 * H, DAY]))
    return replace(made, utc_offset_us=0, time_zone="A/B", time_zone_data="1", offsets=offsets(of, flat.NOW.utc_us))


def week(of: Random, near: int) -> tuple[int, ...]:
    """Windows of the week, some of which begin or end near a moment."""
    local = (near + 3 * DAY) % WEEK
    edges = {
        min(max(local + of.choice([-2 * DAY, -2 * H, -H, -S, 0, 1, S, H, 2 * H, 3 * DAY]), 0), WEEK) for _ in range(4)
    }
    edges |= {of.choice([0, WEEK, of.randrange(WEEK)]) for _ in range(of.choice([0, 2, 6]))}
    found = sorted(edges)[: len(edges) // 2 * 2]
    return tuple(found) or (0, WEEK)


#: heights near which the vehicle flies or returns
_HEIGHTS = (LOWEST, -1, 0, 5 * M, 20 * M, 25 * M, 28 * M, 30 * M, 31 * M, 60 * M, 98 * M, 100 * M, 101 * M, HIGHEST)


def zone(of: Random, plain: Zone) -> Zone:
    """A zone with rings, other heights, or times of the week."""
    if of.random() < 0.5:
        floor, ceiling = sorted(of.sample(_HEIGHTS, 2))
        plain = replace(plain, floor=floor, ceiling=ceiling)
        if of.random() < 0.4:  # between home and where it mostly is
            plain = replace(plain, shape=POLYGON, data=flat.box(30 * M, -40 * M, of.choice([60, 99]) * M, 20 * M))
    if of.random() < 0.3:
        made = outlines.area(outlines.rings(of))
        scale = of.choice([M, 10 * M, 25 * M])
        start = 1 + made.data[0]
        data = (*made.data[:start], *(coordinate * scale for coordinate in made.data[start:]))
        plain = replace(made, floor=plain.floor, ceiling=plain.ceiling, data=data)
    return replace(plain, weekly=week(of, flat.NOW.utc_us), daily=()) if of.random() < 0.3 else plain


def policy(of: Random) -> Policy:
    """Return a random policy with these features."""
    plain = worlds.policy(of)
    windows = len(plain.sets)
    codes = [
        (Op.WEEK_IN, windows, 0),
        (Op.TIME_IN, of.randrange(DAY), of.randrange(DAY + 1)),
        (Op.POSITION_IN, of.randrange(6), 0),
    ]
    code = of.choice(codes)
    if of.random() < 0.5:
        code = flat.apply(Op.NOT, code)
    kind = of.choice([RuleKind.PERMIT, *RuleKind, RuleKind.DEGRADE])
    added = flat.rule(
        kind,
        when=flat.clause("in time", code),
        approver=0,
        within_us=S,
        target=flat.link(flat.LAND) if kind == RuleKind.DEGRADE else None,
    )
    zones = tuple(zone(of, each) if of.random() < 0.5 else each for each in plain.zones)
    rules = list(plain.rules)
    rules.insert(of.randrange(len(rules) + 1), added)
    if rules and of.random() < 0.2:
        rules.append(of.choice(rules))  # two equal ones
    patient = of.random() < 0.5  # so that something else ends an admission first
    inside, outside = (tuple(of.sample(range(len(zones)), of.choice([0, 1, 2]))) for _ in range(2))
    airspace = Airspace(inside[:1], outside, "airspace", 0, 0, 1) if of.random() < 0.5 else plain.airspace
    measured = of.choice(["link.quality", "wind.speed", "", "", ""])  # clock errors that grow within a minute
    return replace(
        plain,
        airspace=airspace,
        signals=tuple(
            replace(
                each,
                name=DRAIN if each.name == measured else each.name,
                stale_us=20 * S if patient else each.stale_us,
            )
            for each in plain.signals
        ),
        contracts=tuple(
            replace(each, timing_class=of.choice([each.timing_class] * 6 + [0, 1, 2])) for each in plain.contracts
        ),
        vehicle=vehicle(of, plain.vehicle),
        zones=zones,
        sets=(*plain.sets, week(of, flat.NOW.utc_us)),
        rules=tuple(rules),
    )


def invocation(of: Random, policy: Policy) -> Invocation:
    """By anyone."""
    return replace(worlds.invocation(of, policy), source=of.choice([0, 0, 0, 0, 1, 2, 3]))


def mission(invocation: Invocation) -> Mission:
    """Of one step."""
    return replace(flat.MISSION, invocations=(replace(invocation, step=0),))


def state(of: Random, monitors: int) -> State:
    """A state, sometimes with values at the ends of their ranges, ages at the stale limit, or a wrong size."""
    plain = worlds.state(of, monitors)
    values, ages = list(plain.values), list(plain.ages)
    for slot in range(len(values)):
        if of.random() < 0.03:
            values[slot] = of.choice(_ANY)
        if of.random() < 0.03:
            ages[slot] = of.choice([0, 1, 5 * S, 5 * S + 1, 10 * S, (1 << 32) - 1])
    if of.random() < 0.01:
        values, ages = values[1:], ages[1:]
    return replace(plain, values=tuple(values), ages=tuple(ages))


def now(of: Random) -> Now:
    """The time of a mostly good clock."""
    plain = worlds.now(of)
    if of.random() < 0.08:  # the reference is slow with an unknown clock error
        errors = [1, S, 60 * S, H, DAY, WEEK] * 4 + [9 * WEEK, 400 * DAY, 1 << 48, UTC_UNKNOWN_US]
        plain = replace(plain, utc_error_us=of.choice(errors))
    elif of.random() < 0.1:  # a step's validity begins or ends at that time, within the clock error
        edge = flat.ISSUED + of.choice([0, 10 * flat.MIN, 30 * flat.MIN]) + of.choice([-1, 0, 1]) * plain.utc_error_us
        return replace(plain, utc_us=edge + of.choice([-1, 0, 1]))
    return (
        replace(plain, utc_us=of.choice([0, 1, MAX_VALUE, plain.utc_us + 400 * DAY])) if of.random() < 0.02 else plain
    )


def context(of: Random, invocation: Invocation) -> Context:
    """A context, sometimes with unusual phases, and rarely with a large remaining latency."""
    plain = worlds.context(of, invocation)
    if of.random() < 0.03:
        plain = replace(plain, phase=of.choice([62, 63, 64, 65_535]))
    if of.random() < 0.1:
        released = flat.NOW.monotonic_us - of.choice([S, 2 * S - plain.remaining_us, 30 * S])
        plain = replace(plain, released_us=released + of.choice([-1, 0, 1]))
    return replace(plain, remaining_us=of.choice([0, 2 * S, MAX_VALUE])) if of.random() < 0.03 else plain
