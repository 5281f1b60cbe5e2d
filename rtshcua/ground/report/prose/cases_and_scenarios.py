"""Describes tests, their nominals, and scenarios."""

from collections.abc import Iterator, Sequence
from typing import Final, assert_never

from rtshcua.ground.report.prose.condition_phrases import describe_condition
from rtshcua.ground.report.prose.phrases import Vocabulary, describe_value, listed, name, named, quantity
from rtshcua.ground.report.prose.rules_and_skills import describe_argument
from rtshcua.ground.report.prose.zones_and_vehicle import utc
from rtshcua.model.decision import Decision
from rtshcua.model.ir.expression import Quantity, Reference
from rtshcua.model.ir.scenarios import (
    AfterStepDecl,
    AtTimeDecl,
    Begins,
    Charge,
    DecidesDecl,
    Delay,
    Demand,
    Ends,
    FaultCall,
    FliesDecl,
    IncidentDecl,
    Keeps,
    Lands,
    OnConditionDecl,
    Reacts,
    ScenarioDecl,
)
from rtshcua.model.ir.tests import (
    Answer,
    Asker,
    Expectation,
    InPhase,
    Instant,
    Named,
    NominalDecl,
    Premises,
    RequestDecl,
    Subject,
    TableCell,
)
from rtshcua.model.outcome import Outcome

_OUTCOMES: Final = {
    "allow": "it is allowed",
    "deny": "it is denied",
    "defer": "it must wait",
    "fallback": "something else is flown",
}


def describe_premises(premises: Premises, names: Vocabulary) -> Iterator[str]:
    """Yield the premises of a decision, one line each."""
    for each in premises.given:
        yield describe_given(each.subject, each.cell, names)
    if premises.instant is not None:
        yield _instant(premises.instant)
    if premises.phase is not None:
        yield _phase(premises.phase)
    for answer in premises.answers:
        yield _answer(answer)
    if premises.released is not None:
        yield f"its turn came {_ago(premises.released)}"
    if premises.issued is not None:
        ahead, distance = premises.issued.ahead, quantity(premises.issued.distance)
        yield f"it was issued {f'in {distance}, ahead of the decision' if ahead else f'{distance} ago'}"
    if premises.in_force is not None:
        yield f"version {premises.in_force.version} of the policy is in force"
    if premises.identity is not None:
        yield f"the vehicle is “{premises.identity.text}”"
    if premises.replayed is not None:
        yield "the request was used before"
    if premises.tampered is not None:
        yield "the presented request differs from the signed one"


def describe_nominal(nominal: NominalDecl, names: Vocabulary) -> Iterator[str]:
    """Yield the premises of a nominal, one line each."""
    yield f"under the policy {name(nominal.policy.text)}"
    yield f"on the vehicle {name(nominal.vehicle.text)}"
    if nominal.asker is not None:
        yield describe_asker(nominal.asker)
    yield from describe_premises(nominal.premises, names)


def describe_given(subject: Subject, cell: TableCell, names: Vocabulary) -> str:
    """Describe the value of a signal, a parameter, or a condition over time: `battery` is 20 %."""
    words = _cell(cell, names)
    if isinstance(subject, Named):
        known = subject.name.text in names.signals
        return f"{'' if known else 'the asked '}{name(subject.name.text)} is {words}"
    return f"it is {words} that {describe_condition(subject.condition, names)}"


def _cell(cell: TableCell, names: Vocabulary) -> str:
    if cell.value is None:
        words = "not known"
    elif isinstance(cell.value, Quantity) and cell.value.datum is None:
        words = quantity(cell.value)
    elif isinstance(cell.value, Reference) and cell.value.name in ("true", "false"):
        words = cell.value.name
    else:
        words = describe_value(cell.value, names)
    return words if cell.measured is None else f"{words}, measured {_ago(cell.measured)}"


def _instant(one: Instant) -> str:
    within = "" if one.within is None else f", give or take {quantity(one.within)}"
    return f"it is {utc(one.utc_us)}{within}"


def _phase(one: InPhase) -> str:
    order = f", of {named([each.text for each in one.order])}" if one.order else ""
    return f"the mission is in the phase {name(one.phase.text)}{order}"


def _answer(one: Answer) -> str:
    ago = "" if one.ago is None else f" {_ago(one.ago)}"
    return f"the role {name(one.role.text)} has {'approved' if one.granted else 'refused'} it{ago}"


def _ago(one: Quantity) -> str:
    return f"{quantity(one)} ago"


def describe_asker(asker: Asker) -> str:
    """Describe the requester."""
    role = "" if asker.role is None else f"the role {name(asker.role.text)}"
    source = "" if asker.source is None else f"through {name(asker.source.text)}"
    return f"asked {' '.join(part for part in (f'by {role}' if role else '', source) if part)}"


def describe_request(request: RequestDecl | None, names: Vocabulary) -> str:
    """Describe a request and its requester."""
    if request is None:
        return ""
    given = listed([describe_argument(each, names) for each in request.arguments])
    words = name(request.skill.text) + (f" with {given}" if given else "")
    return words if request.asker is None else f"{words}, {describe_asker(request.asker)}"


def describe_expectation(expectation: Expectation | None) -> str:
    """Describe an expected decision."""
    if expectation is None:
        return ""
    words = _OUTCOMES[expectation.outcome]
    if expectation.target is not None:
        words = f"{name(expectation.target.text)} is flown instead"
    if expectation.reason is not None:
        words += f", because {name(expectation.reason.text)}"
    if expectation.clause is not None:
        words += f", decided by {name(expectation.clause.text.replace('`', ''))}"
    return words


def describe_decision(decision: Decision, skills: Sequence[str]) -> str:
    """Describe a decision; `skills` are the names of the policy's skills by number."""
    words = _OUTCOMES[decision.outcome.name.lower()]
    if decision.target is not None:
        words = f"{name(skills[decision.target.skill])} is flown instead"
    elif decision.outcome is Outcome.FALLBACK:
        words = "nothing may be flown instead"
    words += f", because {name(decision.reason.value)}"
    if decision.clause is not None:
        words += f", decided by {name(decision.clause.text.replace('`', ''))}"
    return words


def describe_scenario(scenario: ScenarioDecl, names: Vocabulary) -> Iterator[str]:
    """Yield the mission, the faults and the expectations of a scenario, one line each."""
    yield f"the mission {name(scenario.mission.text)} is flown on the simulated vehicle"
    if scenario.flavours:
        yield f"with the autopilot {named([each.text for each in scenario.flavours])}"
    if scenario.seeds is not None:
        yield f"once for each seed from {quantity(scenario.seeds.first)} to {quantity(scenario.seeds.last)}"
    for beginning in scenario.start:
        yield f"it starts with {_beginning(beginning, names)}"
    for incident in scenario.incidents:
        yield _incident(incident, names)
    for demand in scenario.demands:
        yield _demand(demand)


def _beginning(one: Charge | FaultCall | Begins, names: Vocabulary) -> str:
    if isinstance(one, Begins):
        return f"the time at {utc(one.utc_us)}"
    return f"{name(one.name.text)} at {quantity(one.value)}" if isinstance(one, Charge) else _fault(one, names)


def _fault(fault: FaultCall, names: Vocabulary) -> str:
    given = [describe_argument(each, names) for each in fault.arguments]
    return name(fault.name.text) + (f" with {listed(given)}" if given else "")


def _incident(incident: IncidentDecl, names: Vocabulary) -> str:
    moment = incident.moment
    match moment:
        case AtTimeDecl():
            when = f"{_delay(moment.delay)} after the start"
        case AfterStepDecl():
            which = "" if moment.number is None else f" number {quantity(moment.number)}"
            when = f"{_later(moment.delay)}the step {name(moment.skill.text)}{which} was sent"
        case OnConditionDecl():
            when = f"{_later(moment.delay)}for the first time {describe_condition(moment.condition, names)}"
        case _:
            assert_never(moment)
    return f"{when}: {_fault(incident.fault, names)}"


def _later(delay: Delay | None) -> str:
    return "when " if delay is None else f"{_delay(delay)} after "


def _delay(delay: Delay) -> str:
    low, high = quantity(delay.low), quantity(delay.high)
    return low if low == high else f"{low} to {high}"


def _demand(demand: Demand) -> str:
    match demand:
        case DecidesDecl():
            return f"of some decision: {describe_expectation(demand.decision)}"
        case Ends():
            return f"it ends {' or '.join(name(each.text) for each in demand.endings)}"
        case FliesDecl():
            return f"{name(demand.skill.text)} {'never flies' if demand.never else 'flies'}"
        case Reacts():
            return f"a breach is answered within {quantity(demand.most)}"
        case Keeps():
            return f"it is never nearer to {name(demand.place.text)} than {quantity(demand.least)}"
        case Lands():
            return f"it comes down inside {name(demand.zone.text)}"
        case _:
            assert_never(demand)
