"""Postfix code, read into a tree and type-checked on the way. The bundle's code is never trusted to be well-formed.

Every number is a sum of state slots and argument cells times constants, plus a constant, so each comparison becomes
`sum <= bound` or `sum == bound`. A slot whose factor is 0 stays in the sum: the comparison is still unknown without it.
"""

from typing import NamedTuple, TypeAlias

from rtshcua.decision.scope import Scope
from rtshcua.model.flat.code import MAX_INSTRUCTIONS, MAX_STACK, Op
from rtshcua.model.flat.limits import DAY, MAX_MAGNITUDE, MAX_VALUE


class Term(NamedTuple):
    """`factor` times an argument cell or a state slot."""

    argument: bool
    at: int
    factor: int


class AtMost(NamedTuple):
    """The sum of the terms is at most `bound`."""

    terms: tuple[Term, ...]
    bound: int


class Equal(NamedTuple):
    """The sum of the terms is `value`."""

    terms: tuple[Term, ...]
    value: int


class Member(NamedTuple):
    """An argument cell or a state slot is in set `members` of the policy."""

    argument: bool
    at: int
    members: int


class Known(NamedTuple):
    """State slot `at` has a value; unknown while it has none."""

    at: int


class Inside(NamedTuple):
    """The vehicle is inside zone `zone`."""

    zone: int


class InsideArgument(NamedTuple):
    """The vehicle is inside the zone that table `table` gives for the zone in argument cell `cell`."""

    cell: int
    table: int


class PointInside(NamedTuple):
    """The place in argument cells `cell`, `cell + 1` is inside zone `zone`, whatever the height."""

    cell: int
    zone: int


class InWindow(NamedTuple):
    """The local time of day is in `start`..`end`, us since midnight."""

    start: int
    end: int


class InPhase(NamedTuple):
    """The invocation's mission phase is in set `members` of the policy."""

    members: int


class Monitored(NamedTuple):
    """What temporal monitor `monitor` says."""

    monitor: int


class Both(NamedTuple):
    """Kleene's `and`."""

    left: "Node"
    right: "Node"


class Either(NamedTuple):
    """Kleene's `or`."""

    left: "Node"
    right: "Node"


class Not(NamedTuple):
    """Kleene's `not`."""

    operand: "Node"


Atom: TypeAlias = (
    AtMost | Equal | Member | Known | Inside | InsideArgument | PointInside | InWindow | InPhase | Monitored
)
Node: TypeAlias = Atom | Both | Either | Not


class _Sum(NamedTuple):
    """A number on the stack."""

    terms: tuple[Term, ...]
    constant: int

    def scaled(self, factor: int) -> "_Sum":
        return _Sum(tuple(term._replace(factor=term.factor * factor) for term in self.terms), self.constant * factor)

    def plus(self, other: "_Sum") -> "_Sum":
        factors = {(term.argument, term.at): term.factor for term in self.terms}
        for argument, at, factor in other.terms:
            factors[argument, at] = factors.get((argument, at), 0) + factor
        terms = tuple(Term(argument, at, factor) for (argument, at), factor in factors.items())
        return _Sum(terms, self.constant + other.constant)

    def magnitude(self) -> int:
        """What no value can exceed."""
        return abs(self.constant) + sum(abs(term.factor) for term in self.terms) * MAX_VALUE


def parse(code: tuple[int, ...], scope: Scope) -> Node | str:
    """The condition that `code` spells, or what is wrong with it."""
    if not code or len(code) % 3 or len(code) > 3 * MAX_INSTRUCTIONS:
        return f"{len(code)} integers are not 1 to {MAX_INSTRUCTIONS} instructions"
    stack: list[_Sum | Node] = []
    for at in range(0, len(code), 3):
        problem = _step(stack, code[at], code[at + 1], code[at + 2], scope)
        if problem is None and len(stack) > MAX_STACK:
            problem = f"more than {MAX_STACK} values on the stack"
        if problem is not None:
            return f"instruction {at // 3}: {problem}"
    last = stack.pop()
    if stack or isinstance(last, _Sum):
        return "the code does not leave exactly one truth value"
    return last


def _step(stack: list[_Sum | Node], op: int, a: int, b: int, scope: Scope) -> str | None:
    """Do one instruction on the stack; what is wrong with it, or None."""
    if op in _PUSH_NUMBER:
        return _push_number(stack, op, a, b, scope)
    if op in _ARITHMETIC:
        return _arithmetic(stack, op, a, b)
    if op in _COMPARE:
        return _compare(stack, op, a, b)
    if op in _CONNECT:
        return _connect(stack, op, a, b)
    return _push_atom(stack, op, a, b, scope)


_PUSH_NUMBER = frozenset({Op.CONST, Op.SIGNAL, Op.ARGUMENT})
_ARITHMETIC = frozenset({Op.ADD, Op.SUB, Op.SCALE})
_COMPARE = frozenset({Op.LT, Op.LE, Op.GT, Op.GE, Op.EQ, Op.NE})
_CONNECT = frozenset({Op.AND, Op.OR, Op.NOT})


def _push_number(stack: list[_Sum | Node], op: int, a: int, b: int, scope: Scope) -> str | None:
    if op == Op.CONST:
        problem = None if -MAX_VALUE <= a <= MAX_VALUE else f"constant {a} is out of range"
        number = _Sum((), a)
    else:
        problem = scope.number(a) if op == Op.SIGNAL else scope.quantity(a)
        number = _Sum((Term(op == Op.ARGUMENT, a, 1),), 0)
    stack.append(number)
    return problem or _unused(b)


def _arithmetic(stack: list[_Sum | Node], op: int, a: int, b: int) -> str | None:
    if op == Op.SCALE:
        operand = stack.pop() if stack else None
        if not isinstance(operand, _Sum):
            return "one number is needed on the stack"
        if not -MAX_VALUE <= a <= MAX_VALUE:
            return f"factor {a} is out of range"
        result, problem = operand.scaled(a), _unused(b)
    else:
        right, left = (stack.pop(), stack.pop()) if len(stack) > 1 else (None, None)
        if not isinstance(left, _Sum) or not isinstance(right, _Sum):
            return "two numbers are needed on the stack"
        result, problem = left.plus(right.scaled(1 if op == Op.ADD else -1)), _unused(a, b)
    stack.append(result)
    return problem or (None if result.magnitude() <= MAX_MAGNITUDE else "the number may exceed 64 bits")


def _compare(stack: list[_Sum | Node], op: int, a: int, b: int) -> str | None:
    right, left = (stack.pop(), stack.pop()) if len(stack) > 1 else (None, None)
    if not isinstance(left, _Sum) or not isinstance(right, _Sum):
        return "two numbers are needed on the stack"
    if op in (Op.GT, Op.GE):  # l > r is r < l
        left, right = right, left
    sum_ = left.plus(right.scaled(-1))  # l < r is l - r <= -1, for integers
    if sum_.magnitude() > MAX_MAGNITUDE:
        return "the number may exceed 64 bits"
    if op in (Op.EQ, Op.NE):
        equal = Equal(sum_.terms, -sum_.constant)
        stack.append(equal if op == Op.EQ else Not(equal))
    else:
        stack.append(AtMost(sum_.terms, -sum_.constant - (op in (Op.LT, Op.GT))))
    return _unused(a, b)


def _connect(stack: list[_Sum | Node], op: int, a: int, b: int) -> str | None:
    if op == Op.NOT:
        operand = stack.pop() if stack else None
        if operand is None or isinstance(operand, _Sum):
            return "one truth value is needed on the stack"
        stack.append(Not(operand))
        return _unused(a, b)
    right, left = (stack.pop(), stack.pop()) if len(stack) > 1 else (None, None)
    if left is None or right is None or isinstance(left, _Sum) or isinstance(right, _Sum):
        return "two truth values are needed on the stack"
    stack.append(Both(left, right) if op == Op.AND else Either(left, right))
    return _unused(a, b)


def _push_atom(stack: list[_Sum | Node], op: int, a: int, b: int, scope: Scope) -> str | None:
    problem: str | None
    node: Node
    match op:
        case Op.SIGNAL_IN:
            problem, node = scope.enumeration(a) or scope.set_of_members(b), Member(False, a, b)
        case Op.ARGUMENT_IN:
            problem, node = scope.choice_or_zone(a) or scope.set_of_members(b), Member(True, a, b)
        case Op.KNOWN:
            problem, node = scope.slot(a) or _unused(b), Known(a)
        case Op.POSITION_IN:
            problem, node = scope.zone(a) or _unused(b), Inside(a)
        case Op.POSITION_IN_ARGUMENT:
            problem, node = scope.zone_argument(a) or scope.table(b), InsideArgument(a, b)
        case Op.ARGUMENT_POINT_IN:
            problem, node = scope.place(a) or scope.zone(b), PointInside(a, b)
        case Op.TIME_IN:
            within = 0 <= a < DAY and 0 <= b <= DAY
            problem, node = None if within else f"{a}..{b} us is not a time of day", InWindow(a, b)
        case Op.PHASE_IN:
            problem, node = scope.set_of_phases(b) or _unused(a), InPhase(b)
        case Op.MONITOR:
            problem, node = scope.monitor(a) or _unused(b), Monitored(a)
        case _:
            return f"no instruction has the number {op}"
    stack.append(node)
    return problem


def _unused(*operands: int) -> str | None:
    return "an unused operand is not 0" if any(operands) else None
