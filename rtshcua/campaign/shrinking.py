"""Minimise a failing scenario: fewer faults, then shorter, weaker and rounder ones.

Delta debugging (Zeller, Hildebrandt 2002), one fault at a time, because a flight has few. Each candidate is flown, and
kept if it still fails.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, fields, replace
from typing import Final

from rtshcua.campaign.scenario_source import incident_text
from rtshcua.model.faults import UNITS, Fault
from rtshcua.model.scenario import AfterStep, AtTime, Incident, OnCondition, Scenario, Start, When

#: rounding steps by unit (the end of a field's name), coarse ones first
_ROUND: Final = {
    "_us": (10_000_000, 1_000_000, 100_000), "_mm": (10_000, 1_000), "_mm_s": (5_000, 1_000),
    "_mv": (1_000,), "_deg": (90, 10), "": (1_000, 100),
}  # fmt: skip
_CALM: Final = Start()


def shrink(
    scenario: Scenario, skills: Sequence[str], still_fails: Callable[[Scenario], bool], most: int = 150
) -> tuple[Scenario, int]:
    """Return the smallest failing scenario found within `most` flights, and the number of flights.

    `still_fails` flies a scenario and returns whether it fails like the original, which must fail.
    """
    flown = 0
    smaller = True
    while smaller:
        smaller = False
        for candidate in _smaller(scenario, skills):
            if flown == most:
                return scenario, flown
            flown += 1
            if still_fails(candidate):
                scenario, smaller = candidate, True
                break
    return scenario, flown


def _smaller(scenario: Scenario, skills: Sequence[str]) -> Iterator[Scenario]:
    """Yield simpler scenarios, most promising first; each is smaller by some measure, so that shrinking terminates."""
    incidents = scenario.incidents
    if len(incidents) > 2:
        half = len(incidents) // 2
        yield replace(scenario, incidents=incidents[:half])
        yield replace(scenario, incidents=incidents[half:])
    for number in range(len(incidents)):
        yield replace(scenario, incidents=incidents[:number] + incidents[number + 1 :])
    if scenario.start != _CALM:
        yield replace(scenario, start=_CALM)
    for number, each in enumerate(incidents):
        for other in _simpler(each, skills):
            yield replace(scenario, incidents=(*incidents[:number], other, *incidents[number + 1 :]))


def _simpler(incident: Incident, skills: Sequence[str]) -> Iterator[Incident]:
    for when in _earlier(incident.when):
        yield Incident(when, incident.fault, incident_text(when, incident.fault, skills))
    for fault in _weaker(incident.fault):
        yield Incident(incident.when, fault, incident_text(incident.when, fault, skills))


def _earlier(when: When) -> Iterator[When]:
    for step in (*_ROUND["_us"], 20_000):
        rounded = when.from_us // step * step
        if rounded != when.from_us and when.from_us == when.to_us:
            match when:
                case AtTime():
                    yield AtTime(rounded, rounded)
                case AfterStep(number):
                    yield AfterStep(number, rounded, rounded)
                case OnCondition(condition):
                    yield OnCondition(condition, rounded, rounded)


def _weaker(fault: Fault) -> Iterator[Fault]:
    for each in fields(fault):
        value = getattr(fault, each.name)
        if each.name == "at_us":
            continue
        if each.default is not MISSING and each.default is not None and _is_simpler(each.default, value):
            yield replace(fault, **{each.name: each.default})
        if type(value) is not int:
            continue
        suffix = next(unit.suffix for unit in UNITS if each.name.endswith(unit.suffix))
        if abs(value) >= 2 * _ROUND[suffix][-1]:
            yield replace(fault, **{each.name: value // 2})
        for step in _ROUND[suffix]:
            rounded = round(value / step) * step
            # only towards 0, so that shrinking terminates, but never to 0, which may have another meaning
            if 0 < abs(rounded) < abs(value):
                yield replace(fault, **{each.name: rounded})


def _is_simpler(default: object, value: object) -> bool:
    """Return whether the default is worth a try; for integers only if it is nearer to 0."""
    if type(default) is int and type(value) is int:
        return abs(default) < abs(value)
    return default != value
