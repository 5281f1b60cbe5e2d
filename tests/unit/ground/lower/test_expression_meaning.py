"""Random well-typed expressions, lowered and evaluated as on board, agree with a naive reading.

The monitors receive a history of observations. The value of a condition at the last observation is compared with its
definition over fractions. Conditions that do not fit on board are not counted.
"""

from collections.abc import Sequence
from functools import cache
from random import Random
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from reference.naive_expression import Names, World, truth
from reference.random_expressions import ENUMERATIONS, PHASES, STEP, ZONES, Maker
from rtshcua.decision.evaluate import NO_PHASE, Environment, Tables, build
from rtshcua.decision.prepare import PreparedMonitor, SlotLimit
from rtshcua.decision.temporal import initial, observe
from rtshcua.decision.times import LocalTime
from rtshcua.decision.tree import CodeScope as CodeScope
from rtshcua.decision.tree import parse as parse_code
from rtshcua.decision.tree import scope_of
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Value, point
from rtshcua.decision.zones import PreparedZone, WellKnown
from rtshcua.diagnostics.span import Source
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.name_scope import Scope
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.symbols import Symbols, collect
from rtshcua.ground.language.parse import parse
from rtshcua.ground.lower.conditions import ConditionLowering, ConditionPlace
from rtshcua.ground.lower.contracts import cells_of
from rtshcua.ground.lower.tables import SignalSlots, SourceTable
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import CHOICE, QUANTITY
from rtshcua.model.flat.limits import MAX_MONITORS, MAX_VALUE
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone
from rtshcua.model.ir.expression import Condition
from rtshcua.model.quantity import Dimension

SOURCE = """
enum gps_fix = GPS_FIX_TYPE {
  no_gps = 0, no_fix = 1, fix_2d = 2, fix_3d = 3, dgps = 4, rtk_float = 5, rtk_fixed = 6, static = 7, ppp = 8,
}
signal position : position = GLOBAL_POSITION_INT.lat, GLOBAL_POSITION_INT.lon  stale after 2 s
signal height : altitude = GLOBAL_POSITION_INT.relative_alt  stale after 2 s
signal gps.fix : gps_fix = GPS_RAW_INT.fix_type  stale after 2 s
signal gps.accuracy : length = GPS_RAW_INT.h_acc  stale after 2 s
signal satellites : count = GPS_RAW_INT.satellites_visible  stale after 2 s
signal battery : ratio = BATTERY_STATUS.battery_remaining  stale after 5 s
signal link.quality : ratio = RADIO_STATUS.txbuf  stale after 5 s
signal wind.speed : speed = WIND_COV.wind_x, WIND_COV.wind_y  stale after 10 s
signal obstacle.distance : length = DISTANCE_SENSOR.current_distance where orientation = 0  stale after 2 s
zone city = circle(47 N, 8 E, 5 m)
zone school = circle(47 N, 8 E, 5 m)
skill probe(
  up: altitude in -100 m .. 100 m, gap: length in -100 m .. 100 m, pace: speed in -100 m/s .. 100 m/s,
  wait: duration in 0 s .. 10 min, look: one of near, far, all,
) { motion hold }
"""
DIMENSIONS = {
    "height": Dimension.ALTITUDE,
    "gps.accuracy": Dimension.LENGTH,
    "satellites": Dimension.COUNT,
    "battery": Dimension.RATIO,
    "link.quality": Dimension.RATIO,
    "wind.speed": Dimension.SPEED,
    "obstacle.distance": Dimension.LENGTH,
    "up": Dimension.ALTITUDE,
    "gap": Dimension.LENGTH,
    "pace": Dimension.SPEED,
    "wait": Dimension.DURATION,
}
ARGUMENTS = ("up", "gap", "pace", "wait", "look")
CIRCLES = {"city": (0, 0, 5000), "school": (3000, 4000, 5000)}
MEMBERS = {name: {member: number for number, member in enumerate(members)} for name, members in ENUMERATIONS.items()}
NAMES = Names(DIMENSIONS, MEMBERS, CIRCLES)
LETTERS = {TRUE: "T", FALSE: "F", UNKNOWN: "U"}


class Circles:
    """The zones of the flat form, as far as conditions use them."""

    flat = tuple(Zone(name, CIRCLE, LOWEST, HIGHEST, (x, y, r * r)) for name, (x, y, r) in CIRCLES.items())

    def zone(self, name: str, margin: int, **_: object) -> int:
        assert not margin
        return ZONES.index(name)


class Lowered(NamedTuple):
    """A lowered condition: its code and its evaluator."""

    policy: Any
    condition: Any
    code: tuple[int, ...]


@cache
def declared() -> tuple[Symbols, Any]:
    parsed = parse(Source("x", SOURCE))
    assert parsed.diagnostics == ()
    return collect([parsed.unit]), dialect.load()


def lowered(node: Condition) -> Lowered | None:
    """Lower a well-typed condition; None if it does not fit on board or uses an impossible value."""
    symbols, known = declared()
    report = Report({})
    context = CheckContext(symbols, report, known)
    scope = Scope(symbols, report, context.arguments(symbols.skills["probe"]))
    check_condition(scope, node)
    if report.found:  # it uses a value that the signal never has
        assert {found.code.id for found in report.found} == {"E0325"}, (node, report.found)
        return None
    slots = SignalSlots(context)
    well_known = [slots.of(name) for name in ("position", "height", "battery")]
    zones: Any = Circles()
    conditions = ConditionLowering(context, slots, zones, SourceTable(report, {}))
    clause = conditions.clause(node, ConditionPlace(scope, cells_of(symbols.skills["probe"]), strict=True))
    monitors = conditions.monitors.all
    if report.found or len(monitors) > MAX_MONITORS:
        assert {found.code.id for found in report.found} <= {"E1002", "E1003"}
        return None
    flat: Any = SimpleNamespace(
        slots=slots.count, signals=slots.signals, zones=Circles.flat, tables=(), sets=tuple(conditions.sets.all),
        monitors=monitors, phases=conditions.sets.phases,
    )  # fmt: skip
    where = WellKnown(well_known[0], well_known[0] + 1, well_known[1], well_known[2])
    tables = Tables(
        zones=tuple(PreparedZone(number, zone) for number, zone in enumerate(Circles.flat)),
        tables=(),
        sets=tuple(map(frozenset, flat.sets)),
        known=where,
        local=LocalTime(0),
    )
    code_scope = scope_of(flat)

    def built(code: tuple[int, ...], among: CodeScope) -> Any:
        tree = parse_code(code, among)
        assert not isinstance(tree, str), (node, tree)
        return build(tree, tables)

    prepared = tuple(
        PreparedMonitor(each.kind, each.window_us, built(each.when.code, code_scope.inside_monitor(number)))
        for number, each in enumerate(monitors)
    )
    cells = {cell: CHOICE if name == "look" else QUANTITY for name, cell in cells_of(symbols.skills["probe"]).items()}
    condition = built(clause.code, code_scope._replace(cells=(cells,)))
    limit = SlotLimit(10**9, MAX_VALUE)
    limits = (limit,) * slots.count
    bounds = tuple((each,) * slots.count for each in (limit.stale_us, -limit.most, limit.most))
    policy = SimpleNamespace(policy=flat, monitors=prepared, limits=limits, bounds=bounds, seen=None)
    return Lowered(policy, condition, clause.code)


def histories(random: Random) -> list[World]:
    """Draw up to four observations. Signals are sometimes missing; arguments are always present and constant."""
    arguments = {name: random.randint(-4, 8) * STEP[DIMENSIONS[name]] for name in ARGUMENTS if name != "look"}
    look = random.randrange(3)
    at_us = 0
    found: list[World] = []
    for _ in range(random.randint(1, 4)):
        numbers: dict[str, int | None] = {
            name: None if random.random() < 0.15 else random.randint(-4, 8) * STEP[dimension] + random.choice([0, 0, 1])
            for name, dimension in DIMENSIONS.items()
        }
        fix = None if random.random() < 0.15 else random.randrange(9)
        place = random.choice([(0, 0), (3000, 4000), (2000, 1000), (9000, 0), (3001, 4000)])
        known = random.random() < 0.85 and numbers["height"] is not None
        utc_us = random.randrange(24) * 3_600_000_000 + random.choice([-1, 0, 1])
        found.append(
            World(at_us, {**numbers, **arguments}, {"gps.fix": fix, "look": look}, place if known else None, utc_us)
        )
        at_us += random.choice([1, 400_000, 1_000_000, 1_000_001, 2_000_000])
    return found


def state_of(world: World, policy: Any) -> State:
    values: list[int | None] = [None] * policy.slots
    for signal in policy.signals:
        if signal.name == "position":
            values[signal.slot : signal.slot + 2] = world.position or (None, None)
        else:
            values[signal.slot] = (world.ordinals if signal.name == "gps.fix" else world.numbers)[signal.name]
    return State(tuple(values), (0,) * policy.slots)


def on_board(found: Lowered, history: Sequence[World], phase: str | None) -> str:
    """Return the value of the condition after the monitors received the whole history."""
    flat, memory, truths = found.policy.policy, initial(found.policy), ()
    for world in history:
        now = Now(monotonic_us=world.at_us, utc_us=world.utc_us, utc_error_us=0)
        memory, truths = observe(memory, found.policy, state_of(world, flat), now)
    last = history[-1]
    slots: list[Value] = [MISSING if value is None else point(value) for value in state_of(last, flat).values]
    cells = [last.ordinals["look"] if name == "look" else last.numbers[name] for name in ARGUMENTS]
    number = flat.phases.index(phase) if phase in flat.phases else NO_PHASE
    at = Environment(
        [*slots, MISSING], [point(cell or 0) for cell in cells], ((last.utc_us, last.utc_us),), (0, 0), None, truths,
        number,
    )  # fmt: skip
    return LETTERS[found.condition(at)]


SAMPLE = 400


def campaign(seed: int, expressions: int) -> tuple[int, dict[str, int]]:
    """Compare a number of expressions that fit on board, each in three histories. Return the counts by truth value."""
    random = Random(seed)
    maker = Maker(random)
    done = 0
    truths = {"T": 0, "F": 0, "U": 0}
    while done < expressions:
        node = maker.condition(random.randint(0, 3))
        found = lowered(node)
        if found is None:
            continue
        done += 1
        for _ in range(3):
            history, phase = histories(random), random.choice([*PHASES, "other"])
            expected = truth(node, history, NAMES, phase)
            assert on_board(found, history, phase) == expected, (node, history, phase)
            truths[expected] += 1
    return done, truths


def test_lowered_expressions_agree_with_a_naive_reading() -> None:
    done, truths = campaign(1, SAMPLE)
    assert done == SAMPLE
    assert min(truths.values()) > SAMPLE // 4, truths


@pytest.mark.soak
@pytest.mark.parametrize("part", range(10))
def test_200_000_lowered_expressions_agree_with_a_naive_reading(part: int) -> None:
    done, truths = campaign(100 + part, 20_000)
    assert done == 20_000
    assert sum(truths.values()) == 60_000
