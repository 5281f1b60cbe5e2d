"""Check a flight against the expectations of its scenario.

Endings, decisions and flown skills come from the flight's logs, distances from the true positions, reaction times
from the sent frames.
"""

import re
from collections.abc import Iterable, Iterator
from math import inf
from typing import Any, NamedTuple, assert_never

import msgspec

from rtshcua.decision.running_conditions import WAY_HOME
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.outcome import Reason
from rtshcua.model.scenario import (
    Decides,
    EndsInside,
    EndsWith,
    Expected,
    Flies,
    KeepsAway,
    ReactsWithin,
    ScenarioExpectation,
)
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import Judgement
from rtshcua.virtual.zone_truth import inside_mm, local_mm
from rtshcua.wire.request import CONTINGENCY_LINK, STEP

#: the most decisions that a message lists
_SHOWN = 6
_WORD = re.compile(r"\w+")


class Met(NamedTuple):
    """An expectation, whether it was met, and the observed fact."""

    expectation: ScenarioExpectation
    met: bool
    found: str


def expectations(flown: ScenarioFlown, judgement: Judgement) -> tuple[Met, ...]:
    """Return one result for each expectation of the scenario, in order."""
    records = [record for life in flown.lives for record in _records(life.lines)]
    ending = flown.ending or ("fault" if flown.fault else "killed")
    said = _Said(ending, records, flown.policy, flown.mission)
    return tuple(
        Met(expectation, *_found(expectation.what, flown, judgement, said))
        for expectation in flown.scenario.expectations
    )


def recorded(
    expected: Iterable[ScenarioExpectation], ending: str, lines: Iterable[bytes], policy: Policy, mission: Mission
) -> list[Met]:
    """Return the results of those expectations that a run's records decide without the true positions."""
    said = _Said(ending, _records(lines), policy, mission)
    return [
        Met(each, *_shows(each.what, said)) for each in expected if isinstance(each.what, EndsWith | Decides | Flies)
    ]


class _Said(NamedTuple):
    """The records of a flight, with its policy and mission."""

    ending: str
    records: list[dict[str, Any]]
    policy: Policy
    mission: Mission


def _shows(what: EndsWith | Decides | Flies, said: _Said) -> tuple[bool, str]:
    match what:
        case EndsWith(endings):
            return said.ending in endings, f"the run ended with `{said.ending}`"
        case Decides():
            return _decided(what, said)
        case Flies(skill, never):
            flew = [record["detail"] for record in said.records if record.get("event") == "dispatched"]
            return (skill in flew) is not never, f"flown skills: {_listed(flew) if flew else 'none'}"


def _found(what: Expected, flown: ScenarioFlown, judgement: Judgement, said: _Said) -> tuple[bool, str]:
    match what:
        case EndsWith() | Decides() | Flies():
            return _shows(what, said)
        case ReactsWithin(most_us):
            took_us = judgement.margins.stop_us
            if took_us is None:
                return True, "no fallback was needed"
            return took_us <= most_us, f"the slowest fallback took {took_us / 1e6:.3f} s"
        case KeepsAway(zone, least_mm):
            return _away(flown, judgement, zone, least_mm)
        case EndsInside(zone):
            last = flown.samples[-1]
            level = inside_mm(_flat(flown, zone), *local_mm(flown.policy, last.latitude, last.longitude), 0.0)
            where = f"{abs(level) / 1000:.1f} m {'inside' if level > 0 else 'outside'}"
            return level > 0, f"the vehicle ended {where} `{flown.policy.zones[zone].name}`"
        case _:
            assert_never(what)


class _Decided(NamedTuple):
    """A decision, or the fallback of an aborted step: the skill that flies then, the reason and the clause."""

    outcome: str
    skill: str
    reason: str
    clause: str

    def __str__(self) -> str:
        return f"{self.outcome} {self.skill or 'a link'} ({self.reason})"


def _decided(what: Decides, said: _Said) -> tuple[bool, str]:
    decided = list(_decisions(said))
    for each in decided:
        if _is(what, each):
            return True, str(each)
    alike = [each for each in decided if each.outcome == what.outcome] or decided
    return False, f"decisions: {_listed(str(each) for each in alike) if alike else 'none'}"


def _is(what: Decides, decided: _Decided) -> bool:
    return (
        decided.outcome == what.outcome
        and (what.target is None or decided.skill == what.target)
        and (what.reason is None or decided.reason == what.reason)
        and (what.clause is None or decided.clause == what.clause)
    )


def _decisions(said: _Said) -> Iterator[_Decided]:
    for number, record in enumerate(said.records):
        if record["type"] == "decision":
            yield _Decided(record["outcome"], _skill(said, record), record["reason"], record["clause"])
        elif record.get("event") == "violated" and 0 <= record["step"] < len(said.mission.invocations):
            later = (each for each in said.records[number:] if each.get("event") == "dispatched")
            link = next((each["detail"] for each in later if each["kind"] != STEP), "")
            for reason, clause in _watched(said, record["step"]):
                if record["detail"] == clause or record["detail"].startswith(f"{clause}: "):
                    yield _Decided("fallback", link, reason, clause)


def _watched(said: _Said, step: int) -> Iterator[tuple[Reason, str]]:
    """Yield the conditions of a running step, each with the reason of a refusal if it does not hold."""
    contract, policy = said.mission.invocations[step].contract, said.policy
    yield from ((Reason.STATE_VIOLATED, each.text) for each in contract.assume)
    yield from ((Reason.DEGRADED, each.text) for each in policy.rules if each.kind == RuleKind.DEGRADE)
    yield from ((Reason.INVARIANT, each.text) for each in contract.maintain)
    if policy.airspace is not None:
        yield Reason.AIRSPACE, policy.airspace.text
    yield Reason.ENERGY, WAY_HOME


def _skill(said: _Said, record: dict[str, Any]) -> str:
    """Return the skill of a decision: of its target, of its link, or of the step."""
    policy = said.policy
    step: int = record["step"]
    link: int = record["link"]
    if record["target"] is not None:
        return _first_word(record["target"])
    if record["kind"] == CONTINGENCY_LINK:
        return policy.contracts[policy.contingency[link].skill].name
    contract = said.mission.invocations[step].contract
    if record["kind"] == STEP:
        return contract.name
    return policy.contracts[contract.fallback[link].skill].name if link >= 0 else ""


def _first_word(text: str) -> str:
    found = _WORD.match(text)
    return "" if found is None else found[0]


def _listed(words: Iterable[str]) -> str:
    """Return the different items, in order, shortened."""
    different = list(dict.fromkeys(words))
    more = f", and {len(different) - _SHOWN} more" if len(different) > _SHOWN else ""
    return ", ".join(different[:_SHOWN]) + more


def _away(flown: ScenarioFlown, judgement: Judgement, zone: int | None, least_mm: int) -> tuple[bool, str]:
    if zone is None:
        nearest = judgement.margins.obstacle_mm
        if nearest is None:
            return True, "there was no obstacle"
        return nearest >= least_mm, f"the smallest distance to an obstacle was {nearest / 1000:.1f} m"
    flat = flown.policy.zones[zone]
    away = min(
        (
            -inside_mm(flat, *local_mm(flown.policy, sample.latitude, sample.longitude), sample.up_mm)
            for sample in flown.samples
            if sample.in_air
        ),
        default=inf,
    )
    if away == inf:
        return True, "the vehicle never flew"
    return away >= least_mm, f"the smallest distance to `{flat.name}` was {away / 1000:.1f} m"


def _flat(flown: ScenarioFlown, zone: int) -> Any:
    """Return the zone without height limits."""
    return msgspec.structs.replace(flown.policy.zones[zone], floor=-(1 << 30), ceiling=1 << 30)


def _records(lines: Iterable[bytes]) -> list[dict[str, Any]]:
    return [msgspec.json.decode(line) for line in lines if line.endswith(b"\n")]
