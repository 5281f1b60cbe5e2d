"""Compares the decision in C with the one in Python: the same outcome, reason, step, clause, target and
`valid_until`, the same links that may fly, and the same refused policies and missions.
"""

import ctypes
import json
from contextlib import suppress
from itertools import pairwise, product
from pathlib import Path
from random import Random

import pytest
from msgspec.structs import replace

from boundary.mutants import altered
from reference import flat_case as flat
from reference import outlines, rich_worlds, worlds
from reference.asking import STEP
from reference.flat_case import H, M, S
from reference.native import Native, Question, expected
from rtshcua.decision.contracts import Energy, drains
from rtshcua.decision.flying import MOST_DRAIN
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.decision.times import Times, daily, local_time, timed
from rtshcua.decision.values import FALSE, TRUE, point
from rtshcua.decision.zones import PreparedZone
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import QUANTITY, MotionKind, Parameter, SourceKind, TimingClass
from rtshcua.model.flat.limits import DAY, MAX_COMPARED, MAX_GAP, MAX_TOTAL_VERTICES, MAX_VALUE
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy, RuleKind
from rtshcua.model.flat.situation import ConfirmAnswer
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, Zone
from rtshcua.wire import bundle, names
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted
from unit.decision.test_levels import LEVELS, levelled
from unit.decision.test_malformed_areas import REFUSED
from unit.decision.test_prepare import INVOCATIONS, POLICIES
from unit.decision.test_reference_cases import CASES
from virtual.rows import rows

MISSIONS = 3  # of a random policy
SOAK = 1_000_000
PROGRESS = Path(__file__).parents[2] / "build" / "soak-decisions.json"


@pytest.fixture(scope="module")
def native(boundary: ctypes.CDLL) -> Native:
    return Native(boundary)


def load(native: Native, policy: Policy, mission: Mission) -> tuple[PreparedInvocation, ...] | None:
    """Load a policy and a mission into both; None if both refuse either."""
    prepared = prepare(policy)
    assert (native.policy(policy) is not None) is isinstance(prepared, Refusal), prepared
    return None if isinstance(prepared, Refusal) else fly(native, prepared, mission)


def fly(native: Native, policy: PreparedPolicy, mission: Mission) -> tuple[PreparedInvocation, ...] | None:
    """Load a mission into both; None if both refuse it."""
    invocations = prepare_mission(mission, policy)
    assert (native.mission(mission) is not None) is isinstance(invocations, Refusal), invocations
    return None if isinstance(invocations, Refusal) else invocations


def agree(native: Native, invocation: PreparedInvocation, questions: list[Question]) -> None:
    """Compare the answers about the prepared step."""
    for question, answer in zip(questions, native.ask(questions), strict=True):
        assert answer == expected(invocation, question), question


@rows("name", CASES)
def test_reference_case(native: Native, name: str) -> None:
    given = dict(CASES[name][0])
    step = given.pop("invocation", STEP)
    state, now = flat.state(given.pop("values", None), given.pop("ages", None)), given.pop("now", flat.NOW)
    invocations = load(native, flat.POLICY, replace(flat.MISSION, invocations=(replace(step, step=0),)))
    assert invocations
    native.step(0)
    question = Question(state, flat.context(invocations[0].invocation, **given), now)
    (answer,) = native.ask([question])
    assert answer[:2] == (CASES[name][1], expected(invocations[0], question)[1])
    agree(native, invocations[0], [question])


def asked(native: Native, seed: int, situations: int) -> int:
    """Compare the answers about missions of a random policy; returns how often both decided."""
    of, count = Random(seed), 0
    rich = seed % 2 == 1
    policy = prepare(rich_worlds.policy(of) if rich else worlds.policy(of))
    assert isinstance(policy, PreparedPolicy), policy
    assert native.policy(policy.policy) is None
    source = rich_worlds if rich else worlds
    for _ in range(MISSIONS):
        invocations = fly(native, policy, rich_worlds.mission(source.invocation(of, policy.policy)))
        if invocations is None:
            continue
        native.step(0)
        step, monitors = invocations[0], len(policy.monitors)
        assert native.candidates() == sum(map(len, step.candidates))
        questions = [
            Question(source.state(of, monitors), source.context(of, step.invocation), source.now(of))
            for _ in range(situations)
        ]
        agree(native, step, questions)
        count += situations
    return count


@pytest.mark.slow
def test_random_worlds_are_decided_alike(native: Native) -> None:
    assert sum(asked(native, seed, 10) for seed in range(120)) > 3_000


@pytest.mark.soak
def test_a_million_random_situations_are_decided_alike(native: Native) -> None:
    """It resumes where it stopped, and continues with new worlds at the end."""
    PROGRESS.parent.mkdir(exist_ok=True)
    done = json.loads(PROGRESS.read_text()) if PROGRESS.exists() else {"seed": 1_000_000, "asked": 0}
    if done["asked"] >= SOAK:
        done["asked"] = 0
    while done["asked"] < SOAK:
        for _ in range(100):
            done["asked"] += asked(native, done["seed"], 40)
            done["seed"] += 1
        PROGRESS.write_text(json.dumps(done))


# ------------------------------------------------------------------------------------------------ refusals


@rows(("policy", "what"), POLICIES, ids=[what for _, what in POLICIES])
def test_a_malformed_policy_is_refused(native: Native, policy: Policy, what: str) -> None:
    with suppress(CborError):  # it cannot be written
        assert native.policy(policy) == "malformed", what


@rows(("zone", "what"), REFUSED, ids=[what for _, what in REFUSED])
def test_a_malformed_area_is_refused(native: Native, zone: Zone, what: str) -> None:
    assert native.policy(replace(flat.POLICY, zones=(*flat.ZONES, zone))) == "malformed", what


def test_a_malformed_mission_is_refused(native: Native) -> None:
    policy = prepare(flat.POLICY)
    assert isinstance(policy, PreparedPolicy)
    assert native.policy(flat.POLICY) is None
    for invocation, what in INVOCATIONS:
        with suppress(CborError):  # it cannot be written
            assert fly(native, policy, rich_worlds.mission(invocation)) is None, what


@pytest.mark.parametrize(("heights", "lowest", "headings", "what"), LEVELS)
def test_heights_and_headings_are_checked_alike(
    native: Native, heights: tuple[int, ...], lowest: int, headings: tuple[int, ...], what: str | None
) -> None:
    step, policy = levelled(*heights, headings=headings, lowest=lowest)
    assert native.policy(policy.policy) is None
    assert (fly(native, policy, rich_worlds.mission(replace(step, step=0))) is None) is (what is not None)


@pytest.mark.slow
def test_paths_with_heights_are_decided_alike(native: Native) -> None:
    """In policies whose survey has several heights."""
    of, decided = Random(11), 0
    while decided < 400:
        policy = prepare(worlds.policy(of))
        assert isinstance(policy, PreparedPolicy)
        if policy.policy.contracts[flat.INSPECT].motion.lowest == -1:
            continue
        assert native.policy(policy.policy) is None
        for _ in range(4):
            step = worlds.invocation(of, policy.policy)
            found = fly(native, policy, rich_worlds.mission(replace(step, step=0)))
            if found is None or not step.plan.heights:
                continue
            native.step(0)
            states = [worlds.state(of, len(policy.monitors)) for _ in range(8)]
            questions = [Question(each, worlds.context(of, found[0].invocation), worlds.now(of)) for each in states]
            agree(native, found[0], questions)
            decided += len(questions)


def mutated(native: Native, plain: PreparedPolicy, of: Random) -> tuple[bool, bool]:
    """Check that both agree on a mutated policy, and on a mutated mission under the plain policy."""
    payload = altered(bundle.policy_payload(rich_worlds.policy(of) if of.random() < 0.5 else flat.POLICY), of)
    try:
        policy = prepare(bundle.parse(names.POLICY, payload, Policy))
        slug = "malformed" if isinstance(policy, Refusal) else None
    except Untrusted as error:
        policy, slug = None, error.slug
    assert native.policy_bytes(payload) == slug, payload.hex()
    accepted = slug is None
    assert native.policy(plain.policy) is None
    payload = altered(bundle.mission_payload(flat.MISSION), of)
    try:
        invocations = prepare_mission(bundle.parse(names.MISSION, payload, Mission), plain)
        slug = "malformed" if isinstance(invocations, Refusal) else None
    except Untrusted as error:
        slug = error.slug
    assert native.mission_bytes(payload) == slug, payload.hex()
    return accepted, slug is None


@pytest.mark.slow
@pytest.mark.parametrize("count", [150, pytest.param(100_000, marks=pytest.mark.soak)])
def test_altered_input_is_refused_alike(native: Native, count: int) -> None:
    of, plain = Random(count), prepare(flat.POLICY)
    assert isinstance(plain, PreparedPolicy)
    accepted = [mutated(native, plain, of) for _ in range(count)]
    assert {True, False} == {one for one, _ in accepted} == {other for _, other in accepted}


# ---------------------------------------------------------------------------------------- places, times and charges


def test_sums_that_cancel_out_and_such_as_exceed_64_bits(native: Native) -> None:
    """Merged terms may cancel, so the bound applies to the merged sum."""
    wide = Parameter("wide", QUANTITY, "length", 0, -MAX_VALUE, MAX_VALUE, ())
    for terms in (
        [1, 511], [512], [513], [512, 1], [512, -512, 512], [-512, -1], [1 << 52, -(1 << 52)],
            [0, MAX_VALUE], [MAX_VALUE, 1], [256, 256, -1],
    ):  # fmt: skip
        for constant in (0, 512, 513, MAX_VALUE, -MAX_VALUE):
            number = flat.scaled(flat.argument(0), terms[0])
            for factor in terms[1:]:
                number = flat.apply(Op.ADD, number, flat.scaled(flat.argument(0), factor))
            code = flat.apply(Op.LE, number, flat.const(constant))
            hover = replace(
                flat.CONTRACTS[flat.HOVER], parameters=(wide,), require=(flat.clause("c", code),), reads=(), fallback=()
            )
            contracts = tuple(
                hover if at == flat.HOVER else replace(one, fallback=()) for at, one in enumerate(flat.CONTRACTS)
            )
            load(native, replace(flat.POLICY, contracts=contracts, rules=(), contingency=()), flat.MISSION)


def test_places_and_ways_are_inside_of_areas_alike(native: Native) -> None:
    of = Random(1)
    for _ in range(12):
        areas = [outlines.area(outlines.rings(of)) for _ in range(6)] + [
            outlines.polygon(outlines.zig_zag(of.randrange(2, 40)))
        ]
        circles = [Zone("c", CIRCLE, LOWEST, HIGHEST, (of.randint(-5, 5), 0, of.randint(1, 150))) for _ in range(6)]
        zones = (*flat.ZONES, *areas, *circles)
        assert native.policy(replace(flat.POLICY, zones=zones)) is None
        for number, zone in enumerate(zones):
            prepared, reach = PreparedZone(number, zone), 14 if number >= len(flat.ZONES) else 600 * M
            for _ in range(40):
                path = tuple(of.randint(-reach, reach) for _ in range(2 * of.choice([1, 1, 2, 4])))
                if of.random() < 0.3:  # a short leg
                    path = (*path[:2], path[0] + of.randint(-2, 2), path[1] + of.randint(-2, 2))
                error = of.choice([0, 0, 1, reach // 5])
                truth = prepared.along(path, (-error, -error, error, error))
                assert native.along(number, path, error) == truth, (zone, path, error)
                for y0, y1 in pairwise(path[1::2]):
                    assert native.compared(number, y0, y1, error) == prepared.shape.compared(
                        y0, y1, (-error, -error, error, error)
                    )


def test_rings_are_refused_alike(native: Native) -> None:
    """Rings on a small grid, moved and turned a little, so that they often touch."""
    of, refused = Random(2), 0
    for _ in range(150):
        rings = outlines.rings(of)
        at = of.randrange(len(rings))
        corners = list(rings[at])
        match of.randrange(4):
            case 0:
                corners[of.randrange(len(corners))] = (of.randint(-13, 13), of.randint(-13, 13))
            case 1:
                corners.reverse()
            case 2:
                corners.insert(of.randrange(len(corners)), (of.randint(-13, 13), of.randint(-13, 13)))
            case _:
                corners = [(x + of.choice([-1, 0, 1]), y) for x, y in corners]
        rings[at] = tuple(corners)
        policy = replace(flat.POLICY, zones=(*flat.ZONES, outlines.area(rings)))
        found = isinstance(prepare(policy), Refusal)
        assert (native.policy(policy) is not None) is found, rings
        refused += found
    assert 30 < refused < 149


def test_the_largest_coordinates(native: Native) -> None:
    most = MAX_COORDINATE
    far = Zone("far", 1, -1, 1, (-most, -most, most, -most, most, most, -most, most))
    assert native.policy(replace(flat.POLICY, zones=(*flat.ZONES, far))) is None
    number = len(flat.ZONES)
    prepared = PreparedZone(number, far)
    for path in ((most - 1, most - 1), (most, 0), (-most, -most, most, most), (1 - most, 0, most - 1, most - 1)):
        for error in (0, 1, 1 << 20):
            assert native.along(number, path, error) == prepared.along(path, (-error, -error, error, error))


def test_local_times_are_equal(native: Native) -> None:
    of = Random(3)
    for _ in range(40):
        made = rich_worlds.vehicle(of, flat.POLICY.vehicle)
        zones = [worlds.timed(of, each) if of.random() < 0.4 else rich_worlds.zone(of, each) for each in flat.ZONES]
        if native.policy(replace(flat.POLICY, vehicle=made, zones=tuple(zones))) is not None:
            continue  # times of the day and of the week
        local = local_time(made)
        for _ in range(12):
            now = rich_worlds.now(of)
            low, error = now.utc_us, of.choice([now.utc_error_us, H, 8 * H, DAY])
            high = low + of.choice([0, 0, 1, H, 50 * DAY])
            spans, errors = ((low, high),), (error, error)
            for number, zone in enumerate(zones):
                if timed(zone):
                    truth = Times(zone, local).truth(spans, errors, 0)
                    assert native.exists(number, low, high, error) == truth, (zone, made, now)
            start, end = (
                of.choice([0, 8 * H, of.randrange(DAY)]),
                of.choice([0, 8 * H - 1, 8 * H, DAY, of.randrange(DAY)]),
            )
            truth = daily(start, end, local).truth(spans, errors)
            assert native.time_of_day(start, end, low, high, error) == truth, (start, end, made, now)


def test_the_way_home_takes_as_much(native: Native) -> None:
    """With speeds and heights at the ends of their ranges the charge exceeds 64 bits."""
    of = Random(4)
    for _ in range(80):
        made = rich_worlds.vehicle(of, flat.POLICY.vehicle)
        assert native.policy(replace(flat.POLICY, vehicle=made)) is None
        asked_for = of.choice([0, 1, 4 * M, 1 << 20])
        energy = Energy(flat.CONTRACTS[flat.GOTO], made, asked_for)
        for _ in range(20):
            distance = of.choice([0, 1, of.randrange(10 * M), of.randrange(1 << 29), 759_250_125])
            if made.speeds is not None and of.random() < 0.5:  # it just comes to speed
                homeward = min(asked_for or made.speeds.homeward, made.speeds.homeward)
                speed = max(1, min(homeward, made.speeds.air - made.speeds.wind))
                distance = max(speed * speed // made.speeds.acceleration - made.home_within, 0)
            low, high = sorted(
                of.choice([0, 20 * M, -M, MAX_VALUE, -MAX_VALUE, of.randrange(1 << 30)]) for _ in range(2)
            )
            drain = of.choice([0, 0, 1, 1_760, MOST_DRAIN, MOST_DRAIN + 1, MAX_VALUE, -1])
            needed = energy.way_home(distance, (low, high), drains(point(drain))[1])
            for charge in (needed - 1, needed, needed + 1, 0, -1, MAX_VALUE):
                if -MAX_VALUE <= charge <= MAX_VALUE:
                    assert native.brings_home(charge, distance, low, high, asked_for, drain) is (charge >= needed), (
                        made,
                        distance,
                        low,
                        high,
                        drain,
                    )


def test_texts_match_with_any_white_space(native: Native) -> None:
    of = Random(5)
    pieces = [
        "a",
        "b",
        "ab",
        " ",
        "  ",
        "\t",
        "\n",
        "\x1c",
        "\x1f",
        "\x85",
        "\xa0",
        "\u1680",
        "\u2003",
        "\u200b",
        "\u2028",
        "\u202f",
        "\u205f",
        "\u3000",
        "\u3001",
        "\xe9",
        "\U0001f600",
    ]
    for _ in range(3_000):
        one, other = ("".join(of.choice(pieces) for _ in range(of.randrange(7))) for _ in range(2))
        assert native.same_words(one, other) is (one.split() == other.split()), (one, other)
        assert native.same_words(one, " ".join(one.split()))


@pytest.mark.slow
def test_an_outline_of_as_many_corners_as_fit(native: Native) -> None:
    """Its edges span nearly all heights: the worst case for the sweep and for containment."""
    ring = outlines.zig_zag(MAX_TOTAL_VERTICES // 2)
    zone = outlines.area([ring])
    payload = replace(
        flat.POLICY,
        zones=(zone,),
        declared=1,
        tables=(),
        contracts=(),
        rules=(),
        airspace=None,
        contingency=(),
        sets=(),
    )
    assert native.policy(payload) is None
    for x, y in (ring[2], ring[1_000], ring[32_000]):
        assert native.along(0, (x, y + 1), 0) == TRUE
        assert native.along(0, (x, y - 1), 0) == native.along(0, (x, y), 0) == FALSE
        assert native.along(0, (x, y - 1, x, y + 1), 0) == TRUE | FALSE
    broken = (*ring[:1_001], (ring[1_001][0] + 8, ring[1_001][1]), *ring[1_002:])
    assert native.policy(replace(payload, zones=(outlines.area([broken]),))) == "malformed"


def test_a_long_survey_is_remembered_with_its_step(native: Native) -> None:
    """The result of a path for a zone is computed once; another start gives another leg."""
    inspect = flat.INVOCATIONS[flat.INSPECTION_STEP]
    path = tuple(part for at in range(300) for part in (110 * M + 200 * at, 20 * M * (-1) ** at))
    long = replace(inspect, plan=replace(inspect.plan, kind=MotionKind.COVER, path=path))
    invocations = load(native, flat.POLICY, rich_worlds.mission(long))
    assert invocations
    native.step(0)
    of = Random(6)
    context = flat.context(long)
    places = [
        {flat.POSITION_X: of.randrange(-600, 600) * M, flat.POSITION_Y: of.randrange(-600, 600) * M} for _ in range(60)
    ]
    agree(native, invocations[0], [Question(flat.state(dict(place)), context, flat.NOW) for place in places])


def test_paths_that_are_compared_with_too_many_edges_are_refused_alike(native: Native) -> None:
    """A request waits for the results of its step's path for each zone, which must not take long in flight."""
    band = outlines.polygon(tuple((x + 300 * M, y) for x, y in outlines.zig_zag(2_000)))
    policy = replace(flat.POLICY, zones=(*flat.ZONES, band))
    prepared = prepare(policy)
    assert isinstance(prepared, PreparedPolicy), prepared
    south, north, error = -20 * M, 20 * M, policy.vehicle.position_error
    each = sum(1 + zone.shape.compared(south, north, (-error, -error, error, error)) for zone in prepared.tables.zones)
    assert each > 2 * len(band.data) // 2, "an edge is looked at in each band that it runs through"
    legs = MAX_COMPARED // each
    step = flat.INVOCATIONS[flat.INSPECTION_STEP]
    for more in (0, 1):
        path = tuple(part for at in range(legs + 1 + more) for part in (110 * M + 20 * at, north if at % 2 else south))
        of = rich_worlds.mission(replace(step, plan=replace(step.plan, path=path)))
        assert (load(native, policy, of) is None) is bool(more)


def test_the_last_phase_that_a_step_can_be_valid_in(native: Native) -> None:
    phases = (*(f"phase_{number}" for number in range(62)), "inspection")
    step = replace(flat.INVOCATIONS[flat.INSPECTION_STEP], phase=62, phases=1 << 62)
    invocations = load(native, flat.POLICY, replace(rich_worlds.mission(step), phases=phases))
    assert invocations
    native.step(0)
    contexts = [flat.context(step, phase=phase) for phase in (-1, 0, 61, 62, 63, 64, 65_535)]
    agree(native, invocations[0], [Question(flat.state(), context, flat.NOW) for context in contexts])


def test_every_two_answers_at_the_end_of_their_time(native: Native) -> None:
    low = replace(STEP, arguments=(flat.BRIDGE, 8 * M, 0, 4 * M), plan=replace(STEP.plan, altitude=8 * M))
    now = flat.NOW.monotonic_us
    released = now - 30 * S
    answers = [
        ConfirmAnswer(flat.CONFIRM_RULE, role, granted, now + late, person)
        for role, granted, late, person in product((0, 1), (0, 1), (-S, 0, 1), (0, 1))
    ]
    given = [(), *((one,) for one in answers), *product(answers, answers)]
    patient = tuple(replace(one, deadline_us=5 * S) for one in flat.CONTRACTS)
    signals = tuple(replace(one, stale_us=20 * S) for one in flat.SIGNALS)  # so that the release is what ends it
    for second in (-1, 0, 1):
        rules = list(flat.RULES)
        rules[flat.CONFIRM_RULE] = replace(rules[flat.CONFIRM_RULE], second=second)
        policy = replace(flat.POLICY, rules=tuple(rules), contracts=patient, signals=signals)
        invocations = load(native, policy, rich_worlds.mission(replace(low, contract=patient[flat.INSPECT])))
        assert invocations
        native.step(0)
        questions = [
            Question(
                flat.state({flat.HEIGHT: 8 * M}),
                flat.context(low, released_us=released, approvals=each),
                replace(flat.NOW, monotonic_us=at),
            )
            for each in given
            for at in (now, now + 1)
        ]
        agree(native, invocations[0], questions)


def test_every_source_and_timing_class(native: Native) -> None:
    for timing_class, source in product(TimingClass, SourceKind):
        contracts = tuple(replace(one, timing_class=timing_class) for one in flat.CONTRACTS)
        rules = (flat.rule(RuleKind.PERMIT),)
        step = replace(STEP, source=source, contract=contracts[flat.INSPECT])
        invocations = load(native, replace(flat.POLICY, contracts=contracts, rules=rules), rich_worlds.mission(step))
        assert invocations
        native.step(0)
        agree(native, invocations[0], [Question(flat.state(), flat.context(step), flat.NOW)])


def test_an_admission_that_rests_on_a_temporal_monitor(native: Native) -> None:
    """It is valid for `MAX_GAP`, even if no value that was read is stale by then."""
    charged = flat.clause("charged", flat.apply(Op.GT, flat.signal(flat.BATTERY), flat.const(0)))
    asked_for = flat.clause("charged for 1 s", (Op.MONITOR, 0, 0))
    inspect = flat.CONTRACTS[flat.INSPECT]
    inspect = replace(inspect, assume=(*inspect.assume, asked_for), deadline_us=60 * S)
    policy = replace(
        flat.POLICY,
        monitors=(Monitor(MonitorKind.FOR_LAST, S, charged),),
        contracts=tuple(inspect if at == flat.INSPECT else one for at, one in enumerate(flat.CONTRACTS)),
        signals=tuple(replace(one, stale_us=20 * S) for one in flat.SIGNALS),
    )
    invocations = load(native, policy, rich_worlds.mission(replace(STEP, contract=inspect)))
    assert invocations
    native.step(0)
    questions = [
        Question(replace(flat.state(None, ages), monitors=said), flat.context(), flat.NOW)
        for ages, said in product(
            ({}, {flat.LINK: 19 * S}, {flat.LINK: 20 * S}, {flat.LINK: 20 * S + 1}), ((1,), (2,), (4,), (3,), ())
        )
    ]
    assert native.ask(questions[:1])[0][5] == flat.NOW.monotonic_us + MAX_GAP
    agree(native, invocations[0], questions)


def test_heights_at_floor_and_ceiling(native: Native) -> None:
    """Both are outside, for places that must not and that must be inside."""
    inside: tuple[int, ...] = (Op.POSITION_IN, flat.BRIDGE_GROWN, 0)
    zones = tuple(
        replace(one, floor=20 * M, ceiling=30 * M) if at == flat.BRIDGE_GROWN else one
        for at, one in enumerate(flat.ZONES)
    )
    for code in (inside, flat.apply(Op.NOT, inside)):
        rules = (*flat.RULES, flat.rule(RuleKind.DEGRADE, when=flat.clause("there", code), target=flat.link(flat.LAND)))
        policy = replace(flat.POLICY, rules=rules, zones=zones, vehicle=replace(flat.POLICY.vehicle, position_error=0))
        contract = replace(
            flat.CONTRACTS[flat.INSPECT], maintain=(flat.clause("m", code),), reads=(0, 1, 2, 3, 4, 5, 6, 7)
        )
        contracts = tuple(contract if at == flat.INSPECT else one for at, one in enumerate(flat.CONTRACTS))
        for altitude in (19, 20, 21, 30):
            values = (flat.BRIDGE, altitude * M, 0, 4 * M)
            step = replace(STEP, contract=contract, arguments=values, plan=replace(STEP.plan, altitude=altitude * M))
            invocations = load(native, replace(policy, contracts=contracts), rich_worlds.mission(step))
            assert invocations
            native.step(0)
            heights = [level * M + more for level in (20, 30) for more in (-1, 0, 1)] + [None]
            agree(
                native,
                invocations[0],
                [Question(flat.state({flat.HEIGHT: each}), flat.context(step), flat.NOW) for each in heights],
            )


def test_sums_of_the_height_over_a_volume(native: Native) -> None:
    """Only the height ranges over a volume; its terms may cancel."""
    height, level = flat.signal(flat.HEIGHT), flat.const(15 * M)
    sums = (height, flat.scaled(height, -1), flat.apply(Op.SUB, level, height), flat.apply(Op.SUB, height, height))
    for op, number in product((Op.LT, Op.LE, Op.GT, Op.GE, Op.EQ, Op.NE), sums):
        clauses = tuple(flat.clause("m", flat.apply(op, number, flat.const(at * M))) for at in (-20, -5, 0, 15, 20))
        for clause in clauses:
            contract = replace(
                flat.CONTRACTS[flat.TAKEOFF], maintain=(clause,), reads=(flat.BATTERY, flat.HEIGHT, flat.WIND, flat.FIX)
            )
            contracts = tuple(contract if at == flat.TAKEOFF else one for at, one in enumerate(flat.CONTRACTS))
            step = replace(flat.INVOCATIONS[0], contract=contract)
            invocations = load(native, replace(flat.POLICY, contracts=contracts), rich_worlds.mission(step))
            assert invocations
            native.step(0)
            heights = (0, 5 * M, 20 * M, 25 * M, None)
            context = flat.context(step, phase=0)
            agree(
                native,
                invocations[0],
                [Question(flat.state({flat.HEIGHT: each}), context, flat.NOW) for each in heights],
            )
