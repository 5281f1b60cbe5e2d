"""E0622: the contract of a step, which is its skill's, made tighter by what the step says of its own.

The policy is signed once for all its missions, so a mission adds nothing to its tables: a step's own clauses may read
the signals that the policy reads, and zones, sets and monitors that it has.
"""

from collections.abc import Sequence

from msgspec.structs import replace

from rtshcua.decision.tree import slots_read
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Context
from rtshcua.ground.compiler.conditions import Place
from rtshcua.ground.compiler.contracts import cells_of, recorded
from rtshcua.ground.compiler.files import Files
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.ground.compiler.trial import Trial
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.limits import MAX_CLAUSES
from rtshcua.model.ir.missions import Overrides, Step
from rtshcua.model.ir.skills import Clause as ClauseDecl


class Tightened:
    """Makes the contracts of one mission's steps; `files` are the policy's and the mission's."""

    def __init__(self, context: Context, under: LoweredPolicy, files: Files) -> None:
        self._context = context
        self._under = under
        self._trial = Trial(context, under, files)
        self._made: dict[tuple[str, Overrides], Contract | None] = {}

    def contract(self, step: Step) -> Contract | None:
        """The contract of a step; None after a finding."""
        skills = self._under.policy.contracts[self._under.skills[step.skill.text]]
        if step.overrides is None:
            return skills
        key = step.skill.text, step.overrides  # a repeated step has the same
        if key not in self._made:
            self._made[key] = self._tightened(step, step.overrides, skills)
        return self._made[key]

    def _tightened(self, step: Step, own: Overrides, skills: Contract) -> Contract | None:
        place = Place(self._context.scope_of(self._context.symbols.skills[step.skill.text]), self._cells(step), True)
        found = [
            self._clauses(own_clauses, of_skill, place, words)
            for words, own_clauses, of_skill in (
                ("require", own.require, skills.require),
                ("assume", own.assume, skills.assume),
                ("maintain", own.maintain, skills.maintain),
            )
        ]
        if None in found:
            return None
        require, assume, maintain = (clauses or () for clauses in found)
        clauses = (*require, *assume, *maintain)
        return replace(
            _timed(skills, own),
            require=require,
            assume=assume,
            maintain=maintain,
            reads=slots_read(clauses, self._under.policy.vehicle, self._under.policy.monitors),
        )

    def _cells(self, step: Step) -> dict[str, int]:
        return cells_of(self._context.symbols.skills[step.skill.text])

    def _clauses(
        self, own: Sequence[ClauseDecl], of_skill: tuple[Clause, ...], place: Place, words: str
    ) -> tuple[Clause, ...] | None:
        """The skill's clauses, and the step's own."""
        if own and len(own) + len(of_skill) > MAX_CLAUSES:
            self._context.report.add(
                codes.TOO_MANY,
                own[0].span.to(own[-1].span),
                f"with its skill's the step has {len(own) + len(of_skill)} `{words}` clauses, and at most "
                f"{MAX_CLAUSES} fit on board",
            )
            return None
        lowered = [self._clause(clause, place) for clause in own]
        known = [clause for clause in lowered if clause is not None]
        return None if len(known) < len(lowered) else (*of_skill, *known)

    def _clause(self, clause: ClauseDecl, place: Place) -> Clause | None:
        lowered = self._trial.clause(clause.condition, place, clause.span)
        if not isinstance(lowered, list):
            return lowered
        for lacking in lowered:
            self._report(*lacking)
        return None

    def _report(self, span: Span, what: str, has: str) -> None:
        policy = self._under.policy
        self._context.report.add(
            codes.NOT_OBSERVED,
            span,
            f"a clause of a step {what}: `{policy.name}` is signed as it is for all its missions",
            help=f"use what its rules and contracts use, or let one of them use this; {has}",
            labels=[(self._under.declaration.name.span, "the policy is declared here")],
        )


def _timed(skills: Contract, own: Overrides) -> Contract:
    """The contract with the step's own times, energy, phases and records."""
    return replace(
        skills,
        deadline_us=skills.deadline_us if own.deadline is None else own.deadline.value,
        validity_us=skills.validity_us if own.validity is None else own.validity.value,
        duration_us=skills.duration_us if own.duration is None else own.duration.value,
        grace_us=skills.grace_us if own.grace is None else own.grace.value,
        energy=skills.energy if own.energy is None else own.energy.value,
        phases=tuple(name.text for name in own.phases) or skills.phases,
        record=recorded((*skills.record, *(name.text for name in own.record))),
    )
