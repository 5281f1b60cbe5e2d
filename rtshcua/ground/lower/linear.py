"""Values of the source to forms, in units that need no factor when they are multiplied (m, m/s, s, the whole)."""

from collections.abc import Mapping
from fractions import Fraction

from rtshcua.ground.checker.dimensions import COHERENT
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.lower.forms import Form, Linear, Variable, absolute, choice, constant, plus, scaled
from rtshcua.ground.lower.slots import Slots
from rtshcua.model.ir.expression import Arithmetic, Function, Quantity, Reference, Value
from rtshcua.model.quantity import Dimension


class Forms:
    """Reads values that were found well typed in one scope; a signal that is read for the first time gets a slot."""

    def __init__(self, slots: Slots, scope: Scope, cells: Mapping[str, int]) -> None:
        self._slots = slots
        self._scope = scope
        self._cells = cells

    def of(self, node: Value) -> Form:
        """The form of a number. Raises `TooManyForms`."""
        match node:
            case Quantity():
                return constant(Fraction(node.value, COHERENT[node.dimension]))
            case Reference():
                return self._reference(node)
            case Function(name="abs"):
                return absolute(self.of(node.operands[0]))
            case Function():
                return choice(node.name == "max", [self.of(operand) for operand in node.operands])
            case Arithmetic():
                return self._arithmetic(node)
            case _:
                raise AssertionError(node.kind)

    def _reference(self, node: Reference) -> Linear:
        found = self._scope.find(node.name)
        assert found is not None
        type = self._scope.type_of(found)
        dimension = Dimension.COUNT if type is None or type.dimension is None else type.dimension
        argument = isinstance(found, Argument)
        at = self._cells[node.name] if argument else self._slots.of(node.name)
        return Linear({Variable(argument, at): Fraction(1, COHERENT[dimension])}, Fraction(0))

    def _arithmetic(self, node: Arithmetic) -> Form:
        left, right = self.of(node.left), self.of(node.right)
        match node.operator:
            case "+":
                return plus(left, right)
            case "-":
                return plus(left, scaled(right, Fraction(-1)))
            case "*":
                factor, other = (left, right) if _is_constant(left) else (right, left)
                assert isinstance(factor, Linear)
                return scaled(other, factor.constant)
            case "/":
                assert isinstance(right, Linear)
                return scaled(left, 1 / right.constant)


def _is_constant(form: Form) -> bool:
    return isinstance(form, Linear) and not form.terms
