"""What tests found, for programs: as JSON, and as the suites of JUnit."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any

from rtshcua.diagnostics.render import render_one
from rtshcua.diagnostics.report.junit import Outcome, Suite
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.testing.coverage.coverage import per_mille
from rtshcua.ground.testing.coverage.tally import Covered
from rtshcua.ground.testing.coverage.universe import Item
from rtshcua.ground.testing.run import Ran
from rtshcua.model.decision import Decision
from rtshcua.model.flat.policy import Policy


def tests_json(ran: Iterable[Ran], sources: Mapping[str, Source]) -> list[dict[str, Any]]:
    """One object a case, in the order of the text; every key is always there."""
    return [_case(each, sources) for each in ran]


def summary_json(ran: Sequence[Ran]) -> dict[str, int]:
    """How many tests and cases there were, and how they ended."""
    passed = sum(each.met for each in ran)
    tests = len({(each.case.test.span.file, each.case.test.span.start) for each in ran})
    return {"tests": tests, "cases": len(ran), "passed": passed, "failed": len(ran) - passed}


def coverage_json(covered: Sequence[Covered], sources: Mapping[str, Source]) -> dict[str, Any]:
    """The coverage of all policies together and of each, by clause."""
    reached, total = sum(one.coverage.covered for one in covered), sum(one.coverage.total for one in covered)
    return _share(reached, total) | {"policies": [_policy(one, sources) for one in covered]}


def suites(ran: Iterable[Ran], sources: Mapping[str, Source], covered: Sequence[Covered] | None) -> tuple[Suite, ...]:
    """A suite for each file, a test of it for each case; what all of them cover is in the properties of the first."""
    files = [(file, tuple(group)) for file, group in groupby(ran, lambda each: each.case.span.file)]
    properties = () if covered is None else tuple(_properties(covered))
    return tuple(
        Suite(file, tuple(_outcome(each, sources) for each in group), () if number else properties)
        for number, (file, group) in enumerate(files)
    )


def named(policy: Policy) -> str:
    """A policy as missions name it."""
    return f"{policy.name}@{policy.version}"


def told(item: Item) -> str:
    """A clause with the skill and the list that it belongs to; a rule, and an airspace, says by itself what it is."""
    return f"{item.skill} {item.role}: {item.text}" if item.skill else item.text


def place_json(span: Span | None, sources: Mapping[str, Source]) -> dict[str, Any] | None:
    """A place in a source."""
    if span is None:
        return None
    at = sources[span.file].position(span.start)
    return {"file": span.file, "start": span.start, "end": span.end, "line": at.line, "column": at.column}


def _case(ran: Ran, sources: Mapping[str, Source]) -> dict[str, Any]:
    case, decision, expected = ran.case, ran.trace.decision, ran.expected
    return {
        "name": case.name,
        "test": case.test.name.text,
        "row": case.row,
        "at": place_json(case.span, sources),
        "policy": named(case.policy.lowered.policy),
        "skill": case.invocation.invocation.contract.name,
        "met": ran.met,
        "expected": {
            "outcome": expected.outcome,
            "target": None if expected.target is None else expected.target.text,
            "reason": None if expected.reason is None else expected.reason.text,
            "clause": None if expected.clause is None else expected.clause.text,
        },
        "decided": {
            "outcome": decision.outcome.name.lower(),
            "target": _target(ran),
            "reason": decision.reason.value,
            "clause": clause_of(decision),
            "written": None if decision.clause is None else place_json(case.policy.span(decision.clause), sources),
        },
    }


def clause_of(decision: Decision) -> str | None:
    """The clause that decided, as it is written, on one line."""
    return None if decision.clause is None else " ".join(decision.clause.text.split())


def _target(ran: Ran) -> str | None:
    target = ran.trace.decision.target
    return None if target is None else ran.case.policy.lowered.policy.contracts[target.skill].name


def _outcome(ran: Ran, sources: Mapping[str, Source]) -> Outcome:
    span, finding = ran.case.span, ran.finding
    line = sources[span.file].position(span.start).line
    if finding is None:
        return Outcome(ran.case.name, span.file, line, time_us=ran.took_us)
    text = render_one(finding, sources).rstrip("\n")
    return Outcome(ran.case.name, span.file, line, failure=text, kind=finding.code.id, time_us=ran.took_us)


def _properties(covered: Sequence[Covered]) -> Iterable[tuple[str, str]]:
    for one in covered:
        found = one.coverage
        yield f"coverage {named(found.policy)}", f"{found.covered}/{found.total}"
        for item in found.undecided:
            yield f"never decided {named(found.policy)}", told(item)


def _share(reached: int, total: int) -> dict[str, Any]:
    return {"covered": reached, "total": total, "per_mille": per_mille(reached, total)}


def _policy(one: Covered, sources: Mapping[str, Source]) -> dict[str, Any]:
    found = one.coverage
    clauses = [
        {
            "role": line.item.role,
            "skill": line.item.skill or None,
            "text": line.item.text,
            "at": place_json(span, sources),
            "reached": {goal.value: count for goal, count in zip(line.item.goals, line.counts, strict=True)},
            "missing": [goal.value for goal in line.missing],
            "impossible": [goal.value for goal in line.item.impossible],
        }
        for line, span in zip(found.lines, one.spans, strict=True)
    ]
    head = {"policy": found.policy.name, "version": found.policy.version, "vehicle": found.policy.vehicle.name}
    return head | {"decisions": found.decisions} | _share(found.covered, found.total) | {"clauses": clauses}
