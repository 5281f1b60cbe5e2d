"""Numbers and their comparisons to postfix code, in integers that stay within 64 bits."""

from collections.abc import Mapping

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.compiler.emit import Code
from rtshcua.ground.compiler.slots import Slots
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import MAX_MAGNITUDE, MAX_VALUE
from rtshcua.model.ir.expression import Arithmetic, Comparison, Quantity, Reference, Value, Within

_COMPARE: Mapping[str, Op] = {"<": Op.LT, "<=": Op.LE, ">": Op.GT, ">=": Op.GE, "==": Op.EQ, "!=": Op.NE}
_ARITHMETIC: Mapping[str, Op] = {"+": Op.ADD, "-": Op.SUB}


class Numbers:
    """Lowers numbers in one scope."""

    def __init__(self, report: Report, slots: Slots, scope: Scope, cells: Mapping[str, int]) -> None:
        self._report = report
        self._slots = slots
        self._scope = scope
        self._cells = cells

    def compare(self, code: Code, node: Comparison) -> None:
        """`left operator right`."""
        size = self._value(code, node.left) + self._value(code, node.right)
        self._fits(node.left, size)
        code.add(_COMPARE[node.operator])

    def between(self, code: Code, node: Within) -> None:
        """`subject in low .. high`, both ends included."""
        for end, op, connect in ((node.range.low, Op.GE, False), (node.range.high, Op.LE, True)):
            size = self._value(code, node.subject) + self._value(code, end)
            self._fits(node.subject, size)
            code.add(op)
            if connect:
                code.add(Op.AND)

    def _value(self, code: Code, node: Value) -> int:
        """Push a number; returns what it can never exceed in magnitude."""
        constant = _constant(node)
        if constant is not None:
            if abs(constant) > MAX_VALUE:
                self._too_large(node)
            code.add(Op.CONST, constant)
            return abs(constant)
        match node:
            case Reference():
                if isinstance(self._scope.find(node.name), Argument):
                    code.add(Op.ARGUMENT, self._cells[node.name])
                else:
                    code.add(Op.SIGNAL, self._slots.of(node.name))
                return MAX_VALUE
            case Arithmetic(operator="*"):
                return self._scale(code, node)
            case Arithmetic():
                size = self._value(code, node.left) + self._value(code, node.right)
                code.add(_ARITHMETIC[node.operator])
                return self._fits(node, size)
            case _:
                raise AssertionError(node.kind)

    def _scale(self, code: Code, node: Arithmetic) -> int:
        left, right = _constant(node.left), _constant(node.right)
        factor, operand = (left, node.right) if left is not None else (right, node.left)
        assert factor is not None
        size = self._value(code, operand) * abs(factor)
        if abs(factor) > MAX_VALUE:
            self._too_large(node)
        code.add(Op.SCALE, factor)
        return self._fits(node, size)

    def _fits(self, node: Value, size: int) -> int:
        if size > MAX_MAGNITUDE:
            self._too_large(node)
            return 0
        return size

    def _too_large(self, node: Value) -> None:
        self._report.add(
            codes.NUMBER_SIZE,
            node.span,
            f"`{self._report.text(node.span)}` may be larger than what is computed with on board",
            help="compare smaller multiples",
        )


def _constant(node: Value) -> int | None:
    """The number that literals make, or None."""
    if isinstance(node, Quantity):
        return node.value
    if isinstance(node, Arithmetic):
        left, right = _constant(node.left), _constant(node.right)
        if left is not None and right is not None:
            return left + right if node.operator == "+" else left - right if node.operator == "-" else left * right
    return None
