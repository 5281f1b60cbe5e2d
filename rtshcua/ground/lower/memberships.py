"""Comparisons of enumerations and of the mission's phase to postfix code: each asks whether a value is in a set."""

from collections.abc import Iterable, Mapping

from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.phases import is_about_phase
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.lower.emit import Code
from rtshcua.ground.lower.sets import Sets
from rtshcua.ground.lower.slots import Slots, enum_labels
from rtshcua.model.flat.code import Op
from rtshcua.model.ir.expression import Comparison, OneOf, Reference, Value, Within
from rtshcua.model.ir.signals import SignalDecl

_MIRRORED: Mapping[str, str] = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


class Memberships:
    """Lowers memberships in one scope; `cells` has the argument cell of each parameter."""

    def __init__(self, context: Context, slots: Slots, sets: Sets, scope: Scope, cells: Mapping[str, int]) -> None:
        self._context = context
        self._slots = slots
        self._sets = sets
        self._scope = scope
        self._cells = cells

    def compare(self, code: Code, node: Comparison) -> bool:
        """Whether a comparison is one of an enumeration or of the phase, and then its code."""
        if is_about_phase(node):
            assert isinstance(node.right, Reference)
            self._phase(code, [node.right.name])
            if node.operator == "!=":
                code.add(Op.NOT)
            return True
        for subject, constant, operator in (
            (node.left, node.right, node.operator),
            (node.right, node.left, _MIRRORED[node.operator]),
        ):
            members = self._members(subject)
            if members is not None:
                assert isinstance(constant, Reference)
                values, names = members
                self._member(code, subject, _satisfying(values, operator, names[constant.name]))
                return True
        return False

    def between(self, code: Code, node: Within) -> bool:
        """Whether `subject in low .. high` is about an enumeration, and then its code."""
        members = self._members(node.subject)
        if members is None:
            return False
        low, high = node.range.low, node.range.high
        values, names = members
        assert isinstance(low, Reference)
        assert isinstance(high, Reference)
        self._member(code, node.subject, {each for each in values if names[low.name] <= each <= names[high.name]})
        return True

    def one_of(self, code: Code, node: OneOf) -> None:
        """`subject in {a, b}`."""
        if is_about_phase(node):
            self._phase(code, [name.text for name in node.names])
            return
        members = self._members(node.subject)
        assert members is not None
        self._member(code, node.subject, {members[1][name.text] for name in node.names})

    def _phase(self, code: Code, names: Iterable[str]) -> None:
        code.add(Op.PHASE_IN, 0, self._sets.of_phases(names))

    def _members(self, node: Value) -> tuple[frozenset[int], Mapping[str, int]] | None:
        """All values of a name's enumeration, and the declared ones by name; None for what is no enumeration's."""
        found = self._scope.find(node.name) if isinstance(node, Reference) else None
        type = None if found is None else self._scope.type_of(found)
        if type is None or type.enumeration is None:
            return None
        names = type.enumeration.members
        if isinstance(found, SignalDecl):
            labels = enum_labels(self._context, self._context.symbols.enums[found.type.text])
            return frozenset(value for value, _ in labels), names
        return frozenset(names.values()), names

    def _member(self, code: Code, subject: Value, values: Iterable[int]) -> None:
        assert isinstance(subject, Reference)
        members = self._sets.of(values)
        if isinstance(self._scope.find(subject.name), Argument):
            code.add(Op.ARGUMENT_IN, self._cells[subject.name], members)
        else:
            code.add(Op.SIGNAL_IN, self._slots.of(subject.name), members)


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
