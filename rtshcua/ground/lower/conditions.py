"""Conditions to postfix code. What is lowered here was found well typed.

Which side is the safe one for a derived zone depends on what the condition is for, and on the `not` before it: a zone
that must be flown in is never too large, one that must not be is never too small. `for the last`, `within the last` and
`within ... of` are true the more, the more their condition is, so they keep the side; an edge reads no grown zone.
"""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.checker.types import ZONE
from rtshcua.ground.checker.values import typed
from rtshcua.ground.lower import clock
from rtshcua.ground.lower.emit import Code
from rtshcua.ground.lower.files import Files
from rtshcua.ground.lower.memberships import Memberships
from rtshcua.ground.lower.monitors import Monitors
from rtshcua.ground.lower.numbers import Numbers
from rtshcua.ground.lower.sets import Sets
from rtshcua.ground.lower.slots import Slots
from rtshcua.ground.lower.zones import ZoneTable
from rtshcua.model.flat.code import MAX_INSTRUCTIONS, MAX_STACK, Clause, Op
from rtshcua.model.flat.policy import MonitorKind
from rtshcua.model.ir.expression import (
    Comparison,
    Condition,
    Edge,
    ForLast,
    Grow,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Reference,
    TimeOfDay,
    Within,
    WithinLast,
)
from rtshcua.model.ir.node import Node


class Place(NamedTuple):
    """Where a condition stands: its scope, the first argument cell of each parameter, and which side is safe.

    `strict` holds where the condition must be TRUE for the vehicle to go on; it is false for what stops it (`forbid`,
    `confirm`, `degrade`).
    """

    scope: Scope
    cells: Mapping[str, int]
    strict: bool


def _smaller(node: Condition) -> str:
    """How a condition that is too large is said in less."""
    ranges = "comparisons of one value are shorter as a range, `a in low .. high`, or as a set, `a in {x, y}`"
    if isinstance(node, Junction) and node.operator == "or":
        return f"in a policy, write a rule for each part of the `or`; or say less: {ranges}"
    return f"say less: {ranges}"


class Conditions:
    """Lowers the conditions of one policy into shared slots, zones, sets and monitors."""

    def __init__(self, context: Context, slots: Slots, zones: ZoneTable, files: Files) -> None:
        self._context = context
        self._slots = slots
        self._zones = zones
        self._files = files
        self.sets = Sets()
        self.monitors = Monitors()
        self._monitored: dict[tuple[Condition, MonitorKind, int, bool], int] = {}

    def clause(self, node: Condition, place: Place, at: Node | None = None) -> Clause:
        """A condition with its text and place; `at` is what to quote, the condition itself if None."""
        code = Code()
        self._condition(code, node, place, place.strict)
        quoted = node if at is None else at
        if code.length > MAX_INSTRUCTIONS or code.deepest > MAX_STACK:
            self._context.report.add(
                codes.CONDITION_SIZE,
                node.span,
                f"the condition takes {code.length} instructions on a stack of {code.deepest}, and on board fit "
                f"{MAX_INSTRUCTIONS} on one of {MAX_STACK}",
                help=_smaller(node),
            )
        text, source, start, end = self._files.place(quoted.span)
        return Clause(text, source, start, end, tuple(code.integers))

    def monitors_of(self, operand: Condition, kind: MonitorKind, window_us: int) -> tuple[int, ...]:
        """The monitors that an operand which was lowered is kept by: one for each safe side that was asked for."""
        keys = ((operand, kind, window_us, safe) for safe in (True, False))
        return tuple(sorted({self._monitored[key] for key in keys if key in self._monitored}))

    def _condition(self, code: Code, node: Condition, place: Place, safe: bool) -> None:
        match node:
            case Not():
                self._condition(code, node.operand, place, not safe)
                code.add(Op.NOT)
            case Junction():
                for number, operand in enumerate(node.operands):
                    self._condition(code, operand, place, safe)
                    if number:
                        code.add(Op.AND if node.operator == "and" else Op.OR)
            case ForLast():
                self._monitor(code, MonitorKind.FOR_LAST, node.operand, node.window.value, place, safe)
            case WithinLast():
                self._monitor(code, MonitorKind.WITHIN_LAST, node.operand, node.window.value, place, safe)
            case Edge():
                kind = MonitorKind.RISING if node.rising else MonitorKind.FALLING
                self._monitor(code, kind, node.operand, 0, place, safe)
            case Near():
                self._near(code, node, place, safe)
            case Inside():
                self._inside(code, node, place, safe)
            case Known():
                self._known(code, node)
            case Comparison() | Within() | OneOf():
                self._compared(code, node, place)

    def _compared(self, code: Code, node: Comparison | Within | OneOf, place: Place) -> None:
        """What compares numbers, members of an enumeration, phases, or times of day."""
        members = Memberships(self._context, self._slots, self.sets, place.scope, place.cells)
        numbers = Numbers(self._context.report, self._slots, place.scope, place.cells)
        match node:
            case Comparison():
                if not clock.compare(code, node) and not members.compare(code, node):
                    numbers.compare(code, node)
            case Within(range=limits):
                if isinstance(limits.low, TimeOfDay) and isinstance(limits.high, TimeOfDay):
                    clock.window(code, self.sets, limits.low.value, limits.high.value, node.days)
                elif not members.between(code, node):
                    numbers.between(code, node)
            case OneOf():
                members.one_of(code, node)

    def _known(self, code: Code, node: Known) -> None:
        """Each slot of the signal has a value; a position has two."""
        slot = self._slots.of(node.subject.name)
        code.add(Op.KNOWN, slot)
        if self._slots.width(node.subject.name) > 1:
            code.add(Op.KNOWN, slot + 1)
            code.add(Op.AND)

    def _near(self, code: Code, node: Near, place: Place, safe: bool) -> None:
        """One of two is true now, and the other was at some moment of the window."""
        for now, before in ((node.left, node.right), (node.right, node.left)):
            self._condition(code, now, place, safe)
            self._monitor(code, MonitorKind.WITHIN_LAST, before, node.window.value, place, safe)
            code.add(Op.AND)
        code.add(Op.OR)

    def _monitor(
        self, code: Code, kind: MonitorKind, operand: Condition, window_us: int, place: Place, safe: bool
    ) -> None:
        key = (operand, kind, window_us, safe)
        number = self._monitored.get(key)
        if number is None:
            when = self.clause(operand, Place(place.scope, {}, safe))
            number = self._monitored[key] = self.monitors.of(kind, window_us, when)
        code.add(Op.MONITOR, number)

    def _inside(self, code: Code, node: Inside, place: Place, safe: bool) -> None:
        assert isinstance(node.subject, Reference)
        region, margin = node.region, 0
        if isinstance(region, Grow):
            found = typed(place.scope, region.margin)
            assert found is not None
            assert found.constant is not None
            region, margin = region.zone, int(found.constant)
        smaller = safe != node.negated
        subject = place.scope.find(node.subject.name)
        if isinstance(subject, Argument) and subject.type == ZONE:
            which = self._zones.disjoint if node.negated else self._zones.within
            members = self.sets.of(which(region.name, margin, smaller=smaller, span=node.region.span))
            code.add(Op.ARGUMENT_IN, place.cells[node.subject.name], members)
            for exists in self._zones.times(region.name, self.sets):
                code.add(*exists)
                if node.negated:
                    code.add(Op.NOT)
                code.add(Op.OR if node.negated else Op.AND)
            return
        if isinstance(place.scope.find(region.name), Argument):
            code.add(Op.POSITION_IN_ARGUMENT, place.cells[region.name], self._zones.table(margin, smaller=smaller))
        else:
            zone = self._zones.zone(region.name, margin, smaller=smaller, span=node.region.span)
            if isinstance(subject, Argument):
                code.add(Op.ARGUMENT_POINT_IN, place.cells[node.subject.name], zone)
            else:
                code.add(Op.POSITION_IN, zone)
        if node.negated:
            code.add(Op.NOT)
