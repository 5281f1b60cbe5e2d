"""Conditions to postfix code. What is lowered here was found well typed.

Which side is the safe one for a derived zone depends on what the condition is for, and on the `not` before it: a zone
that must be flown in is never too large, one that must not be is never too small.
"""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.checker.types import ZONE
from rtshcua.ground.checker.values import typed
from rtshcua.ground.compiler.emit import Code
from rtshcua.ground.compiler.files import Files
from rtshcua.ground.compiler.numbers import Numbers
from rtshcua.ground.compiler.slots import Slots, enum_labels
from rtshcua.ground.compiler.zones import ZoneTable
from rtshcua.model.flat.code import MAX_INSTRUCTIONS, MAX_STACK, Clause, Op
from rtshcua.model.flat.limits import DAY
from rtshcua.model.ir.expression import (
    Comparison,
    Condition,
    Grow,
    Inside,
    Junction,
    Not,
    OneOf,
    Reference,
    TimeOfDay,
    Value,
    Within,
)
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.signals import SignalDecl

_MIRRORED: Mapping[str, str] = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


class Place(NamedTuple):
    """Where a condition stands: its scope, the first argument cell of each parameter, and which side is safe.

    `strict` holds where the condition must be TRUE for the vehicle to go on; it is false for what stops it (`forbid`,
    `confirm`, `degrade`).
    """

    scope: Scope
    cells: Mapping[str, int]
    strict: bool


class Conditions:
    """Lowers the conditions of one policy into shared slots, zones and sets."""

    def __init__(self, context: Context, slots: Slots, zones: ZoneTable, files: Files) -> None:
        self._context = context
        self._slots = slots
        self._zones = zones
        self._files = files
        self.sets: list[tuple[int, ...]] = []
        self._sets: dict[tuple[int, ...], int] = {}

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
                help="split it at `and` into several clauses or rules",
            )
        text, source, start, end = self._files.place(quoted.span)
        return Clause(text, source, start, end, tuple(code.integers))

    def _condition(self, code: Code, node: Condition, place: Place, safe: bool) -> None:
        match node:
            case Comparison():
                self._comparison(code, node, place)
            case Within():
                self._within(code, node, place)
            case OneOf():
                found = typed(place.scope, node.subject)
                assert found is not None
                assert found.type.enumeration is not None
                members = found.type.enumeration.members
                self._member(code, node.subject, {members[name.text] for name in node.names}, place)
            case Inside():
                self._inside(code, node, place, safe)
            case Not():
                self._condition(code, node.operand, place, not safe)
                code.add(Op.NOT)
            case Junction():
                for number, operand in enumerate(node.operands):
                    self._condition(code, operand, place, safe)
                    if number:
                        code.add(Op.AND if node.operator == "and" else Op.OR)

    def _comparison(self, code: Code, node: Comparison, place: Place) -> None:
        for subject, constant, operator in (
            (node.left, node.right, node.operator),
            (node.right, node.left, _MIRRORED[node.operator]),
        ):
            members = self._members(subject, place)
            if members is not None:
                assert isinstance(constant, Reference)
                values, names = members
                self._member(code, subject, _satisfying(values, operator, names[constant.name]), place)
                return
        Numbers(self._context.report, self._slots, place.scope, place.cells).compare(code, node)

    def _within(self, code: Code, node: Within, place: Place) -> None:
        low, high = node.range.low, node.range.high
        if isinstance(low, TimeOfDay) and isinstance(high, TimeOfDay):
            code.add(Op.TIME_IN, low.value % DAY, high.value)
            return
        members = self._members(node.subject, place)
        if members is None:
            Numbers(self._context.report, self._slots, place.scope, place.cells).between(code, node)
            return
        values, names = members
        assert isinstance(low, Reference)
        assert isinstance(high, Reference)
        among = {value for value in values if names[low.name] <= value <= names[high.name]}
        self._member(code, node.subject, among, place)

    def _members(self, node: Value, place: Place) -> tuple[frozenset[int], Mapping[str, int]] | None:
        """All values of a name's enumeration, and the declared ones by name; None for what is no enumeration's."""
        found = place.scope.find(node.name) if isinstance(node, Reference) else None
        type = None if found is None else place.scope.type_of(found)
        if type is None or type.enumeration is None:
            return None
        names = type.enumeration.members
        if isinstance(found, SignalDecl):
            labels = enum_labels(self._context, self._context.symbols.enums[found.type.text])
            return frozenset(value for value, _ in labels), names
        return frozenset(names.values()), names

    def _member(self, code: Code, subject: Value, values: set[int], place: Place) -> None:
        assert isinstance(subject, Reference)
        members = self._set(tuple(sorted(values)))
        if isinstance(place.scope.find(subject.name), Argument):
            code.add(Op.ARGUMENT_IN, place.cells[subject.name], members)
        else:
            code.add(Op.SIGNAL_IN, self._slots.of(subject.name), members)

    def _inside(self, code: Code, node: Inside, place: Place, safe: bool) -> None:
        assert isinstance(node.subject, Reference)
        region, margin = (node.region, 0)
        if isinstance(node.region, Grow):
            region, margin = node.region.zone, node.region.margin.value
        assert isinstance(region, Reference)
        smaller = safe != node.negated
        subject = place.scope.find(node.subject.name)
        if isinstance(subject, Argument) and subject.type == ZONE:
            which = self._zones.disjoint if node.negated else self._zones.within
            members = self._set(which(region.name, margin, smaller=smaller, span=node.region.span))
            code.add(Op.ARGUMENT_IN, place.cells[node.subject.name], members)
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

    def _set(self, members: tuple[int, ...]) -> int:
        number = self._sets.get(members)
        if number is None:
            number = self._sets[members] = len(self.sets)
            self.sets.append(members)
        return number


def _satisfying(values: frozenset[int], operator: str, bound: int) -> set[int]:
    """The values for which `value operator bound` holds."""
    match operator:
        case "<":
            return {value for value in values if value < bound}
        case "<=":
            return {value for value in values if value <= bound}
        case ">":
            return {value for value in values if value > bound}
        case ">=":
            return {value for value in values if value >= bound}
        case "==":
            return {bound}
        case _:
            return set(values - {bound})
