"""Check scenarios: their mission, faults and endings exist, and their start is valid.

Only the scenarios of the compiled file itself are checked, not those of imported files.
"""

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.excerpt import short
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.checks.expectations import check_expectation
from rtshcua.ground.checker.condition_nodes import walk
from rtshcua.ground.checker.conditions import check_condition, is_about_phase
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.faults import NAMED, fault_of, is_fitted
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.ground.checker.lookup import find_flown, find_skill, find_zone
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.model.faults import GimbalStuck, PayloadFault
from rtshcua.model.ir.expression import Condition, Edge, ForLast, Near, Quantity, WithinLast
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.scenarios import (
    AfterStepDecl,
    AtTimeDecl,
    Beginning,
    Begins,
    Charge,
    DecidesDecl,
    Delay,
    Demand,
    Ends,
    FaultCall,
    FliesDecl,
    Keeps,
    Lands,
    OnConditionDecl,
    Reacts,
    ScenarioDecl,
    Seeds,
)
from rtshcua.model.quantity import Dimension
from rtshcua.model.scenario import ENDINGS, FLAVOURS, MAX_SEEDS

#: any obstacle, in `expect distance to obstacle`
OBSTACLE = "obstacle"
#: the endings as sources write them
ENDS = tuple(each.replace("-", "_") for each in ENDINGS)
#: equipment of the vehicle, in `start`
FITTED = ("camera", "gimbal")
#: the parts of `start` besides: the charge, the wind, and the time
BATTERY, WIND, AT = "battery", "wind", "at"


def check_scenarios(context: CheckContext) -> None:
    """Report every scenario that cannot be flown, or whose expectation is impossible."""
    seen: dict[str, ScenarioDecl] = {}
    for scenario in context.symbols.scenarios:
        first = seen.setdefault(scenario.name.text, scenario)
        if first is not scenario:
            context.report.add(
                codes.SAME_SCENARIO,
                scenario.name.span,
                f"two scenarios have the name `{short(scenario.name.text)}`",
                help="rename one of them: reports identify scenarios by name",
                labels=[(first.name.span, "first declared here")],
            )
        _check(context, scenario)


def _check(context: CheckContext, scenario: ScenarioDecl) -> None:
    mission = find_flown(context, scenario.mission)
    if mission is not None:
        _values(context, scenario, mission)
    _flavours(context, scenario)
    if scenario.seeds is not None:
        _seeds(context, scenario.seeds)
    before = len(context.report.found)
    for beginning in scenario.start:
        _beginning(context, beginning)
    _once(context, scenario)
    if len(context.report.found) == before:
        _lacking(context, scenario)
    for incident in scenario.incidents:
        moment = incident.moment
        _delay(context, moment.delay)
        match moment:
            case AtTimeDecl():
                pass
            case AfterStepDecl():
                _step(context, moment, mission)
            case OnConditionDecl():
                _condition(context, moment.condition)
        fault_of(context, incident.fault)
    for demand in scenario.demands:
        _demand(context, demand)


def _values(context: CheckContext, scenario: ScenarioDecl, mission: MissionDecl) -> None:
    """Report mission parameters without a default."""
    lacking = [each for each in mission.parameters if each.default is None]
    if lacking:
        context.report.add(
            codes.MISSING_ARGUMENT,
            scenario.mission.span,
            f"`{mission.name.text}` has no value for " + " and ".join(f"`{each.name.text}`" for each in lacking),
            help="declare a default: a scenario flies a mission with the defaults of its parameters",
            labels=[(each.span, f"`{each.name.text}` is declared here, without a default") for each in lacking],
        )


def _flavours(context: CheckContext, scenario: ScenarioDecl) -> None:
    seen: dict[str, Span] = {}
    for name in scenario.flavours:
        if one_of(context, codes.UNKNOWN_AUTOPILOT, name, FLAVOURS, "kind of autopilot"):
            first = seen.setdefault(name.text, name.span)
            if first is not name.span:
                context.report.add_twice(codes.DUPLICATE_NAME, name.span, f"`{name.text}`", "named", first)


def _seeds(context: CheckContext, seeds: Seeds) -> None:
    first, last = seeds.first, seeds.last
    if _ascending(context, first, last) and last.value - first.value >= MAX_SEEDS:
        context.report.add(
            codes.TOO_MANY,
            seeds.span,
            f"the scenario has {last.value - first.value + 1} seeds; the limit is {MAX_SEEDS}",
        )


def _ascending(context: CheckContext, low: Quantity, high: Quantity) -> bool:
    if low.value <= high.value:
        return True
    span = low.span.to(high.span)
    swapped = f"{context.report.text(high.span)} .. {context.report.text(low.span)}"
    context.report.add(
        codes.EMPTY_RANGE,
        span,
        f"the range `{context.report.text(span)}` is empty: its lower end is above its upper end",
        help=f"write `{swapped}`",
        fix=(span, swapped, "swap the ends"),
    )
    return False


def _beginning(context: CheckContext, beginning: Beginning) -> None:
    if isinstance(beginning, Begins):
        return
    name = beginning.name
    written = context.report.text(beginning.span)
    if isinstance(beginning, Charge) and name.text == BATTERY:
        quantity(context, beginning.value, Dimension.RATIO, positive=False, most=10_000)
    elif isinstance(beginning, FaultCall) and name.text == WIND:
        fault_of(context, beginning)
    elif isinstance(beginning, FaultCall) and name.text in FITTED:
        is_fitted(context, beginning)
    elif isinstance(beginning, FaultCall) and name.text in NAMED and name.text != BATTERY:
        context.report.add(
            codes.BAD_START,
            beginning.span,
            f"`{name.text}` is not allowed in `start`",
            help=f"write `at 0 s {written}`, outside of `start`",
        )
    else:
        known = (BATTERY, WIND, *FITTED)
        misspelt = name.text not in known
        context.report.add(
            codes.BAD_START,
            beginning.span,
            f"`{written}` is not allowed in `start`",
            help=(suggestion(name.text, known) if misspelt else None)
            or "write `start battery = 80 %`, `start wind(speed = 3 m/s, from = 270 deg)`, `start camera(), gimbal()`",
            fix=correction(context.report, name.span, name.text, known) if misspelt else None,
        )


def _lacking(context: CheckContext, scenario: ScenarioDecl) -> None:
    """Report faults of equipment that the start leaves out."""
    given = [each for each in scenario.start if isinstance(each, FaultCall) and each.arguments]
    fitted = {each.name.text: each for each in given if each.name.text in FITTED and not is_fitted(context, each)}
    for incident in scenario.incidents:
        kind = NAMED.get(incident.fault.name.text)
        lacks = "gimbal" if kind is GimbalStuck else "camera"
        if kind is not None and issubclass(kind, PayloadFault) and lacks in fitted:
            context.report.add(
                codes.BAD_START,
                fitted[lacks].span,
                f"the vehicle starts without the {lacks} that fails later",
                help=f"write `{lacks}()`, or leave the fault out",
                fix=(fitted[lacks].span, f"{lacks}()", f"write `{lacks}()`"),
                labels=[(incident.fault.span, "fails here")],
            )


def _once(context: CheckContext, scenario: ScenarioDecl) -> None:
    seen: dict[str, Span] = {}
    for beginning in scenario.start:
        what = AT if isinstance(beginning, Begins) else beginning.name.text
        first = seen.setdefault(what, beginning.span)
        if first is not beginning.span:
            context.report.add(
                codes.GIVEN_TWICE,
                beginning.span,
                f"`{what}` is given twice",
                help="keep one of them",
                labels=[(first, "first given here")],
            )


def _delay(context: CheckContext, delay: Delay | None) -> None:
    if delay is None:
        return
    before = len(context.report.found)
    quantity(context, delay.low, Dimension.DURATION, positive=False)
    if delay.high is not delay.low:
        quantity(context, delay.high, Dimension.DURATION, positive=False)
        if len(context.report.found) == before:
            _ascending(context, delay.low, delay.high)


def _step(context: CheckContext, moment: AfterStepDecl, mission: MissionDecl | None) -> None:
    skill = find_skill(context, moment.skill)
    if skill is None or mission is None:
        return
    name, number = moment.skill.text, 1 if moment.number is None else moment.number.value
    steps = [step.skill.text for phase in mission.phases for step in phase.steps]
    count = steps.count(name)
    if 1 <= number <= count:
        return
    if count == 0:
        message = f"`{mission.name.text}` has no step `{name}`"
        help = suggestion(name, steps) or "its steps are " + ", ".join(f"`{each}`" for each in dict.fromkeys(steps))
        fix = correction(context.report, moment.skill.span, name, steps)
    else:
        message = f"`{mission.name.text}` has no step `{name}` number {number}"
        help = f"the last `{name}` is number {count}"
        fix = None
    context.report.add(
        codes.NO_SUCH_STEP,
        moment.skill.span if count == 0 or moment.number is None else moment.number.span,
        message,
        help=help,
        labels=[(mission.name.span, "the mission is declared here")],
        fix=fix,
    )


def _condition(context: CheckContext, condition: Condition) -> None:
    before = len(context.report.found)
    check_condition(context.scope(), condition)
    if len(context.report.found) > before:
        return
    for part in walk(condition):
        if isinstance(part, ForLast | WithinLast | Near | Edge):
            context.report.add(
                codes.BAD_TRIGGER,
                part.span,
                "a fault cannot wait for a temporal condition",
                help="remove `for the last`, `within the last`, `rising` and `falling`: `when` triggers once its "
                "condition becomes true, `2 s after when ...` 2 s later",
            )
        elif is_about_phase(part):
            context.report.add(
                codes.BAD_TRIGGER,
                part.span,
                "a fault cannot wait for a phase",
                help="write `after` and the first step of that phase",
            )


def _demand(context: CheckContext, demand: Demand) -> None:
    match demand:
        case DecidesDecl():
            expected = demand.decision
            check_expectation(context, expected, None, None)
            if expected.target is not None:
                find_skill(context, expected.target)
        case Ends():
            for name in demand.endings:
                one_of(context, codes.UNKNOWN_ENDING, name, ENDS, "ending")
        case FliesDecl():
            find_skill(context, demand.skill)
        case Reacts():
            quantity(context, demand.most, Dimension.DURATION)
        case Keeps():
            if demand.place.text != OBSTACLE:
                find_zone(context, demand.place)
            quantity(context, demand.least, Dimension.LENGTH)
        case Lands():
            find_zone(context, demand.zone)
