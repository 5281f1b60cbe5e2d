"""Check that the times of a contract are consistent, and fit its timing class.

A decision must not expire before the step starts, nor while it flies: the deadline, the duration and the time for an
approval must not exceed the validity. A grace above the duration would tolerate any violation. The class (paper symbol
`cls`) bounds the deadline:

| class | deadline | why |
|---|---|---|
| `reflex` | 200 ms | the time to an obstacle at 10 m and 12 m/s, less the time to brake |
| `tactical` | 30 s | a decision on the current state must not wait while battery and wind change |
| `semantic` | none | a person or an agent decides |
"""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.checks.missions import DEFAULT_GRACE_US
from rtshcua.ground.checker.context import CheckContext
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.missions import Overrides, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import RuleDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Dimension, display

#: the longest deadline of a class, us
LONGEST_DEADLINE = {"reflex": 200_000, "tactical": 30_000_000}


class _Times(NamedTuple):
    """The times of a contract; None if not written, or not a duration."""

    deadline: Quantity | None
    validity: Quantity | None
    duration: Quantity | None
    grace: Quantity | None


def check_times(context: CheckContext) -> None:
    """Report every contract, override and `confirm` rule with inconsistent times."""
    for skill in context.symbols.skills.values():
        _coherent(context, _of(skill))
        _class(context, skill)
    for mission in context.symbols.missions.values():
        for phase in mission.phases:
            for step in phase.steps:
                skill_of = context.symbols.skills.get(step.skill.text)
                if step.overrides is not None and skill_of is not None:
                    _awaited(context, mission.policy, step)
                    _coherent(context, _overridden(_of(skill_of), _of(step.overrides)), _of(step.overrides))
    for policy in context.symbols.policies.values():
        for rule in policy.rules:
            if rule.kind == "confirm":
                _approval(context, rule)


def _of(contract: SkillDecl | Overrides) -> _Times:
    return _Times(*map(_time, (contract.deadline, contract.validity, contract.duration, contract.grace)))


def _time(quantity: Quantity | None) -> Quantity | None:
    return quantity if quantity is not None and quantity.dimension is Dimension.DURATION else None


def _overridden(skill: _Times, step: _Times) -> _Times:
    return _Times(*(theirs if mine is None else mine for mine, theirs in zip(step, skill, strict=True)))


def _coherent(context: CheckContext, times: _Times, of: Iterable[Quantity | None] = ()) -> None:
    """Report times that contradict each other; with `of`, only contradictions that involve one of these."""
    own = {quantity for quantity in of if quantity is not None}
    deadline, validity, duration, grace = times
    for short, long, words, help in (
        (validity, deadline, "the deadline {} is longer than the validity {}", "the decision may expire too early"),
        (validity, duration, "the duration {} is longer than the validity {}", "the decision may expire in flight"),
        (duration, grace, "the grace {} is longer than the duration {}", "a clause could be unknown all the time"),
    ):
        if short is None or long is None or long.value <= short.value:
            continue
        if own and own.isdisjoint((short, long)):
            continue
        at, other = (long, short) if not own or long in own else (short, long)
        context.report.add(
            codes.INCOHERENT_TIMING,
            at.span,
            words.format(_words(long), _words(short)),
            help=f"{help}; the maximum is `{_words(short)}`",
            labels=[(other.span, "conflicts with this")],
        )
    if grace is None and (not own or duration in own):
        _default_grace(context, duration)


def _default_grace(context: CheckContext, duration: Quantity | None) -> None:
    if duration is not None and 0 < duration.value < DEFAULT_GRACE_US:
        context.report.add(
            codes.INCOHERENT_TIMING,
            duration.span,
            f"the default grace {display(DEFAULT_GRACE_US, Dimension.DURATION)} is longer than the duration "
            f"{_words(duration)}",
            help="write a shorter `grace`",
        )


def _class(context: CheckContext, skill: SkillDecl) -> None:
    deadline = _time(skill.deadline)
    if deadline is None or skill.timing_class is None:
        return
    longest = LONGEST_DEADLINE.get(skill.timing_class.text)
    if longest is not None and deadline.value > longest:
        most = display(longest, Dimension.DURATION)
        slower = next((name for name, most in LONGEST_DEADLINE.items() if deadline.value <= most), "semantic")
        context.report.add(
            codes.CLASS_TIMING,
            deadline.span,
            f"the deadline {_words(deadline)} exceeds the maximum of a `{skill.timing_class.text}` skill, {most}",
            help=f"write at most `{most}`, or change the class to `{slower}`",
            labels=[(skill.timing_class.span, "the class")],
            fix=(deadline.span, most, f"write `{most}`"),
        )


def _approval(context: CheckContext, rule: RuleDecl) -> None:
    within = _time(rule.within)
    for name in rule.skills:
        skill = context.symbols.skills.get(name.text)
        validity = None if skill is None else _time(skill.validity)
        if within is not None and validity is not None and within.value > validity.value:
            context.report.add(
                codes.INCOHERENT_TIMING,
                within.span,
                f"the time for an approval, {_words(within)}, is longer than the validity of `{name.text}`, "
                f"{_words(validity)}",
                help=f"write at most `{_words(validity)}`",
                labels=[(validity.span, "conflicts with this")],
            )


def _awaited(context: CheckContext, policy: Name, step: Step) -> None:
    """Report an approval that takes longer than a step's own validity, but not than that of its skill."""
    under, skill = context.symbols.policies.get(policy.text), context.symbols.skills.get(step.skill.text)
    own = None if step.overrides is None else _time(step.overrides.validity)
    if under is None or skill is None or own is None:
        return
    for rule in under.rules:
        if rule.kind != "confirm" or step.skill.text not in [name.text for name in rule.skills]:
            continue
        within, validity = _time(rule.within), _time(skill.validity)
        if within is not None and within.value > own.value and (validity is None or within.value <= validity.value):
            context.report.add(
                codes.INCOHERENT_TIMING,
                own.span,
                f"the validity of the step, {_words(own)}, is shorter than the time for an approval, {_words(within)}",
                help=f"write at least `{_words(within)}`",
                labels=[(within.span, "conflicts with this")],
            )


def _words(quantity: Quantity) -> str:
    return display(quantity.value, Dimension.DURATION)
