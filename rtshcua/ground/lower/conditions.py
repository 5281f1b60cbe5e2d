"""Lower well-typed conditions to postfix code (`rtshcua.model.flat.code`).

A derived zone is rounded to the safe side, which depends on the purpose of the condition and on the `not` before it. A
zone in which the vehicle must fly is never too large, and a zone that it must not enter is never too small. `for the
last`, `within the last` and `within ... of` are monotonic, so they keep the side. An edge reads no grown zone.

Numbers are linear forms with exact rational factors, or the maximum or minimum of several forms. A comparison of forms
is multiplied so that every factor is an integer: nothing is rounded, and all values fit in 64 bits. `max(a, b) <= c`
becomes `a <= c and b <= c`, `max(a, b) >= c` becomes `a >= c or b >= c`, and `min` is lowered correspondingly. So a
single known part may decide the comparison. `==` of such forms becomes `<=` and `>=`, `!=` becomes `<` or `>`.

A comparison of an enumeration or of the mission's phase becomes a test whether the value is in a set, and a comparison
of the local time a test whether it is in a window of the day. A window includes both its ends, in whole us: before
19:00 ends with the last us before it, after 19:00 begins with the next us. A window on some days of the week begins on
these days and may end on the day after.
"""

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm
from typing import Any, NamedTuple, TypeAlias

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arithmetic import COHERENT
from rtshcua.ground.checker.conditions import is_about_phase
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.name_scope import Argument, Scope
from rtshcua.ground.checker.types import ZONE
from rtshcua.ground.checker.values import typed
from rtshcua.ground.lower.tables import MonitorTable, SignalSlots, SourceTable, ValueSets, enum_labels
from rtshcua.ground.lower.zones import ZoneTable, weekly_windows
from rtshcua.model.flat.code import MAX_INSTRUCTIONS, MAX_STACK, Clause, Op
from rtshcua.model.flat.limits import DAY, MAX_MAGNITUDE, MAX_VALUE, WEEK
from rtshcua.model.flat.policy import MonitorKind
from rtshcua.model.ir.expression import (
    Arithmetic,
    Comparison,
    Condition,
    Edge,
    ForLast,
    Function,
    Grow,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Quantity,
    Reference,
    TimeOfDay,
    Value,
    Within,
    WithinLast,
)
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.quantity import Dimension

_COMPARE: Mapping[str, Op] = {"<": Op.LT, "<=": Op.LE, ">": Op.GT, ">=": Op.GE, "==": Op.EQ, "!=": Op.NE}
_MIRRORED: Mapping[str, str] = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}
_HOLDS: Mapping[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


# ---------------------------------------------------------------- instructions

_PUSHES = frozenset(
    {
        Op.CONST,
        Op.SIGNAL,
        Op.ARGUMENT,
        Op.SIGNAL_IN,
        Op.ARGUMENT_IN,
        Op.KNOWN,
        Op.POSITION_IN,
        Op.POSITION_IN_ARGUMENT,
        Op.ARGUMENT_POINT_IN,
        Op.TIME_IN,
        Op.WEEK_IN,
        Op.PHASE_IN,
        Op.MONITOR,
    }
)
_KEEPS = frozenset({Op.NOT, Op.SCALE})


class CodeWriter:
    """Collects instructions in order, with the largest depth of their stack."""

    def __init__(self) -> None:
        self.integers: list[int] = []
        self.deepest = 0
        self._depth = 0

    def add(self, op: Op, a: int = 0, b: int = 0) -> None:
        """Append one instruction."""
        self.integers += (int(op), a, b)
        if op in _PUSHES:
            self._depth += 1
            self.deepest = max(self.deepest, self._depth)
        elif op not in _KEEPS:
            self._depth -= 1

    @property
    def length(self) -> int:
        """The number of instructions."""
        return len(self.integers) // 3


# ---------------------------------------------------------------- forms of numbers


class TooManyForms(Exception):
    """An expression of `min` and `max` has more combinations than a condition on board may have."""


class FormVariable(NamedTuple):
    """A state slot or an argument cell."""

    argument: bool
    at: int


@dataclass(frozen=True, slots=True)
class LinearForm:
    """The sum of `terms` and `constant`. A variable with factor 0 is kept: if it is missing, the sum is unknown."""

    terms: Mapping[FormVariable, Fraction]
    constant: Fraction

    leaves = 1


@dataclass(frozen=True, slots=True)
class Extremum:
    """The maximum (`most`) or the minimum of several numbers. `leaves` counts its linear forms."""

    most: bool
    among: tuple["Form", ...]
    leaves: int


Form: TypeAlias = LinearForm | Extremum


def constant(value: Fraction) -> LinearForm:
    """Return a constant as a form."""
    return LinearForm({}, value)


def extremum(most: bool, among: Sequence[Form]) -> Form:
    """Return the maximum or the minimum of forms; of constants, the constant."""
    known = [form.constant for form in among if isinstance(form, LinearForm) and not form.terms]
    if len(known) == len(among):
        return constant(max(known) if most else min(known))
    leaves = sum(form.leaves for form in among)
    if leaves > MAX_INSTRUCTIONS:
        raise TooManyForms
    return among[0] if len(among) == 1 else Extremum(most, tuple(among), leaves)


def scaled(form: Form, factor: Fraction) -> Form:
    """Return `form` times a number. A negative factor turns a maximum into a minimum."""
    if isinstance(form, Extremum):
        return Extremum(form.most == (factor >= 0), tuple(scaled(each, factor) for each in form.among), form.leaves)
    return LinearForm({variable: term * factor for variable, term in form.terms.items()}, form.constant * factor)


def plus(left: Form, right: Form) -> Form:
    """Return `left + right`. Adding to a maximum adds to each of its forms."""
    if isinstance(left, Extremum) or isinstance(right, Extremum):
        if left.leaves * right.leaves > MAX_INSTRUCTIONS:
            raise TooManyForms
        if isinstance(left, Extremum):
            return extremum(left.most, [plus(each, right) for each in left.among])
        assert isinstance(right, Extremum)
        return extremum(right.most, [plus(left, each) for each in right.among])
    terms = dict(left.terms)
    for variable, factor in right.terms.items():
        terms[variable] = terms.get(variable, Fraction(0)) + factor
    return LinearForm(terms, left.constant + right.constant)


# ---------------------------------------------------------------- conditions


class ConditionPlace(NamedTuple):
    """The context of a condition: its scope, the first argument cell of each parameter, and the safe side.

    `strict` is true if the condition must be TRUE for the vehicle to continue, and false if it stops the vehicle
    (`forbid`, `confirm`, `degrade`).
    """

    scope: Scope
    cells: Mapping[str, int]
    strict: bool


class ConditionLowering:
    """Lowers the conditions of one policy, with shared slots, zones, sets and monitors."""

    def __init__(self, context: CheckContext, slots: SignalSlots, zones: ZoneTable, files: SourceTable) -> None:
        self._context = context
        self.slots = slots
        self.zones = zones
        self.files = files
        self.sets = ValueSets()
        self.monitors = MonitorTable()
        self._monitored: dict[tuple[Condition, MonitorKind, int, bool], int] = {}

    def clause(self, node: Condition, place: ConditionPlace, at: Node | None = None) -> Clause:
        """Lower a condition, with its text and place. `at` is the node to quote, by default the condition itself."""
        code = CodeWriter()
        self._condition(code, node, place, place.strict)
        quoted = node if at is None else at
        if code.length > MAX_INSTRUCTIONS or code.deepest > MAX_STACK:
            ranges = "compare one value with a range, `a in low .. high`, or with a set, `a in {x, y}`"
            is_choice = isinstance(node, Junction) and node.operator == "or"
            self._context.report.add(
                codes.CONDITION_SIZE,
                node.span,
                f"the condition takes {code.length} instructions and {code.deepest} stack entries, but at most "
                f"{MAX_INSTRUCTIONS} and {MAX_STACK} fit on board",
                help=f"in a policy, write a rule for each part of the `or`; or simplify the condition: {ranges}"
                if is_choice
                else f"simplify the condition: {ranges}",
            )
        text, source, start, end = self.files.place(quoted.span)
        return Clause(text, source, start, end, tuple(code.integers))

    def monitors_of(self, operand: Condition, kind: MonitorKind, window_us: int) -> tuple[int, ...]:
        """Return the monitors of an operand that is already lowered, one for each safe side in use."""
        keys = ((operand, kind, window_us, safe) for safe in (True, False))
        return tuple(sorted({self._monitored[key] for key in keys if key in self._monitored}))

    def _condition(self, code: CodeWriter, node: Condition, place: ConditionPlace, safe: bool) -> None:
        match node:
            case Not():
                self._condition(code, node.operand, place, not safe)
                code.add(Op.NOT)
            case Junction():
                for number, operand in enumerate(node.operands):
                    self._condition(code, operand, place, safe)
                    if number:
                        code.add(Op.AND if node.operator == "and" else Op.OR)
            case ForLast() | WithinLast() | Edge() | Near():
                self._temporal(code, node, place, safe)
            case Inside():
                self._inside(code, node, place, safe)
            case Known():
                self._known(code, node.subject.name)
            case Comparison():
                self._comparison(code, node, place)
            case Within():
                self._range(code, node, place)
            case OneOf():
                self._one_of(code, node, place)

    def _temporal(
        self, code: CodeWriter, node: ForLast | WithinLast | Edge | Near, place: ConditionPlace, safe: bool
    ) -> None:
        match node:
            case ForLast():
                self._monitor(code, MonitorKind.FOR_LAST, node.operand, node.window.value, place, safe)
            case WithinLast():
                self._monitor(code, MonitorKind.WITHIN_LAST, node.operand, node.window.value, place, safe)
            case Edge():
                kind = MonitorKind.RISING if node.rising else MonitorKind.FALLING
                self._monitor(code, kind, node.operand, 0, place, safe)
            case Near():  # one operand is true now, and the other was true at some time in the window
                for now, before in ((node.left, node.right), (node.right, node.left)):
                    self._condition(code, now, place, safe)
                    self._monitor(code, MonitorKind.WITHIN_LAST, before, node.window.value, place, safe)
                    code.add(Op.AND)
                code.add(Op.OR)

    def _monitor(
        self, code: CodeWriter, kind: MonitorKind, operand: Condition, window_us: int, place: ConditionPlace, safe: bool
    ) -> None:
        key = (operand, kind, window_us, safe)
        number = self._monitored.get(key)
        if number is None:
            when = self.clause(operand, ConditionPlace(place.scope, {}, safe))
            number = self._monitored[key] = self.monitors.of(kind, window_us, when)
        code.add(Op.MONITOR, number)

    def _inside(self, code: CodeWriter, node: Inside, place: ConditionPlace, safe: bool) -> None:
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
            matching = self.zones.disjoint if node.negated else self.zones.within
            members = self.sets.of(matching(region.name, margin, smaller=smaller, span=node.region.span))
            code.add(Op.ARGUMENT_IN, place.cells[node.subject.name], members)
            for exists in self.zones.times(region.name, self.sets):
                code.add(*exists)
                if node.negated:
                    code.add(Op.NOT)
                code.add(Op.OR if node.negated else Op.AND)
            return
        if isinstance(place.scope.find(region.name), Argument):
            code.add(Op.POSITION_IN_ARGUMENT, place.cells[region.name], self.zones.table(margin, smaller=smaller))
        else:
            zone = self.zones.zone(region.name, margin, smaller=smaller, span=node.region.span)
            if isinstance(subject, Argument):
                code.add(Op.ARGUMENT_POINT_IN, place.cells[node.subject.name], zone)
            else:
                code.add(Op.POSITION_IN, zone)
        if node.negated:
            code.add(Op.NOT)

    def _known(self, code: CodeWriter, signal: str) -> None:
        """Test that each slot of the signal has a value. A position has two slots."""
        slot = self.slots.of(signal)
        code.add(Op.KNOWN, slot)
        if self.slots.width(signal) > 1:
            code.add(Op.KNOWN, slot + 1)
            code.add(Op.AND)

    def _one_of(self, code: CodeWriter, node: OneOf, place: ConditionPlace) -> None:
        """Lower `subject in {a, b}`."""
        if is_about_phase(node):
            self._phase(code, [name.text for name in node.names])
            return
        members = self._members(node.subject, place)
        assert members is not None
        self._member(code, node.subject, {members[1][name.text] for name in node.names}, place)

    def _comparison(self, code: CodeWriter, node: Comparison, place: ConditionPlace) -> None:
        """Lower `left operator right` for times of day, phases, members of an enumeration, or numbers."""
        if isinstance(node.right, TimeOfDay):
            _compare_time(code, node.operator, node.right.value)
            return
        if isinstance(node.left, TimeOfDay):
            _compare_time(code, _MIRRORED[node.operator], node.left.value)
            return
        if is_about_phase(node):
            assert isinstance(node.right, Reference)
            self._phase(code, [node.right.name])
            if node.operator == "!=":
                code.add(Op.NOT)
            return
        for subject, constant, comparison in (
            (node.left, node.right, node.operator),
            (node.right, node.left, _MIRRORED[node.operator]),
        ):
            members = self._members(subject, place)
            if members is not None:
                assert isinstance(constant, Reference)
                values, names = members
                holds, bound = _HOLDS[comparison], names[constant.name]
                self._member(code, subject, {value for value in values if holds(value, bound)}, place)
                return
        self._numbers(code, node, node.left, _COMPARE[node.operator], node.right, place)

    def _range(self, code: CodeWriter, node: Within, place: ConditionPlace) -> None:
        """Lower `subject in low .. high`, both ends included."""
        low, high = node.range.low, node.range.high
        if isinstance(low, TimeOfDay) and isinstance(high, TimeOfDay):
            self._time_window(code, low.value, high.value, node.days)
            return
        members = self._members(node.subject, place)
        if members is not None:
            values, names = members
            assert isinstance(low, Reference)
            assert isinstance(high, Reference)
            within = {each for each in values if names[low.name] <= each <= names[high.name]}
            self._member(code, node.subject, within, place)
            return
        self._numbers(code, node, node.subject, Op.GE, low, place)
        self._numbers(code, node, node.subject, Op.LE, high, place)
        code.add(Op.AND)

    def _time_window(self, code: CodeWriter, start: int, end: int, days: tuple[int, ...]) -> None:
        """Lower a window of the day on some days of the week; no days means every day."""
        if days:
            windows = weekly_windows(start, end, days)
            if windows != (0, WEEK):
                code.add(Op.WEEK_IN, self.sets.of(windows), 0)
                return
            start, end = 0, DAY
        code.add(Op.TIME_IN, start % DAY, end)

    def _phase(self, code: CodeWriter, names: Iterable[str]) -> None:
        code.add(Op.PHASE_IN, 0, self.sets.of_phases(names))

    def _members(self, node: Value, place: ConditionPlace) -> tuple[frozenset[int], Mapping[str, int]] | None:
        """Return all values of a name's enumeration, and the declared values by name; None if it has no enumeration."""
        found = place.scope.find(node.name) if isinstance(node, Reference) else None
        type = None if found is None else place.scope.type_of(found)
        if type is None or type.enumeration is None:
            return None
        names = type.enumeration.members
        if isinstance(found, SignalDecl):
            labels = enum_labels(self._context, self._context.symbols.enums[found.type.text])
            return frozenset(value for value, _ in labels), names
        return frozenset(names.values()), names

    def _member(self, code: CodeWriter, subject: Value, values: Iterable[int], place: ConditionPlace) -> None:
        assert isinstance(subject, Reference)
        members = self.sets.of(values)
        if isinstance(place.scope.find(subject.name), Argument):
            code.add(Op.ARGUMENT_IN, place.cells[subject.name], members)
        else:
            code.add(Op.SIGNAL_IN, self.slots.of(subject.name), members)

    # ---------------------------------------------------------------- numbers

    def _numbers(self, code: CodeWriter, node: Node, left: Value, op: Op, right: Value, place: ConditionPlace) -> None:
        report = self._context.report
        try:
            low, high = self._form(left, place), self._form(right, place)
            if isinstance(low, LinearForm) and isinstance(high, LinearForm):
                self._emit(code, node, low, op, high)
            else:
                self._parts(code, node, plus(low, scaled(high, Fraction(-1))), op)
        except TooManyForms:
            report.add(
                codes.CONDITION_SIZE,
                node.span,
                f"`{report.text(node.span)}` compares more than {MAX_INSTRUCTIONS} combinations of sums",
                help="a sum of several `min` and `max` multiplies their alternatives; split the comparison",
            )
            code.add(Op.CONST)

    def _form(self, node: Value, place: ConditionPlace) -> Form:
        """Return the form of a number in coherent units (m, m/s, s, the whole).

        A signal that is read for the first time gets a slot. Raises `TooManyForms`.
        """
        match node:
            case Quantity():
                return constant(Fraction(node.value, COHERENT[node.dimension]))
            case Reference():
                found = place.scope.find(node.name)
                assert found is not None
                type = place.scope.type_of(found)
                dimension = Dimension.COUNT if type is None or type.dimension is None else type.dimension
                argument = isinstance(found, Argument)
                at = place.cells[node.name] if argument else self.slots.of(node.name)
                return LinearForm({FormVariable(argument, at): Fraction(1, COHERENT[dimension])}, Fraction(0))
            case Function(name="abs"):
                form = self._form(node.operands[0], place)
                return extremum(True, (form, scaled(form, Fraction(-1))))
            case Function():
                return extremum(node.name == "max", [self._form(operand, place) for operand in node.operands])
            case Arithmetic():
                return _arithmetic(node.operator, self._form(node.left, place), self._form(node.right, place))
            case _:
                raise AssertionError(node.kind)

    def _parts(self, code: CodeWriter, node: Node, form: Form, op: Op) -> None:
        """Lower `form op 0`."""
        if isinstance(form, LinearForm):
            left, right = LinearForm(form.terms, Fraction(0)), LinearForm({}, -form.constant)
            self._emit(code, node, left, op, right)
        elif op in (Op.EQ, Op.NE):
            both = op == Op.EQ
            self._parts(code, node, form, Op.LE if both else Op.LT)
            self._parts(code, node, form, Op.GE if both else Op.GT)
            code.add(Op.AND if both else Op.OR)
        else:
            connect = Op.AND if form.most == (op in (Op.LT, Op.LE)) else Op.OR
            for number, each in enumerate(form.among):
                self._parts(code, node, each, op)
                if number:
                    code.add(connect)

    def _emit(self, code: CodeWriter, node: Node, left: LinearForm, op: Op, right: LinearForm) -> None:
        """Lower `left op right`, multiplied by the positive number that makes all factors the least integers."""
        numbers = [*left.terms.values(), left.constant, *right.terms.values(), right.constant]
        whole = lcm(*(number.denominator for number in numbers))
        common = gcd(*(int(number * whole) for number in numbers)) or 1
        factor = Fraction(whole, common)
        factors, constants = 0, 0
        for side in (left, right):
            terms = {variable: int(each * factor) for variable, each in side.terms.items()}
            constant = int(side.constant * factor)
            _push(code, terms, constant)
            factors += sum(map(abs, terms.values()))
            constants = max(constants, abs(constant))
        code.add(op)
        if constants > MAX_VALUE or factors * MAX_VALUE + 2 * constants > MAX_MAGNITUDE:
            most = MAX_MAGNITUDE // MAX_VALUE
            report = self._context.report
            report.add(
                codes.NUMBER_SIZE,
                node.span,
                f"`{report.text(node.span)}` may exceed the range of numbers on board",
                help=f"as integers, its factors add up to {factors:,}, but at most {most} fit; use rounder factors"
                if factors > most
                else "compare smaller numbers",
            )


def _compare_time(code: CodeWriter, comparison: str, time: int) -> None:
    """Lower a comparison of the local time with a time of day."""
    start, end = {">=": (time, DAY), ">": (time + 1, DAY), "<=": (0, time), "<": (0, time - 1)}[comparison]
    if end >= 0:
        code.add(Op.TIME_IN, start, end)
    else:  # before 00:00 is never true
        code.add(Op.TIME_IN, 0, DAY)
        code.add(Op.NOT)


def _arithmetic(operation: str, left: Form, right: Form) -> Form:
    match operation:
        case "+":
            return plus(left, right)
        case "-":
            return plus(left, scaled(right, Fraction(-1)))
        case "*":
            factor, other = (left, right) if isinstance(left, LinearForm) and not left.terms else (right, left)
            assert isinstance(factor, LinearForm)
            return scaled(other, factor.constant)
        case _:
            assert isinstance(right, LinearForm)
            return scaled(left, 1 / right.constant)


def _push(code: CodeWriter, terms: Mapping[FormVariable, int], constant: int) -> None:
    """Push the sum of terms and a constant."""
    first = True
    for variable, factor in terms.items():
        code.add(Op.ARGUMENT if variable.argument else Op.SIGNAL, variable.at)
        if factor != 1:
            code.add(Op.SCALE, factor)
        if not first:
            code.add(Op.ADD)
        first = False
    if constant or first:
        code.add(Op.CONST, constant)
        if not first:
            code.add(Op.ADD)
