"""E0622: the contract of a step, which is its skill's, made tighter by what the step says of its own.

The policy is signed once for all its missions, so a mission adds nothing to its tables: a step's own clauses may read
the signals that the policy reads, and zones, sets and monitors that it has.
"""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from typing import Any, NamedTuple

from msgspec.structs import replace

from rtshcua.decision.tree import slots_read
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import ENTRY
from rtshcua.ground.compiler.conditions import Conditions, Place
from rtshcua.ground.compiler.contracts import cells_of, recorded
from rtshcua.ground.compiler.files import Files
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.ground.compiler.slots import Slots
from rtshcua.ground.compiler.zones import ZoneTable
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.limits import MAX_CLAUSES
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy
from rtshcua.model.ir.missions import Overrides, Step
from rtshcua.model.ir.skills import Clause as ClauseDecl
from rtshcua.model.quantity import Dimension, display


class Tightened:
    """Makes the contracts of one mission's steps; `files` are the policy's and the mission's."""

    def __init__(self, context: Context, under: LoweredPolicy, files: Files) -> None:
        self._context = context
        self._under = under
        self._files = files
        self._trial: _Trial | None = None
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
        if not self._known(clause):
            return None
        if self._trial is None:
            self._trial = _trial(self._context, self._under, self._files)
        before = len(self._context.report.found)
        lowered = self._trial.conditions.clause(clause.condition, place)
        lacking = next(_lacking(self._trial, self._under.policy), None)
        if lacking is not None:
            self._trial = None  # what it gained is not the policy's
            if len(self._context.report.found) == before:
                self._report(clause.span, *lacking)
        return lowered if len(self._context.report.found) == before else None

    def _known(self, clause: ClauseDecl) -> bool:
        """Whether the policy has the signals and zones that a clause names."""
        context, under = self._context, self._under
        signals = {signal.name for signal in under.policy.signals}
        good = True
        for reference in references(clause.condition):
            zone = reference.name.removesuffix(ENTRY)
            if reference.name in context.symbols.signals and reference.name not in signals:
                good = False
                what = f"reads the signal `{reference.name}`, which the policy does not"
                self._report(reference.span, what, _signals(under.policy))
            elif zone in context.symbols.zones and zone not in under.zones.index:
                good = False
                context.report.add(
                    codes.NOT_IN_POLICY,
                    reference.span,
                    f"the zone `{zone}` is not one that the policy `{under.policy.name}` imports",
                    help="its zones are " + ", ".join(f"`{name}`" for name in under.zones.index),
                    labels=[(context.symbols.zones[zone].name.span, "declared here")],
                )
        return good

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


class _Trial(NamedTuple):
    """What conditions are lowered into that must add nothing to the policy's own."""

    conditions: Conditions
    slots: Slots
    zones: ZoneTable


def _trial(context: Context, under: LoweredPolicy, files: Files) -> _Trial:
    """A copy of what the policy was lowered into; places are those of `files`."""
    # `deepcopy` asks by identity what to leave as it is
    memo: dict[int, Any] = {id(each): each for each in (context, context.report, context.symbols)}
    memo[id(under.files)] = files
    return _Trial(deepcopy(under.conditions, memo), deepcopy(under.slots, memo), deepcopy(under.zones, memo))


def _lacking(trial: _Trial, policy: Policy) -> Iterator[tuple[str, str]]:
    """What a lowering has added to the tables of a policy, and what these have of its kind."""
    if trial.slots.count > policy.slots:
        yield "reads a signal that the policy does not", _signals(policy)
    if len(trial.zones.flat()) > len(policy.zones) or len(trial.zones.tables) > len(policy.tables):
        grown = listed(dict.fromkeys(zone.name for zone in policy.zones[len(trial.zones.index) :]))
        yield "needs a grown zone that the policy does not have", f"it has {grown or 'none'}"
    if len(trial.conditions.sets.phases) > len(policy.phases):
        yield "names a phase that no condition of the policy does", f"they name {listed(policy.phases) or 'none'}"
    if len(trial.conditions.sets.all) > len(policy.sets):
        yield "needs a set of values that no condition of the policy has", "a single value is compared with `==`"
    if len(trial.conditions.monitors.all) > len(policy.monitors):
        watched = listed(dict.fromkeys(_window(monitor) for monitor in policy.monitors))
        yield "needs a temporal condition that the policy does not observe", f"it observes {watched or 'none'}"


def _signals(policy: Policy) -> str:
    return f"it reads {listed(signal.name for signal in policy.signals)}"


def _window(monitor: Monitor) -> str:
    """A temporal condition as it is written."""
    words = {
        MonitorKind.FOR_LAST: "for the last",
        MonitorKind.WITHIN_LAST: "within the last",
    }.get(MonitorKind(monitor.kind))
    if words is None:
        return f"{MonitorKind(monitor.kind).name.lower()} {monitor.when.text}"
    return f"{monitor.when.text} {words} {display(monitor.window_us, Dimension.DURATION)}"
