"""Comparisons of numbers to postfix code, in integers that stay within 64 bits.

`max(a, b) <= c` is `a <= c and b <= c`, `max(a, b) >= c` is `a >= c or b >= c`, and `min` the other way round, so that
one part which is known may decide alone. `==` is `<=` and `>=` there, `!=` is `<` or `>`.
"""

from collections.abc import Mapping
from fractions import Fraction
from math import gcd, lcm

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.scope import Scope
from rtshcua.ground.lower.emit import Code
from rtshcua.ground.lower.forms import Choice, Form, Linear, TooManyForms, Variable, plus, scaled
from rtshcua.ground.lower.linear import Forms
from rtshcua.ground.lower.slots import Slots
from rtshcua.model.flat.code import MAX_INSTRUCTIONS, Op
from rtshcua.model.flat.limits import MAX_MAGNITUDE, MAX_VALUE
from rtshcua.model.ir.expression import Comparison, Value, Within
from rtshcua.model.ir.node import Node

_COMPARE: Mapping[str, Op] = {"<": Op.LT, "<=": Op.LE, ">": Op.GT, ">=": Op.GE, "==": Op.EQ, "!=": Op.NE}
_ZERO = Linear({}, Fraction(0))


class Numbers:
    """Lowers comparisons in one scope."""

    def __init__(self, report: Report, slots: Slots, scope: Scope, cells: Mapping[str, int]) -> None:
        self._report = report
        self._forms = Forms(slots, scope, cells)

    def compare(self, code: Code, node: Comparison) -> None:
        """`left operator right`."""
        self._compare(code, node, node.left, _COMPARE[node.operator], node.right)

    def between(self, code: Code, node: Within) -> None:
        """`subject in low .. high`, both ends included."""
        self._compare(code, node, node.subject, Op.GE, node.range.low)
        self._compare(code, node, node.subject, Op.LE, node.range.high)
        code.add(Op.AND)

    def _compare(self, code: Code, node: Node, left: Value, op: Op, right: Value) -> None:
        try:
            low, high = self._forms.of(left), self._forms.of(right)
            if isinstance(low, Linear) and isinstance(high, Linear):
                self._emit(code, node, low, op, high)
            else:
                self._parts(code, node, plus(low, scaled(high, Fraction(-1))), op)
        except TooManyForms:
            self._report.add(
                codes.CONDITION_SIZE,
                node.span,
                f"`{self._report.text(node.span)}` compares more than {MAX_INSTRUCTIONS} sums with each other",
                help="a sum of `min` and `max` means each choice with each other: compare them apart",
            )
            self._emit(code, node, _ZERO, op, _ZERO)

    def _parts(self, code: Code, node: Node, form: Form, op: Op) -> None:
        """`form op 0`."""
        if isinstance(form, Linear):
            left, right = Linear(form.terms, Fraction(0)), Linear({}, -form.constant)
            self._emit(code, node, left, op, right)
        elif op in (Op.EQ, Op.NE):
            both = op == Op.EQ
            self._parts(code, node, form, Op.LE if both else Op.LT)
            self._parts(code, node, form, Op.GE if both else Op.GT)
            code.add(Op.AND if both else Op.OR)
        else:
            self._chosen(code, node, form, op)

    def _chosen(self, code: Code, node: Node, form: Choice, op: Op) -> None:
        connect = Op.AND if form.most == (op in (Op.LT, Op.LE)) else Op.OR
        for number, each in enumerate(form.among):
            self._parts(code, node, each, op)
            if number:
                code.add(connect)

    def _emit(self, code: Code, node: Node, left: Linear, op: Op, right: Linear) -> None:
        """`left op right`, multiplied by the positive number that makes all factors whole and as small as can be."""
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
            self._too_large(node, factors)

    def _too_large(self, node: Node, factors: int) -> None:
        most = MAX_MAGNITUDE // MAX_VALUE
        self._report.add(
            codes.NUMBER_SIZE,
            node.span,
            f"`{self._report.text(node.span)}` may need a number that is larger than what is computed with on board",
            help=f"made whole together, its factors add up to {factors:,}, and at most {most} fit: use rounder ones"
            if factors > most
            else "compare smaller numbers",
        )


def _push(code: Code, terms: Mapping[Variable, int], constant: int) -> None:
    """The sum of some terms and a constant."""
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
