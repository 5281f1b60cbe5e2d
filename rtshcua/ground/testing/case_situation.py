"""The situation of a case: the values of its nominal, replaced by those of its test, and then by those of its row.

A condition over time is matched with the policy's monitors by its content.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from rtshcua.decision.temporal import lasting
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.analysis.space import means_unknown
from rtshcua.ground.checker.condition_nodes import walk
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.lower.conditions import ConditionLowering
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.testing.case import PolicyUnderTest
from rtshcua.model.flat.policy import MonitorKind, RuleKind
from rtshcua.model.flat.signal import POSITION, Signal
from rtshcua.model.flat.situation import ConfirmAnswer, Now, State
from rtshcua.model.ir.expression import Condition, Coordinates, Edge, ForLast, Near, Reference, WithinLast
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.tests import Answer, Named, OverTime, Subject, TableCell


class _Timed(NamedTuple):
    """A condition over time: its kind, its window, and its operand."""

    kind: MonitorKind
    window_us: int
    operand: Condition


class MonitorIndex:
    """The monitors of a policy by the content of their condition, whatever its place."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[MonitorKind, int, Any], tuple[int, ...]] = {}
        self.texts: list[str] = []

    def numbers(self, condition: Condition) -> Sequence[int]:
        """The monitors of a condition: none if it is not observed, two if it is observed for both safe sides."""
        timed = next(_timed_of(condition), None)
        return () if timed is None else self._numbers.get(_key(timed), ())

    def add(self, timed: _Timed, found: ConditionLowering, text: str) -> None:
        """Add the monitors of a condition of the policy."""
        numbers = found.monitors_of(timed.operand, timed.kind, timed.window_us)
        if numbers and _key(timed) not in self._numbers:
            self._numbers[_key(timed)] = numbers
            self.texts.append(text)


def monitors_of(context: CheckContext, under: LoweredPolicy) -> MonitorIndex:
    """Return the index of all conditions over time in a policy's rules and contracts."""
    found = MonitorIndex()
    for condition in _conditions(context, under) if under.policy.monitors else ():
        for part in walk(condition):
            for timed in _timed_of(part):
                found.add(timed, under.conditions, context.report.text(part.span))
    return found


def _conditions(context: CheckContext, under: LoweredPolicy) -> Iterator[Condition]:
    for rule in under.rules:
        if rule.when is not None:
            yield rule.when
    for name in under.skills:
        skill = context.symbols.skills[name]
        for clause in (*skill.require, *skill.assume, *skill.maintain):
            yield clause.condition


def _timed_of(node: Any) -> Iterator[_Timed]:
    match node:
        case ForLast():
            yield _Timed(MonitorKind.FOR_LAST, node.window.value, node.operand)
        case WithinLast():
            yield _Timed(MonitorKind.WITHIN_LAST, node.window.value, node.operand)
        case Edge():
            yield _Timed(MonitorKind.RISING if node.rising else MonitorKind.FALLING, 0, node.operand)
        case Near():
            for before in (node.left, node.right):
                yield _Timed(MonitorKind.WITHIN_LAST, node.window.value, before)


def _key(timed: _Timed) -> tuple[MonitorKind, int, Any]:
    return timed.kind, timed.window_us, _without_spans(timed.operand)


def _without_spans(node: Any) -> Any:
    """A node without its spans."""
    if isinstance(node, Node):
        fields = (name for name in type(node).__struct_fields__ if name != "span")
        return type(node).__name__, *(_without_spans(getattr(node, name)) for name in fields)
    return tuple(map(_without_spans, node)) if type(node) is tuple else node


TRUTHS = {"true": TRUE, "false": FALSE}


class SubjectValue(NamedTuple):
    """A subject and its value, with the span of both."""

    subject: Subject
    cell: TableCell
    span: Span


class Situations:
    """Makes the states of the cases under one policy, and reports subjects that the policy does not read."""

    def __init__(self, context: CheckContext, policy: PolicyUnderTest) -> None:
        self._context = context
        self._policy = policy
        self._signals = {signal.name: signal for signal in policy.lowered.policy.signals}
        self._monitors = monitors_of(context, policy.lowered)

    def state(self, assigned: Iterable[SubjectValue], now: Now) -> State:
        """Return the state with the assigned values, of which later ones replace earlier ones; all else is unknown.

        Conditions over time are computed as if the state had lasted longer than their windows, except those that are
        assigned.
        """
        flat = self._policy.lowered.policy
        values: list[int | None] = [None] * flat.slots
        ages = [0] * flat.slots
        truths: list[tuple[Sequence[int], int]] = []
        for subject, cell, span in assigned:
            if isinstance(subject, OverTime):
                truths.append((self._numbers(subject), _truth_of(cell)))
                continue
            signal = self._signals.get(subject.name.text)
            if signal is None:
                self._unread(subject, span)
                continue
            for offset, value in enumerate(self._cells(signal, cell)):
                values[signal.slot + offset] = value
                ages[signal.slot + offset] = 0 if cell.measured is None else cell.measured.value
        state = lasting(State(tuple(values), tuple(ages)), self._policy.prepared, now)
        monitors = list(state.monitors)
        for numbers, truth in truths:
            for number in numbers:
                monitors[number] = truth
        return State(state.values, state.ages, tuple(monitors))

    def approvals(self, answers: Iterable[Answer], at_us: int) -> tuple[ConfirmAnswer, ...]:
        """Return the approvals for the `confirm` rules, at monotonic times before `at_us`.

        Each answer is by a different person.
        """
        under = self._policy.lowered
        found: list[ConfirmAnswer] = []
        for person, answer in enumerate(answers):
            role = under.roles.get(answer.role.text)
            rules = [
                number
                for number, rule in enumerate(under.policy.rules)
                if rule.kind == RuleKind.CONFIRM and role in (rule.approver, rule.second)
            ]
            if role is None or not rules:
                self._unasked(answer)
                continue
            moment = at_us - (0 if answer.ago is None else answer.ago.value)
            found += [ConfirmAnswer(number, role, int(answer.granted), moment, person) for number in rules]
        return tuple(found)

    def missing(self, reads: Iterable[int], assigned: Iterable[SubjectValue]) -> list[str]:
        """The signals in these slots that have no assigned value."""
        known = {each.subject.name.text for each in assigned if isinstance(each.subject, Named)}
        slots = set(reads)
        return [name for name, signal in self._signals.items() if signal.slot in slots and name not in known]

    def _cells(self, signal: Signal, cell: TableCell) -> tuple[int | None, ...]:
        value = None if cell.value is None else self._context.given.get((signal.name, cell.value))
        if value is None:
            return (None, None) if signal.kind == POSITION else (None,)
        if isinstance(value, Coordinates):
            place = self._policy.lowered.zones.place(value)
            return (None, None) if place is None else (place[0], place[1])
        assert isinstance(value, int)
        return (None,) if means_unknown(signal, value) else (value,)

    def _numbers(self, subject: OverTime) -> Sequence[int]:
        numbers = self._monitors.numbers(subject.condition)
        if not numbers:
            text = self._context.report.text(subject.condition.span)
            near = suggestion(text, self._monitors.texts)
            self._context.report.add(
                codes.WITHOUT_EFFECT,
                subject.span,
                f"`{self._policy.name}` does not observe `{text}`, so its value has no effect",
                help=near or (f"it observes {listed(self._monitors.texts)}" if self._monitors.texts else None),
                labels=[(self._policy.lowered.declaration.name.span, "the policy is declared here")],
            )
        return numbers

    def _unread(self, subject: Named, span: Span) -> None:
        self._context.report.add(
            codes.WITHOUT_EFFECT,
            span,
            f"`{self._policy.name}` does not read `{subject.name.text}`, so its value has no effect",
            help="the vehicle is without this signal"
            if subject.name.text in self._policy.lowered.policy.vehicle.without
            else f"it reads {listed(self._signals)}",
            labels=[(self._policy.lowered.declaration.name.span, "the policy is declared here")],
        )

    def _unasked(self, answer: Answer) -> None:
        under = self._policy.lowered
        confirms = [rule for rule in under.policy.rules if rule.kind == RuleKind.CONFIRM]
        approvers = dict.fromkeys(role for rule in confirms for role in (rule.approver, rule.second) if role != -1)
        names = [under.policy.roles[role] for role in approvers]
        waits = f"its rules wait for {listed(names)}" if names else "it has no `confirm`"
        self._context.report.add(
            codes.WITHOUT_EFFECT,
            answer.span,
            f"no `confirm` of `{self._policy.name}` waits for the role `{answer.role.text}`",
            help=suggestion(answer.role.text, names) or waits,
            labels=[(under.declaration.name.span, "the policy is declared here")],
        )


def _truth_of(cell: TableCell) -> int:
    return TRUTHS.get(cell.value.name, UNKNOWN) if isinstance(cell.value, Reference) else UNKNOWN
