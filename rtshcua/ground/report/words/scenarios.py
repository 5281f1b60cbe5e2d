"""Scenarios in words."""

from collections.abc import Iterator
from typing import assert_never

from rtshcua.ground.report.words.cases import told_expectation
from rtshcua.ground.report.words.conditions import told_condition
from rtshcua.ground.report.words.places import utc
from rtshcua.ground.report.words.skills import told_argument
from rtshcua.ground.report.words.values import quantity
from rtshcua.ground.report.words.vocabulary import Vocabulary, listed, name, named
from rtshcua.model.ir.scenarios import (
    AfterStep,
    AtTime,
    Begins,
    Charge,
    Decides,
    Delay,
    Demand,
    Ends,
    FaultCall,
    Flies,
    Incident,
    Keeps,
    Lands,
    OnCondition,
    Reacts,
    ScenarioDecl,
)


def told_scenario(scenario: ScenarioDecl, names: Vocabulary) -> Iterator[str]:
    """What is flown, what goes wrong and what must come of it, one line each."""
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
    given = [told_argument(each, names) for each in fault.arguments]
    return name(fault.name.text) + (f" with {listed(given)}" if given else "")


def _incident(incident: Incident, names: Vocabulary) -> str:
    moment = incident.moment
    match moment:
        case AtTime():
            when = f"{_delay(moment.delay)} after the start"
        case AfterStep():
            which = "" if moment.number is None else f" number {quantity(moment.number)}"
            when = f"{_later(moment.delay)}the step {name(moment.skill.text)}{which} was sent"
        case OnCondition():
            when = f"{_later(moment.delay)}for the first time {told_condition(moment.condition, names)}"
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
        case Decides():
            return f"of some decision: {told_expectation(demand.decision)}"
        case Ends():
            return f"it ends {' or '.join(name(each.text) for each in demand.endings)}"
        case Flies():
            return f"{name(demand.skill.text)} {'never flies' if demand.never else 'flies'}"
        case Reacts():
            return f"a breach is answered within {quantity(demand.most)}"
        case Keeps():
            return f"it is never nearer to {name(demand.place.text)} than {quantity(demand.least)}"
        case Lands():
            return f"it comes down inside {name(demand.zone.text)}"
        case _:
            assert_never(demand)
