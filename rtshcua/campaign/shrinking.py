"""The smallest scenario that still fails: fewer faults, then shorter, weaker and rounder ones.

As delta debugging does it (Zeller, Hildebrandt 2002), one fault at a time, for a flight has at most a few. What a
change does to a flight is not known before it is flown, so each step is tried, and kept if it still fails.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, fields, replace
from typing import Final

from rtshcua.campaign.scenario_source import incident_text
from rtshcua.model.faults import UNITS, Fault
from rtshcua.model.scenario import AfterStep, AtTime, Incident, OnCondition, Scenario, Start, When

#: the steps in which a number of each unit is rounded, coarse ones first, by the end of a field's name
_ROUND: Final = {
    "_us": (10_000_000, 1_000_000, 100_000), "_mm": (10_000, 1_000), "_mm_s": (5_000, 1_000),
    "_mv": (1_000,), "_deg": (90, 10), "": (1_000, 100),
}  # fmt: skip
_CALM: Final = Start()


def shrink(
    scenario: Scenario, skills: Sequence[str], still_fails: Callable[[Scenario], bool], most: int = 150
) -> tuple[Scenario, int]:
    """The scenario, as small as `most` flights found it, and how many were flown.

    `still_fails` flies one, and says whether it fails as the first did. What is given is expected to.
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
    """Simpler ones, the most promising first; each is smaller by some measure, so that this comes to an end."""
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
            # towards nothing, or it would go back and forth; and never to nothing, which may mean something else
            if 0 < abs(rounded) < abs(value):
                yield replace(fault, **{each.name: rounded})


def _is_simpler(default: object, value: object) -> bool:
    """Whether it is worth to try what holds if nothing is said; of numbers only what is nearer to nothing."""
    if type(default) is int and type(value) is int:
        return abs(default) < abs(value)
    return default != value
