"""The conditions over time that a policy observes, found again by what they say."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.parts import walk
from rtshcua.ground.lower.conditions import Conditions
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.model.flat.policy import MonitorKind
from rtshcua.model.ir.expression import Condition, Edge, ForLast, Near, WithinLast
from rtshcua.model.ir.node import Node


class _Timed(NamedTuple):
    """What is kept of a condition over time: how it looks back, how far, and at what."""

    kind: MonitorKind
    window_us: int
    operand: Condition


class Monitored:
    """The monitors of a policy by their condition: what it says counts, not where it is written."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[MonitorKind, int, Any], tuple[int, ...]] = {}
        self.texts: list[str] = []

    def numbers(self, condition: Condition) -> Sequence[int]:
        """The monitors of a condition: none where nothing observes it, two where it is kept for either safe side."""
        timed = next(_timed(condition), None)
        return () if timed is None else self._numbers.get(_key(timed), ())

    def add(self, timed: _Timed, found: Conditions, text: str) -> None:
        """Note what a condition of the policy became."""
        numbers = found.monitors_of(timed.operand, timed.kind, timed.window_us)
        if numbers and _key(timed) not in self._numbers:
            self._numbers[_key(timed)] = numbers
            self.texts.append(text)


def monitored(context: Context, under: LoweredPolicy) -> Monitored:
    """All that the rules of a policy, and the contracts under it, observe over time."""
    found = Monitored()
    for condition in _conditions(context, under) if under.policy.monitors else ():
        for part in walk(condition):
            for timed in _timed(part):
                found.add(timed, under.conditions, context.report.text(part.span))
    return found


def _conditions(context: Context, under: LoweredPolicy) -> Iterator[Condition]:
    for rule in under.rules:
        if rule.when is not None:
            yield rule.when
    for name in under.skills:
        skill = context.symbols.skills[name]
        for clause in (*skill.require, *skill.assume, *skill.maintain):
            yield clause.condition


def _timed(node: Any) -> Iterator[_Timed]:
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
    return timed.kind, timed.window_us, _said(timed.operand)


def _said(node: Any) -> Any:
    """A node without its places."""
    if isinstance(node, Node):
        fields = (name for name in type(node).__struct_fields__ if name != "span")
        return type(node).__name__, *(_said(getattr(node, name)) for name in fields)
    return tuple(map(_said, node)) if type(node) is tuple else node
