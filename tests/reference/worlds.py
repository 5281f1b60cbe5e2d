"""Random worlds: conditions, policies, invocations, situations and sets of situations, all well-formed.

Each maker takes a seeded random generator rather than drawing piece by piece: a policy has hundreds of pieces, and a
seed is enough to see a failure again. Most pieces are the nominal ones, so that the later steps are reached.
"""

from random import Random
from typing import NamedTuple

from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import M, S
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import MISSING, Sets, Value, interval, maybe, members, point
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Contract, Facing, Parameter, SourceKind
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.mission import ALONG, TURN, Invocation, Plan
from rtshcua.model.flat.policy import Airspace, Monitor, MonitorKind, Policy, Rule, RuleKind
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone

Code = tuple[int, ...]
CHANCES = st.integers(0, (1 << 64) - 1).map(Random)

# ------------------------------------------------------------------------------------------------------- code

NUMBERS = (flat.BATTERY, flat.HEIGHT, flat.HEIGHT, flat.WIND, flat.LINK, flat.OBSTACLE, flat.FIX)
LEVELS = (0, 1, 3, 2_000, 2_500, 3_500, 4_000, 5 * M, 10 * M, 20 * M, 30 * M, 60 * M, -5 * M)


def number(of: Random, cells: list[int]) -> Code:
    kind = of.randrange(8)
    if kind < 2:
        return flat.const(of.choice(LEVELS))
    if kind < 4 and cells:
        return flat.argument(of.choice(cells))
    if kind < 6:
        return flat.signal(of.choice(NUMBERS))
    if kind == 6:
        return flat.apply(of.choice([Op.ADD, Op.SUB]), number(of, cells), number(of, cells))
    return flat.scaled(number(of, cells), of.choice([-2, -1, 0, 2, 3]))


class Reach(NamedTuple):
    """What conditions may read beside state and arguments: how many temporal monitors, and whether the phase."""

    monitors: int = 0
    phased: bool = False


NONE = Reach()
PHASES = len(flat.POLICY.sets)  # the set of phases that a random policy reads


def atom(of: Random, contract: Contract | None, reach: Reach) -> Code:
    cells: dict[int, list[int]] = {kind: [] for kind in (QUANTITY, CHOICE, ZONE, PLACE)}
    for parameter in contract.parameters if contract else ():
        cells[parameter.kind].append(parameter.cell)
    zone = of.randrange(len(flat.ZONES))
    kinds = ["compare", "compare", "position", "fix", "known", "time", *(k for k in (ZONE, CHOICE, PLACE) if cells[k])]
    kinds += ["monitor"] * (2 * (reach.monitors > 0)) + ["phase"] * reach.phased
    match of.choice(kinds):
        case "compare":
            op = of.choice([Op.LT, Op.LE, Op.GT, Op.GE, Op.EQ, Op.NE])
            numbers = cells[QUANTITY] + cells[CHOICE]
            return flat.apply(op, number(of, numbers), number(of, numbers))
        case "position":
            return (Op.POSITION_IN, zone, 0)
        case "fix":
            return (Op.SIGNAL_IN, flat.FIX, of.randrange(len(flat.POLICY.sets)))
        case "known":
            return (Op.KNOWN, of.randrange(flat.POLICY.slots), 0)
        case "time":
            return (Op.TIME_IN, of.randrange(24) * flat.H, of.randrange(25) * flat.H)
        case "monitor":
            return (Op.MONITOR, of.randrange(reach.monitors), 0)
        case "phase":
            return (Op.PHASE_IN, 0, PHASES)
        case 2:
            argument = (Op.ARGUMENT_IN, cells[ZONE][0], flat.IN_BRIDGE)
            return of.choice([argument, (Op.POSITION_IN_ARGUMENT, cells[ZONE][0], flat.GROW_15)])
        case 1:
            return (Op.ARGUMENT_IN, cells[CHOICE][0], flat.IN_BRIDGE)
        case _:
            return (Op.ARGUMENT_POINT_IN, cells[PLACE][0], zone)


def condition(of: Random, contract: Contract | None, depth: int = 2, reach: Reach = NONE) -> Code:
    kind = of.randrange(6) if depth else 0
    if kind < 3:
        return atom(of, contract, reach)
    if kind == 3:
        return flat.apply(Op.NOT, condition(of, contract, depth - 1, reach))
    op = of.choice([Op.AND, Op.OR])
    return flat.apply(op, *(condition(of, contract, depth - 1, reach) for _ in range(2)))


def clause(of: Random, contract: Contract | None, reach: Reach) -> Clause:
    return flat.clause("some clause", condition(of, contract, 2, reach))


def monitors(of: Random, count: int) -> tuple[Monitor, ...]:
    """Each may read those before it."""
    return tuple(monitor(of, number) for number in range(count))


def monitor(of: Random, number: int) -> Monitor:
    kind = of.choice([*MonitorKind])
    edge = kind in (MonitorKind.RISING, MonitorKind.FALLING)
    window_us = 0 if edge else of.choice([1, 50_000, S // 2, S, 3 * S, 600 * S])
    return Monitor(kind, window_us, clause(of, None, Reach(number)))


# ----------------------------------------------------------------------------------------------------- policy


def contract(of: Random, plain: Contract, monitors: tuple[Monitor, ...]) -> Contract:
    """A shipped one, or with conditions at random."""
    if of.random() < 0.5:
        return plain
    reach = Reach(len(monitors), phased=True)
    require, assume, maintain = (
        kept if of.random() < 0.5 else tuple(clause(of, plain, reach) for _ in range(of.randrange(2)))
        for kept in (plain.require, plain.assume, plain.maintain)
    )
    return replace(
        plain,
        require=require,
        assume=assume,
        maintain=maintain,
        reads=slots_read((*require, *assume, *maintain), flat.POLICY.vehicle, monitors),
        energy=of.randrange(6_000),
        timing_class=of.choice([1] * 20 + [0, 2]),
    )


LOWEST_HEIGHT = Parameter("lowest", QUANTITY, "altitude", 4, 0, 60 * M, ())


def levelled(of: Random, plain: Contract) -> Contract:
    """A survey at several heights, perhaps facing inward."""
    facing = of.choice([Facing.ALONG, Facing.INWARD])
    motion = replace(plain.motion, lowest=LOWEST_HEIGHT.cell, facing=facing)
    return replace(plain, parameters=(*plain.parameters, LOWEST_HEIGHT), motion=motion)


def levels(of: Random, contract: Contract, plan: Plan, lowest: int) -> Plan:
    """The plan with heights and headings as its contract has them."""
    points, motion = len(plan.path) // 2, contract.motion
    heights = tuple(of.randint(min(lowest, plan.altitude), plan.altitude) for _ in range(points * of.randrange(2)))
    headings = tuple(of.choice((ALONG, of.randrange(TURN))) for _ in range(points))
    return replace(
        plan,
        heights=heights if motion.lowest != -1 else (),
        headings=headings if motion.facing != Facing.ALONG else (),
    )


def rule(of: Random, contracts: tuple[Contract, ...], reach: Reach) -> Rule:
    kind = of.choice([RuleKind.PERMIT] * 6 + [*RuleKind])
    skills = of.choice([(), (flat.INSPECT,), (flat.INSPECT,), (flat.GOTO,), (flat.TAKEOFF,), (flat.HOVER, flat.HOME)])
    target = of.choice([flat.link(flat.HOME), flat.link(flat.LAND), flat.link(flat.TAKEOFF, 30 * M)])
    return flat.rule(
        kind,
        *skills,
        roles=of.choice([(), (0,), (0, 1)]),
        sources=of.choice([(), (0, 1), (2,)]),
        when=None if of.random() < 0.2 else clause(of, contracts[skills[0]] if len(skills) == 1 else None, reach),
        approver=of.randrange(2),
        second=of.choice([-1, -1, 0, 1]) if kind == RuleKind.CONFIRM else -1,
        within_us=30 * S,
        target=target if kind == RuleKind.DEGRADE else None,
    )


def zone(of: Random) -> Zone:
    x, y = (of.randrange(-250, 150) * M for _ in range(2))
    if of.random() < 0.3:
        return Zone("z", CIRCLE, LOWEST, HIGHEST, (x, y, (of.randrange(10, 400) * M) ** 2))
    floor, ceiling = of.choice([LOWEST, LOWEST, 0, 10 * M]), of.choice([HIGHEST, 60 * M, 25 * M])
    width, depth = of.randrange(50, 600) * M, of.randrange(50, 600) * M
    outer = flat.box(x, y, x + width, y + depth)
    if of.random() < 0.5:
        return Zone("z", POLYGON, floor, ceiling, outer)
    x, y, width, depth = x + width // 8, y + depth // 8, width // 4, depth // 4
    hole = (x, y, x, y + depth, x + width, y + depth, x + width, y)
    island = flat.box(x + width // 3, y + depth // 3, x + width // 2, y + depth // 2) if of.random() < 0.5 else ()
    counts = (3, 4, 4, 4) if island else (2, 4, 4)
    return Zone("z", AREA, floor, ceiling, (*counts, *outer, *hole, *island))


def timed(of: Random, zone: Zone) -> Zone:
    """The zone at some times only, which begin or end near now."""
    local = (flat.NOW.utc_us + flat.POLICY.vehicle.utc_offset_us) % DAY
    near = (-10 * flat.MIN, -20_000, -1, 0, 1, 20_000, 2 * flat.MIN, 5 * flat.MIN + 20_000, 10 * flat.MIN, 8 * flat.H)
    daily = (local + of.choice(near)) % DAY, (local + of.choice(near)) % DAY
    start, end = (flat.NOW.utc_us + moment for moment in sorted(of.sample([*near, -8 * flat.H], 2)))
    kind = of.randrange(3)
    return replace(zone, daily=daily if kind else (), dates=(start, end) if kind < 2 else ())


def policy(of: Random) -> Policy:
    observed = monitors(of, of.choice([0, 0, 1, 3]))
    phases = tuple(of.sample(("departure", "inspection", "recovery", "elsewhere"), of.randrange(4)))
    asked = tuple(sorted(of.sample(range(len(phases)), of.randint(0, len(phases)))))
    reach = Reach(len(observed), phased=True)
    contracts = tuple(contract(of, plain, observed) for plain in flat.CONTRACTS)
    if of.random() < 0.3:
        contracts = tuple(levelled(of, each) if n == flat.INSPECT else each for n, each in enumerate(contracts))
    zones = tuple(zone(of) if of.random() < 0.2 else plain for plain in flat.ZONES)
    zones = tuple(timed(of, one) if of.random() < 0.1 else one for one in zones)
    some = Airspace(*(tuple(of.sample(range(6), of.randrange(2))) for _ in range(2)), "airspace", 0, 0, 1)
    made = replace(
        flat.POLICY,
        contracts=contracts,
        zones=zones,
        rules=(*(rule(of, contracts, reach) for _ in range(of.randrange(4))), *of.choice([flat.RULES] * 8 + [()])),
        monitors=observed,
        phases=phases,
        sets=(*flat.POLICY.sets, asked),
        airspace=of.choice([None, flat.POLICY.airspace, flat.POLICY.airspace, some]),
        vehicle=replace(flat.POLICY.vehicle, position_error=of.choice([0, 3 * M])),
    )
    return _without(made, of.choice(["position", "height", "battery"])) if of.random() < 0.1 else made


def _without(policy: Policy, well_known: str) -> Policy:
    """A policy whose vehicle reports fewer signals."""
    vehicle = replace(policy.vehicle, **{well_known: -1})
    contracts = tuple(
        replace(c, reads=slots_read((*c.require, *c.assume, *c.maintain), vehicle, policy.monitors))
        for c in policy.contracts
    )
    return replace(policy, vehicle=vehicle, contracts=contracts)


# ------------------------------------------------------------------------------------------------- invocation

COORDINATES = (-300 * M, -20 * M, 0, 20 * M, 20 * M, 110 * M, 150 * M, 190 * M, 450 * M, 499 * M)
SKILLS = (*(flat.TAKEOFF, flat.GOTO, flat.HOME) * 3, *(flat.INSPECT,) * 9, flat.LAND, flat.TRACK)


def arguments(of: Random, skill: int) -> tuple[int, ...]:
    """Mostly in range."""
    altitude, speed = of.choice([20] * 40 + [4, 8, 8, 30, 30, 50, 70]) * M, of.choice([4] * 40 + [9]) * M
    place = (of.choice(COORDINATES), of.choice(COORDINATES))
    area = of.choice([flat.BRIDGE] * 40 + [flat.CITY, flat.SCHOOL, 3])
    return {
        flat.TAKEOFF: (altitude,),
        flat.GOTO: (*place, altitude),
        flat.INSPECT: (area, altitude, of.randrange(3), speed),
    }.get(skill, ())


def survey(of: Random, zone: Zone) -> tuple[int, ...]:
    """A path within a zone."""
    if zone == flat.ZONES[flat.BRIDGE]:
        return flat.PATH
    data = zone.data if zone.shape != AREA else zone.data[1 + zone.data[0] : 9 + zone.data[0]]
    xs, ys = (data[:1], data[1:2]) if zone.shape == CIRCLE else (data[::2], data[1::2])
    x, y = sum(xs) // len(xs), sum(ys) // len(ys)
    return (x, y, x + of.randrange(5 * M), y)


def invocation(of: Random, policy: Policy) -> Invocation:
    skill = of.choice(SKILLS)
    contract, values = policy.contracts[skill], arguments(of, skill)
    motion = contract.motion
    path: tuple[int, ...] = {flat.GOTO: values[:2], flat.HOME: (0, 0)}.get(skill, ())
    if skill == flat.INSPECT:
        path = survey(of, policy.zones[values[0]]) if values[0] < policy.declared else flat.PATH
    altitude = 0 if motion.altitude == -1 else values[motion.altitude]
    speed = 0 if motion.speed == -1 else values[motion.speed]
    plan = Plan(motion.kind, path, altitude, speed)
    if motion.lowest != -1:
        values = (*values, min(altitude, of.choice([0, 5, 10, 19, 20]) * M))
        plan = levels(of, contract, plan, values[-1])
    return flat.invocation(
        of.randrange(4),
        0,
        skill,
        plan,
        *values,
        contract=contract,
        source=of.choice([SourceKind.AGENT] * 20 + [*SourceKind]),
        role=of.choice([0] * 20 + [1]),
        phases=of.choice([0b010] * 10 + [0b101, 0b111, 0]),
    )


# ------------------------------------------------------------------------------------------------- situations

NEAR = {
    flat.BATTERY: [1_000, 2_499, 2_500, 3_500, 3_501, 9_000, 10_000],
    flat.HEIGHT: [-500, 0, 5 * M, 20 * M, 25 * M, 25 * M + 1, 61 * M],
    flat.WIND: [0, 9_999, 10 * M],
    flat.LINK: [3_999, 4_000, 9_000],
    flat.FIX: [0, 2, 3, 4, 9],
    flat.POSITION_X: [-300 * M, 0, 85 * M, 88 * M, 88 * M + 1, 110 * M, 150 * M, 497 * M, 600 * M],
    flat.POSITION_Y: [-42 * M, -20 * M, 0, 30 * M, 300 * M],
    flat.OBSTACLE: [0, 5 * M, 20 * M],
}


def state(of: Random, monitors: int = 0) -> State:
    """Mostly nominal; a value may be near a threshold, missing, or nearly stale, and the truths of temporal monitors
    are rarely invalid or of the wrong length."""
    values = {slot: of.choice(near) for slot, near in NEAR.items() if of.random() < 0.2}
    if of.random() < 0.2:
        values[of.randrange(flat.SLOTS)] = None
    ages = {slot: of.choice([0, S // 2, S // 2 + 1, -1]) for slot in range(flat.SLOTS) if of.random() < 0.05}
    said = tuple(of.choice([1, 1, 1, 2, 4]) for _ in range(monitors))
    if of.random() < 0.03:
        said = of.choice([said[1:], (*said, 1), (3, *said[1:]), (0, *said[1:])])
    return replace(flat.state(values, ages), monitors=said)


def now(of: Random) -> Now:
    since = of.choice([60 * S] * 60 + [0, 10_000, 10 * flat.MIN, 10 * flat.MIN + 20_000, 12 * flat.H, -30_000])
    return Now(flat.NOW.monotonic_us, flat.ISSUED + since, of.choice([0, 20_000]))


def context(of: Random, invocation: Invocation) -> Context:
    def rarely() -> bool:
        return of.random() < 0.01

    at = flat.NOW.monotonic_us
    answers = [
        ConfirmAnswer(
            of.choice([flat.CONFIRM_RULE, 0, 1, 2]),
            of.randrange(2),
            of.randrange(2),
            of.choice([at - S, at]),
            of.randrange(2),
        )
        for _ in range(of.choice([0, 0, 1, 2]))
    ]
    return Context(
        binding=bytes(32) if rarely() else invocation.binding,
        vehicle="quad-08" if rarely() else "quad-07",
        policy_version=8 if rarely() else 7,
        consumed=int(rarely()),
        released_us=at - of.choice([0] * 20 + [S, 2 * S - 5_000, 2 * S - 4_999, 31 * S]),
        phase=of.choice([1] * 30 + [0, 2, -1]),
        remaining_us=5_000,
        approvals=tuple(answers),
    )


def sets(of: Random, monitors: int = 0) -> Sets:
    """Mostly narrow sets, because wide ones test little."""
    moment = now(of)
    starts = [moment.utc_us, moment.utc_us + 3][: of.choice([1, 1, 2])]
    utc = tuple((low, low + of.choice([0, 0, 0, 20_000, flat.H])) for low in starts)
    error = moment.utc_error_us
    return Sets(
        tuple(_value(of, slot) for slot in range(flat.SLOTS)),
        (moment.monotonic_us, moment.monotonic_us + of.choice([0, 0, 3 * S])),
        utc,
        (error, error + of.choice([0, 5_000])),
        tuple(of.choice([1, 1, 1, 2, 4, 3, 5, 6, 7]) for _ in range(monitors)) if of.random() < 0.9 else (),
    )


def _value(of: Random, slot: int) -> Value:
    kind, near = of.random(), NEAR[slot]
    ends = sorted(of.sample(near, 2))
    if kind < 0.7:
        return point(flat.NOMINAL[slot])
    if kind < 0.75:
        return MISSING
    value = members(ends) if slot == flat.FIX and kind < 0.9 else interval(*ends)
    return maybe(value) if kind < 0.85 else value


def situation(of: Random, all_of: Sets, monitors: int = 0) -> tuple[State, Now]:
    """A member of a set of situations."""
    low, high = of.choice(all_of.utc_us)
    truths = all_of.monitors or (7,) * monitors
    said = tuple(of.choice([single for single in (1, 2, 4) if single & truth]) for truth in truths)
    return (
        State(tuple(_member(of, value) for value in all_of.values), (0,) * len(all_of.values), said),
        Now(_within(of, *all_of.monotonic_us), _within(of, low, high), _within(of, *all_of.utc_error_us)),
    )


def _member(of: Random, value: Value) -> int | None:
    low, high, gap, elements = value
    if gap == 2 or (gap == 1 and of.random() < 0.3):
        return None
    return _within(of, low, high) if elements is None else of.choice(sorted(elements))


def _within(of: Random, low: int, high: int) -> int:
    return of.choice([low, high, of.randint(low, high)])
