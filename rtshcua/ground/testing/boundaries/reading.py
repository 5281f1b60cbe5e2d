"""Drafts read by the language itself: what it refuses is left out, and each case is decided by the decision itself."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.testing.boundaries.scene import Scene
from rtshcua.ground.testing.boundaries.suite import Block, Draft
from rtshcua.ground.testing.case import Case, Suite
from rtshcua.ground.testing.run import run_case
from rtshcua.model.outcome import Outcome

#: reads a source, and gives its cases
Play = Callable[[str], Suite]
#: how often what the language refuses is left out, and the rest read again
_ATTEMPTS = 8


class Refused(Exception):
    """The language refuses a draft, not one of its cases; `findings` say why."""

    def __init__(self, findings: tuple[Diagnostic, ...]) -> None:
        super().__init__()
        self.findings = findings


class Read(NamedTuple):
    """A block with the cases that it is read as, one a row."""

    block: Block
    cases: tuple[Case, ...]


def read(draft: Draft, play: Play) -> list[Read]:
    """The blocks of a draft that the language takes; the others, and rows, are taken out of it. Raises `Refused`."""
    errors: tuple[Diagnostic, ...] = ()
    for _ in range(_ATTEMPTS):
        suite = play(draft.text())
        errors = tuple(each for each in suite.diagnostics if each.severity is Severity.ERROR)
        if not errors:
            left = iter(suite.cases)
            return [Read(each, tuple(next(left) for _ in each.rows)) for each in draft.blocks]
        if not _leave_out(draft, errors):
            break
    raise Refused(errors)


def scene_of(case: Case) -> Scene:
    """What a case decides on."""
    return Scene(case.invocation, case.state, case.context, case.now)


def allowed(case: Case) -> bool:
    """Whether a case is decided as `allow`."""
    return run_case(case).trace.decision.outcome is Outcome.ALLOW


def expectation(case: Case) -> str:
    """What a case is decided as, as a test expects it."""
    decision = run_case(case).trace.decision
    words = decision.outcome.name.lower()
    if decision.outcome is Outcome.FALLBACK and decision.target is not None:
        words += f" {case.policy.lowered.policy.contracts[decision.target.skill].name}"
    return f"{words} because {decision.reason.value}"


def _leave_out(draft: Draft, errors: Sequence[Diagnostic]) -> bool:
    """Take away the rows that errors are about, or else their blocks; whether there were any."""
    wrong: dict[Block, set[int]] = {}
    starts = [each.span.start for each in errors if each.span is not None]
    at = 0
    for piece, block in draft.pieces():
        for start in starts:
            if block is not None and at <= start < at + len(piece):
                wrong.setdefault(block, set()).add(start - at)
        at += len(piece)
    kept: list[Block] = []
    for block in draft.blocks:
        rows = {block.row_at(offset) for offset in wrong.get(block, ())}
        left = [row for number, row in enumerate(block.rows) if number not in rows]
        if None not in rows and left:
            block.rows = left
            kept.append(block)
    draft.blocks = kept
    return bool(wrong)
