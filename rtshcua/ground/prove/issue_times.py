"""E0718: a step may begin at a time of day, or on a date, at which it is not permitted.

With a time of issue, every moment at which a step may begin must be permitted. Without one, some time of issue must
suit all steps at once: what their paths and contracts ask of it (`StepTime.asked`), and what permits and forbids them.
Dates are left for the time of issue.

Between two instances of a mission each value needs such a time of issue, not all of them the same: where none does for
all, the values are halved until one does for each part, or a single value is left.
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
    """Report the first step that may come at such a time, with arguments on its line; whether there is one."""
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
        does = "does not permit it" if rule is None else "forbids it"
        if rule is not None and rule.target is not None:
            does = "flies another skill in its place"
        moved = f" with {witness_text(witness, proof.policy, flat.contract)}" if line.moving else ""
        proof.report.add(
            codes.NOT_ALWAYS_PERMITTED,
            step.span,
            f"at {at} this step is not permitted{moved}, and it may come from {first} to {last}, local time",
            help="issue the mission at another time, or move the step",
            labels=[(proof.span(each), f"this {does} then") for each in rules],
        )
        return True
    return False


def prove_some_issue(proof: ProofContext, steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]) -> bool:
    """Report the first step up to which no time of issue will do, for some arguments on its line; whether there is
    one.
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
    """A step for which no time of issue will do, and what is asked of that time."""

    step: MissionStep
    asked: Sequence[IssueRequirement]


def _first_unmet(
    proof: ProofContext, steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]
) -> _Unmet | None:
    """The first step up to which no one time of issue will do for all arguments on the lines."""
    asked: list[IssueRequirement] = []
    for step, line in zip(along_lines(steps, lines), lines, strict=True):
        if line is None or line.empty or may_be_skipped(step.prepared):
            continue
        found = [*step.time.asked, *_demands(proof, step, line)]
        asked += found
        if found and not met_by_some(asked):
            return _Unmet(step, found)
    return None


def _demands(proof: ProofContext, step: MissionStep, line: ArgumentLine) -> Iterator[IssueRequirement]:
    """What the rules that read the time of day ask."""
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
    """When a step is surely permitted with all arguments on its line, as far as these and the time say."""
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
    last = display(max(one.high for one in failed.asked), Dimension.DURATION)
    moves = (line.words(step.contract) for line, step in zip(lines, steps, strict=True) if line is not None)
    moved = next(filter(None, moves), "")
    proof.report.add(
        codes.NOT_ALWAYS_PERMITTED,
        failed.step.span,
        (f"with {moved}, which the mission's parameters allow: " if moved else "")
        + f"whenever the mission is issued, this step may come at a time at which it is not permitted: it comes "
        f"{f'{first} to {last}' if low else f'at once or up to {last}'} after that",
        help="widen the times, or let the mission take less: that is the time to its start, then all deadlines, "
        "approvals and durations before the step",
        labels=dict.fromkeys(label for one in failed.asked for label in one.labels),
    )


def along_lines(steps: Sequence[MissionStep], lines: Sequence[ArgumentLine | None]) -> Iterator[MissionStep]:
    """The steps with the times for all arguments on lines: a step begins no sooner than those before it take at least
    with any of them, and asks for all of them what its time says.
    """
    earliest = 0
    for step, line in zip(steps, lines, strict=True):
        asked = [each._replace(low=earliest) for each in step.time.asked]
        yield step._replace(time=replace(step.time, low=earliest, asked=asked))
        flat, time = step.flat, step.contract.motion.time
        earliest += 0 if time < 0 else flat.arguments[time] if line is None else line.least(time)
