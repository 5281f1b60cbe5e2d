"""A hand-written policy and mission in the flat form, as the compiler would lower the example of the design.

Lengths mm, speeds mm/s, times us, ratios 1/10000. East of home is x, north is y.
"""

from msgspec.structs import replace

from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import (
    CHOICE,
    PLACE,
    QUANTITY,
    ZONE,
    Contract,
    Link,
    Motion,
    MotionKind,
    Parameter,
    SourceKind,
    TimingClass,
)
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible, Plan
from rtshcua.model.flat.policy import Airspace, Policy, Rule, RuleKind, VehicleLimits
from rtshcua.model.flat.signal import ENUMERATION, NUMBER, POSITION, Signal, SignalSource
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, POLYGON, Projection, Zone

S = 1_000_000  # us in a second
MIN = 60 * S
H = 60 * MIN
M = 1_000  # mm in a metre

# ------------------------------------------------------------------------------------------------------- code

Code = tuple[int, ...]


def const(value: int) -> Code:
    return (Op.CONST, value, 0)


def signal(slot: int) -> Code:
    return (Op.SIGNAL, slot, 0)


def argument(cell: int) -> Code:
    return (Op.ARGUMENT, cell, 0)


def apply(op: Op, *operands: Code) -> Code:
    """Return the operands' code followed by the instruction."""
    return (*(number for operand in operands for number in operand), op, 0, 0)


def scaled(operand: Code, factor: int) -> Code:
    return (*operand, Op.SCALE, factor, 0)


def clause(text: str, code: Code) -> Clause:
    """Return a clause at a source place that depends only on its text."""
    return Clause(text, 0, 100, 100 + len(text), code)


# ---------------------------------------------------------------------------------------------------- signals

BATTERY, HEIGHT, WIND, LINK, FIX, POSITION_X, POSITION_Y, OBSTACLE, SLOTS = range(9)
SIGNALS = (
    Signal(
        "battery",
        BATTERY,
        NUMBER,
        "ratio",
        5 * S,
        (),
        (SignalSource("BATTERY_STATUS", ("battery_remaining",), 100, 1, (-1,)),),
    ),
    Signal("height", HEIGHT, NUMBER, "altitude", S // 2, (), ()),
    Signal("wind.speed", WIND, NUMBER, "speed", 10 * S, (), ()),
    Signal("link.quality", LINK, NUMBER, "ratio", 5 * S, (), ()),
    Signal("gps.fix", FIX, ENUMERATION, "GPS_FIX_TYPE", S, ((0, "no_gps"), (2, "fix_2d"), (3, "fix_3d")), ()),
    Signal("position", POSITION_X, POSITION, "position", S // 2, (), ()),
    Signal("obstacle.distance", OBSTACLE, NUMBER, "length", S, (), ()),
)

# ------------------------------------------------------------------------------------------------------ zones

CITY, BRIDGE, SCHOOL, CITY_GROWN, BRIDGE_GROWN, SCHOOL_GROWN = range(6)
DECLARED = 3


def box(west: int, south: int, east: int, north: int) -> tuple[int, ...]:
    """A rectangle's corners, counter-clockwise."""
    return (west, south, east, south, east, north, west, north)


ZONES = (
    Zone("city", POLYGON, LOWEST, 120 * M, box(-500 * M, -500 * M, 500 * M, 500 * M)),
    Zone("bridge_a", POLYGON, 0, 60 * M, box(100 * M, -30 * M, 200 * M, 30 * M)),
    Zone("school", CIRCLE, LOWEST, HIGHEST, (0, 300 * M, (100 * M) ** 2)),
    Zone("grow(city, 15 m)", POLYGON, LOWEST, 120 * M, box(-515 * M, -515 * M, 515 * M, 515 * M)),
    Zone("grow(bridge_a, 15 m)", POLYGON, 0, 60 * M, box(85 * M, -45 * M, 215 * M, 45 * M)),
    Zone("grow(school, 15 m)", CIRCLE, LOWEST, HIGHEST, (0, 300 * M, (115 * M) ** 2)),
)
GROW_15 = 0  # table
IN_BRIDGE, GOOD_FIX = range(2)  # sets

# -------------------------------------------------------------------------------------------------- contracts

TAKEOFF, HOVER, GOTO, INSPECT, HOME, LAND, TRACK = range(7)

FIX_IS_GOOD = clause("gps.fix >= fix_3d", (Op.SIGNAL_IN, FIX, GOOD_FIX))
ENOUGH_CHARGE = clause("battery > 35 %", apply(Op.GT, signal(BATTERY), const(3_500)))
GOOD_LINK = clause("link.quality >= 40 %", apply(Op.GE, signal(LINK), const(4_000)))
CALM = clause("wind.speed < 10 m/s", apply(Op.LT, signal(WIND), const(10 * M)))
FREE = clause("obstacle.distance > 5 m", apply(Op.GT, signal(OBSTACLE), const(5 * M)))
NEAR_AREA = clause("position inside grow(area, 15 m)", (Op.POSITION_IN_ARGUMENT, 0, GROW_15))
NOT_HIGH = clause("height <= altitude + 5 m", apply(Op.LE, signal(HEIGHT), apply(Op.ADD, argument(1), const(5 * M))))


def link(skill: int, *arguments: int, limit_us: int = 0) -> Link:
    return Link(skill, arguments, limit_us, f"link to {skill}", 0, 0, 1)


CHAIN = (link(HOVER, limit_us=20 * S), link(HOME), link(LAND))
ALTITUDE = Parameter("altitude", QUANTITY, "altitude", 0, 2 * M, 60 * M, ())


def contract(name: str, motion: Motion, **fields: object) -> Contract:
    """Return a contract without conditions, with `fields` changed."""
    nothing = Contract(
        name=name,
        parameters=(),
        motion=motion,
        timing_class=TimingClass.TACTICAL,
        deadline_us=2 * S,
        validity_us=30 * MIN,
        phases=(),
        duration_us=5 * MIN,
        grace_us=S // 2,
        require=(),
        assume=(),
        maintain=(),
        fallback=(link(LAND),),
        energy=0,
        record=("decision",),
        reads=(),
    )
    return replace(nothing, **fields)


INSPECT_PARAMETERS = (
    Parameter("area", ZONE, "", 0, 0, DECLARED - 1, ()),
    Parameter("altitude", QUANTITY, "altitude", 1, 5 * M, 60 * M, ()),
    Parameter("pattern", CHOICE, "", 2, 0, 2, ("grid", "perimeter", "orbit")),
    Parameter("speed", QUANTITY, "speed", 3, 1 * M, 8 * M, ()),
)

CONTRACTS = (
    contract(
        "takeoff",
        Motion(MotionKind.CLIMB, 0, -1),
        parameters=(ALTITUDE,),
        require=(FIX_IS_GOOD, ENOUGH_CHARGE),
        assume=(CALM,),
        fallback=(link(LAND),),
        energy=200,
        reads=(BATTERY, WIND, FIX),
    ),
    contract("hover", Motion(MotionKind.HOLD, -1, -1), require=(FIX_IS_GOOD,), energy=100, reads=(FIX,)),
    contract(
        "goto",
        Motion(MotionKind.FLY, 2, -1),
        parameters=(
            Parameter("to", PLACE, "", 0, 0, 0, ()),
            Parameter("altitude", QUANTITY, "altitude", 2, 5 * M, 60 * M, ()),
        ),
        require=(FIX_IS_GOOD,),
        assume=(GOOD_LINK, CALM),
        fallback=CHAIN,
        energy=500,
        reads=(WIND, LINK, FIX),
    ),
    contract(
        "inspect_area",
        Motion(MotionKind.COVER, 1, 3),
        parameters=INSPECT_PARAMETERS,
        validity_us=10 * MIN,
        phases=("inspection",),
        require=(FIX_IS_GOOD, ENOUGH_CHARGE),
        assume=(GOOD_LINK, CALM, FREE),
        maintain=(NEAR_AREA, NOT_HIGH),
        fallback=CHAIN,
        energy=1_800,
        reads=(BATTERY, HEIGHT, WIND, LINK, FIX, POSITION_X, POSITION_Y, OBSTACLE),
    ),
    contract("return_home", Motion(MotionKind.HOME, -1, -1), require=(FIX_IS_GOOD,), energy=800, reads=(FIX,)),
    contract("emergency_land", Motion(MotionKind.LAND, -1, -1), fallback=()),
    contract("track_target", Motion(MotionKind.HOLD, -1, -1)),
)

# ------------------------------------------------------------------------------------------------------ rules

OPERATOR, SUPERVISOR = range(2)  # roles


def rule(kind: RuleKind, *skills: int, **fields: object) -> Rule:
    nothing = Rule(kind, skills, (), (), None, -1, 0, None, f"{kind.name.lower()} {skills}", 0, 10, 20)
    return replace(nothing, **fields)


INSPECT_SCOPE = clause(
    "area inside bridge_a and altitude <= 30 m and local time in 08:00 .. 18:00",
    apply(
        Op.AND,
        apply(Op.AND, (Op.ARGUMENT_IN, 0, IN_BRIDGE), apply(Op.LE, argument(1), const(30 * M))),
        (Op.TIME_IN, 8 * H, 18 * H),
    ),
)
LOW_BATTERY = clause("battery < 25 %", apply(Op.LT, signal(BATTERY), const(2_500)))
CONFIRM_RULE = 5  # index in RULES

RULES = (
    rule(
        RuleKind.PERMIT,
        INSPECT,
        roles=(OPERATOR,),
        sources=(SourceKind.AGENT, SourceKind.OPERATOR),
        when=INSPECT_SCOPE,
    ),
    rule(
        RuleKind.PERMIT,
        TAKEOFF,
        roles=(OPERATOR,),
        when=clause("altitude <= 40 m", apply(Op.LE, argument(0), const(40 * M))),
    ),
    rule(RuleKind.PERMIT, GOTO, roles=(OPERATOR,)),
    rule(RuleKind.PERMIT, HOVER, HOME, LAND),
    rule(RuleKind.FORBID, TRACK),
    rule(
        RuleKind.CONFIRM,
        INSPECT,
        when=clause("altitude < 10 m", apply(Op.LT, argument(1), const(10 * M))),
        approver=SUPERVISOR,
        within_us=30 * S,
    ),
    rule(RuleKind.DEGRADE, when=LOW_BATTERY, target=link(HOME)),
)

POLICY = Policy(
    name="bridge_inspection",
    version=7,
    vehicle=VehicleLimits(
        name="quad",
        identity="quad-07",
        home_within=50 * M,
        speed=12 * M,
        climb=3 * M,
        position_error=3 * M,
        endurance_us=18 * MIN,
        reserve=1_000,
        utc_offset_us=2 * H,
        position=POSITION_X,
        height=HEIGHT,
        battery=BATTERY,
    ),
    projection=Projection(473_977_400, 85_455_900, 7_900_000, 11_656_000),
    roles=("operator", "supervisor"),
    signals=SIGNALS,
    slots=SLOTS,
    zones=ZONES,
    declared=DECLARED,
    tables=((CITY_GROWN, BRIDGE_GROWN, SCHOOL_GROWN),),
    sets=((BRIDGE,), (3, 4, 5, 6)),
    contracts=CONTRACTS,
    rules=RULES,
    airspace=Airspace((CITY,), (SCHOOL,), "airspace inside city outside school", 0, 30, 60),
    contingency=(link(HOVER, limit_us=10 * S), link(HOME), link(LAND)),
    sources=("policies/bridge.rts",),
    source_digests=(bytes(32),),
)

# ---------------------------------------------------------------------------------------------------- mission

ISSUED = 1_750_000_000 * S  # 15:06:40 UTC, 17:06:40 local time
PATH = (110 * M, -20 * M, 190 * M, -20 * M, 190 * M, 20 * M, 110 * M, 20 * M)
DEPARTURE, INSPECTION, RECOVERY = range(3)  # phases


def invocation(step: int, phase: int, skill: int, plan: Plan, *arguments: int, **fields: object) -> Invocation:
    """Return a step by an operator through an agent, valid in its own phase."""
    plain = Invocation(
        invocation_id=bytes([step]) * 16,
        step=step,
        phase=phase,
        skill=skill,
        source=SourceKind.AGENT,
        role=OPERATOR,
        arguments=arguments,
        issued_at_us=ISSUED,
        phases=1 << phase,
        on_inadmissible=OnInadmissible.ABORT,
        contract=CONTRACTS[skill],
        plan=plan,
        text=f"step {step}",
        file=0,
        start=0,
        end=1,
        binding=bytes([100 + step]) * 32,
    )
    return replace(plain, **fields)


INSPECTION_STEP = 2
INVOCATIONS = (
    invocation(0, DEPARTURE, TAKEOFF, Plan(MotionKind.CLIMB, (), 20 * M, 0), 20 * M),
    invocation(1, INSPECTION, GOTO, Plan(MotionKind.FLY, (110 * M, -20 * M), 20 * M, 0), 110 * M, -20 * M, 20 * M),
    invocation(2, INSPECTION, INSPECT, Plan(MotionKind.COVER, PATH, 20 * M, 4 * M), BRIDGE, 20 * M, 0, 4 * M),
    invocation(3, RECOVERY, HOME, Plan(MotionKind.HOME, (0, 0), 0, 0)),
)
MISSION = Mission(
    name="inspect_bridge_a",
    intent="Inspect bridge A at low altitude, then come home.",
    proposer="openclaw",
    vehicle="quad-07",
    policy="bridge_inspection",
    policy_version=7,
    policy_digest=bytes(32),
    issued_at_us=ISSUED,
    phases=("departure", "inspection", "recovery"),
    invocations=INVOCATIONS,
    sources=("missions/inspect.rts",),
    source_digests=(bytes(32),),
)

# -------------------------------------------------------------------------------------------------- situation

NOW = Now(monotonic_us=500 * S, utc_us=ISSUED + 60 * S, utc_error_us=20_000)
NOMINAL: dict[int, int | None] = {
    BATTERY: 9_000,
    HEIGHT: 20 * M,
    WIND: 4 * M,
    LINK: 9_000,
    FIX: 3,
    POSITION_X: 110 * M,
    POSITION_Y: -20 * M,
    OBSTACLE: 20 * M,
}


def state(values: dict[int, int | None] | None = None, ages: dict[int, int] | None = None) -> State:
    """Return a nominal, fresh state at the bridge, with some values changed."""
    all_values, all_ages = NOMINAL | (values or {}), ages or {}
    return State(
        tuple(all_values[slot] for slot in range(SLOTS)), tuple(all_ages.get(slot, 10_000) for slot in range(SLOTS))
    )


def context(of: Invocation = INVOCATIONS[INSPECTION_STEP], **fields: object) -> Context:
    """Return the context of a step that was just released, in its own phase."""
    plain = Context(
        binding=of.binding,
        vehicle="quad-07",
        policy_version=7,
        consumed=0,
        released_us=NOW.monotonic_us - 100_000,
        phase=of.phase,
        remaining_us=5_000,
        approvals=(),
    )
    return replace(plain, **fields)


def approval(
    granted: int, monotonic_us: int, role: int = SUPERVISOR, rule: int = CONFIRM_RULE, person: int = 0
) -> ConfirmAnswer:
    return ConfirmAnswer(rule, role, granted, monotonic_us, person)
