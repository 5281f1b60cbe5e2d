"""Prove that each step is permitted at every time at which it may begin (E0718).

If the time of issue is known, each step must be permitted at every time at which it may begin. Otherwise there must be
one time of issue that suits all steps: it must meet the requirements of their paths and contracts
(`StepTime.requirements`) and of the rules. Dates are not considered then.

For the values between two instances of a mission, each value needs a time of issue of its own. If no time suits all
values, they are halved until each part has a suitable time or a single value is left.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.daytime import Arc, IssueRequirement, arcs_where, met_by_some
from rtshcua.ground.analysis.space import reads_days
from rtshcua.ground.analysis.witness import local_time_text, witness_text
from rtshcua.ground.prove.certain_refusal import TimeKnowledge, certain_refusals, deciding_rules
from rtshcua.ground.prove.parameter_ranges import ArgumentLine, space_along
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.ruleset import timed
from rtshcua.ground.prove.step_starts import may_be_skipped
from rtshcua.ground.prove.step_times import IssueCycle, MissionStep, changes_read
from rtshcua.model.quantity import Dimension, display


def prove_known_issue(proof: ProofContext, steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]) -> bool:
    """Whether a step may begin when it is not permitted, for some arguments on its line. Reports the first."""
    return any(
        line is not None and _report_refused(proof, step, line, step.time.utc(0)[0])
        for step, line in zip(along_lines(steps, lines), lines, strict=True)
    )


def _report_refused(proof: ProofContext, step: MissionStep, line: ArgumentLine, window: tuple[int, int]) -> bool:
    flat, zones = step.flat, proof.policy.zones
    if not any(rule.when is not None and timed(rule.when.code, zones) for rule in deciding_rules(step.prepared)):
        return False
    space = space_along(proof, step, line)._replace(utc=(window,))
    for witness, rule in certain_refusals(proof, step.prepared, space, TimeKnowledge.ALL, line.given):
        local, day = proof.prepared.tables.local, reads_days(proof.policy)
        at, first, last = (local_time_text(moment, local, day=day) for moment in (witness.at.utc[0][0], *window))
        rules = [each.rule for each in step.prepared.candidates.permits] if rule is None else [rule]
        effect = "does not permit it" if rule is None else "forbids it"
        if rule is not None and rule.target is not None:
            effect = "replaces it by another skill"
        moved = f" with {witness_text(witness, proof.policy, flat.contract)}" if line.moving else ""
        proof.report.add(
            codes.NOT_ALWAYS_PERMITTED,
            step.span,
            f"this step may begin from {first} to {last}, local time, and at {at} it is not permitted{moved}",
            help="issue the mission at another time, or move the step",
            labels=[(proof.span(each), f"this {effect} then") for each in rules],
        )
        return True
    return False


def prove_some_issue(proof: ProofContext, steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]) -> bool:
    """Report the first step at which no time of issue suits all steps so far, for some arguments on their lines.

    Returns whether there is one.
    """
    waiting = [list(lines)]
    while waiting:
        part = waiting.pop()
        failed = _first_unmet(proof, steps, part)
        if failed is None:
            continue
        if all(line is None or line.single for line in part):
            _report_unmet(proof, steps, failed, part)
            return True
        halves = [None if line is None else line.halves() for line in part]
        waiting += [[half and half[side] for half in halves] for side in (1, 0)]
    return False


class _Unmet(NamedTuple):
    """A step for which there is no time of issue, and its requirements of that time."""

    step: MissionStep
    requirements: Sequence[IssueRequirement]


def _first_unmet(
    proof: ProofContext, steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]
) -> _Unmet | None:
    """Return the first step at which no single time of issue suits all steps so far with all arguments on the lines."""
    every: list[IssueRequirement] = []
    for step, line in zip(along_lines(steps, lines), lines, strict=True):
        if line is None or line.empty or may_be_skipped(step.prepared):
            continue
        found = [*step.time.requirements, *_rule_requirements(proof, step, line)]
        every += found
        if found and not met_by_some(every):
            return _Unmet(step, found)
    return None


def _rule_requirements(proof: ProofContext, step: MissionStep, line: ArgumentLine) -> Iterator[IssueRequirement]:
    """Yield the requirement of the rules that read the time of day."""
    rules = deciding_rules(step.prepared)
    read = [(rule, changes_read(proof, rule.when, step.flat.arguments)) for rule in rules if rule.when is not None]
    clocked = [rule for rule, (windows, _) in read if windows]
    if clocked:
        labels = tuple((proof.span(rule), "this reads the time") for rule in clocked)
        windows = [window for _, (windows, _) in read for window in windows]
        cycle = IssueCycle.of(proof, windows)
        arcs = _permitted(proof, step, line, cycle, cycle.edges(windows))
        yield IssueRequirement(arcs, step.time.low, step.time.high, cycle.period, labels)


def _permitted(
    proof: ProofContext, step: MissionStep, line: ArgumentLine, cycle: IssueCycle, edges: Sequence[int]
) -> tuple[Arc, ...]:
    """Return the times at which no rule certainly refuses a step, for all arguments on its line."""
    space = space_along(proof, step, line)

    def permitted(moment: int) -> bool:
        then = space._replace(utc=(cycle.at(moment),))
        return not any(True for _ in certain_refusals(proof, step.prepared, then, TimeKnowledge.DAYTIME, line.given))

    return arcs_where(edges, permitted, cycle.period)


def _report_unmet(
    proof: ProofContext, steps: Sequence[MissionStep], failed: _Unmet, lines: Sequence[ArgumentLine | None]
) -> None:
    low = failed.step.time.low
    first = display(low, Dimension.DURATION)
    last = display(max(one.high for one in failed.requirements), Dimension.DURATION)
    moves = (line.text(step.contract) for line, step in zip(lines, steps, strict=True) if line is not None)
    moved = next(filter(None, moves), "")
    proof.report.add(
        codes.NOT_ALWAYS_PERMITTED,
        failed.step.span,
        (f"with {moved}, which the mission's parameters allow: " if moved else "")
        + "for any time of issue, this step may begin when it is not permitted: it begins "
        f"{f'{first} to {last}' if low else f'up to {last}'} after the issue",
        help="widen the permitted times, or shorten the time before the step: the time to the start, and all "
        "deadlines, approvals and durations",
        labels=dict.fromkeys(label for one in failed.requirements for label in one.labels),
    )


def along_lines(steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]) -> Iterator[MissionStep]:
    """Yield the steps with their times adapted to all arguments on the lines.

    A step begins at the earliest after the least time that the steps before it take with any of the arguments.
    """
    earliest = 0
    for step, line in zip(steps, lines, strict=True):
        requirements = [each._replace(low=earliest) for each in step.time.requirements]
        yield step._replace(time=replace(step.time, low=earliest, requirements=requirements))
        flat, time = step.flat, step.contract.motion.time
        earliest += 0 if time < 0 else flat.arguments[time] if line is None else line.least(time)
