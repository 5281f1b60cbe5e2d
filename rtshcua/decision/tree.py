"""Parses postfix code into a tree, checks its types, and finds the slots that it reads. The bundle's code is
untrusted.

Every number is a sum of state slots and argument cells times constants, plus a constant, so each comparison
becomes `sum <= bound` or `sum == bound`. A slot with factor 0 stays in the sum, because the comparison is unknown
without it.
"""

from collections.abc import Iterable
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple, TypeAlias

from rtshcua.model.flat.code import MAX_INSTRUCTIONS, MAX_STACK, Clause, Op
from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Contract
from rtshcua.model.flat.limits import DAY, MAX_MAGNITUDE, MAX_VALUE, WEEK
from rtshcua.model.flat.policy import Monitor, Policy, VehicleLimits
from rtshcua.model.flat.signal import ENUMERATION, POSITION


class CodeScope(NamedTuple):
    """The slots, cells, zones, tables, sets and monitors that code may name, with their kinds.

    Each method returns what is wrong with an index, or None.

    `kinds` is the signal kind of each slot. `cells` has, for each skill that the code may apply to, the parameter
    kind at each first cell: an argument must exist, with the same kind, in all of these skills, and in at least
    one. `members` are the policy's sets. `phases` counts its phase names, None where code may not read the phase.
    """

    kinds: tuple[int, ...]
    zones: int
    tables: int
    members: tuple[tuple[int, ...], ...]
    cells: tuple[dict[int, int], ...]
    monitors: int
    phases: int | None

    def entry(self, what: str, index: int, count: int) -> str | None:
        """Check an index into zones, tables and the like."""
        return None if 0 <= index < count else f"there is no {what} {index}"

    def number(self, slot: int) -> str | None:
        """Check that a slot holds a number (such as an enumeration's ordinal)."""
        if not 0 <= slot < len(self.kinds):
            return f"there is no slot {slot}"
        return f"slot {slot} is a position, not a number" if self.kinds[slot] == POSITION else None

    def enumeration(self, slot: int) -> str | None:
        """A slot that holds an enumeration."""
        found = 0 <= slot < len(self.kinds) and self.kinds[slot] == ENUMERATION
        return None if found else f"slot {slot} is not an enumeration"

    def argument(self, cell: int, kinds: tuple[int, ...], name: str) -> str | None:
        """The first cell of a parameter of one of these kinds, in every skill."""
        if not self.cells:
            return "an argument is named outside of a skill"
        found = all(kinds_of.get(cell) in kinds for kinds_of in self.cells)
        return None if found else f"argument cell {cell} is not a {name}"

    def set_of_phases(self, index: int) -> str | None:
        """A membership set of phase names."""
        phases = self.phases
        if phases is None:
            return "the phase is not available here"
        if not 0 <= index < len(self.members):
            return f"there is no set {index}"
        return (
            None
            if all(0 <= member < phases for member in self.members[index])
            else f"set {index} is not a set of phases"
        )

    def week(self, index: int) -> str | None:
        """A set that is windows of a week."""
        return self.entry("set", index, len(self.members)) or windows_problem(self.members[index])

    def about(self, *contracts: Contract) -> "CodeScope":
        """The scope of code that may name the arguments of these contracts' skills."""
        return self._replace(cells=tuple({each.cell: each.kind for each in one.parameters} for one in contracts))

    def inside_monitor(self, number: int) -> "CodeScope":
        """The scope of a temporal monitor's code: it may read earlier monitors, but no argument and no phase."""
        return self._replace(cells=(), monitors=number, phases=None)


def scope_of(policy: Policy) -> CodeScope:
    """The scope of all code in a policy whose signals are `policy.signals`."""
    kinds = [0] * policy.slots
    for signal in policy.signals:
        for slot in signal.slots:
            kinds[slot] = signal.kind
    monitors, phases = len(policy.monitors), len(policy.phases)
    return CodeScope(tuple(kinds), len(policy.zones), len(policy.tables), policy.sets, (), monitors, phases)


class LinearTerm(NamedTuple):
    """`factor` times an argument cell or a state slot."""

    argument: bool
    at: int
    factor: int


class AtMost(NamedTuple):
    """The sum of the terms is at most `bound`."""

    terms: tuple[LinearTerm, ...]
    bound: int


class Equal(NamedTuple):
    """The sum of the terms is `value`."""

    terms: tuple[LinearTerm, ...]
    value: int


class Member(NamedTuple):
    """An argument cell or a state slot is in set `members` of the policy."""

    argument: bool
    at: int
    members: int


class SlotKnown(NamedTuple):
    """State slot `at` has a value; unknown while it has none."""

    at: int


class InsideZone(NamedTuple):
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


class InWeek(NamedTuple):
    """The local time of the week is in one of some windows, as `Zone.weekly` has them."""

    windows: tuple[int, ...]


class PhaseIn(NamedTuple):
    """The invocation's mission phase is in set `members` of the policy."""

    members: int


class MonitorSays(NamedTuple):
    """The truth of temporal monitor `monitor`."""

    monitor: int


class Both(NamedTuple):
    """Kleene's `and`."""

    left: "Node"
    right: "Node"


class Either(NamedTuple):
    """Kleene's `or`."""

    left: "Node"
    right: "Node"


class Negation(NamedTuple):
    """Kleene's `not`."""

    operand: "Node"


Atom: TypeAlias = (
    AtMost
    | Equal
    | Member
    | SlotKnown
    | InsideZone
    | InsideArgument
    | PointInside
    | InWindow
    | InWeek
    | PhaseIn
    | MonitorSays
)
Node: TypeAlias = Atom | Both | Either | Negation


class _Sum(NamedTuple):
    """A number on the stack."""

    terms: tuple[LinearTerm, ...]
    constant: int

    def scaled(self, factor: int) -> "_Sum":
        return _Sum(tuple(term._replace(factor=term.factor * factor) for term in self.terms), self.constant * factor)

    def plus(self, other: "_Sum") -> "_Sum":
        factors = {(term.argument, term.at): term.factor for term in self.terms}
        for argument, at, factor in other.terms:
            factors[argument, at] = factors.get((argument, at), 0) + factor
        terms = tuple(LinearTerm(argument, at, factor) for (argument, at), factor in factors.items())
        return _Sum(terms, self.constant + other.constant)

    def magnitude(self) -> int:
        """The greatest magnitude that the number can have."""
        return abs(self.constant) + sum(abs(term.factor) for term in self.terms) * MAX_VALUE


def parse(code: tuple[int, ...], scope: CodeScope) -> Node | str:
    """The condition in `code`, or what is wrong with it."""
    if not code or len(code) % 3 or len(code) > 3 * MAX_INSTRUCTIONS:
        return f"{len(code)} integers; expected 3 for each of 1 to {MAX_INSTRUCTIONS} instructions"
    stack: list[_Sum | Node] = []
    for at in range(0, len(code), 3):
        problem = _step(stack, code[at], code[at + 1], code[at + 2], scope)
        if problem is None and len(stack) > MAX_STACK:
            problem = f"more than {MAX_STACK} values on the stack"
        if problem is not None:
            return f"instruction {at // 3}: {problem}"
    last = stack.pop()
    if stack or isinstance(last, _Sum):
        return "the code does not leave exactly one truth value on the stack"
    return last


def _step(stack: list[_Sum | Node], op: int, a: int, b: int, scope: CodeScope) -> str | None:
    """Execute one instruction on the stack. Return what is wrong with it, or None."""
    match op:
        case Op.CONST | Op.SIGNAL | Op.ARGUMENT:
            return _push_number(stack, op, a, b, scope)
        case Op.ADD | Op.SUB | Op.SCALE:
            return _arithmetic(stack, op, a, b)
        case Op.LT | Op.LE | Op.GT | Op.GE | Op.EQ | Op.NE:
            return _compare(stack, op, a, b)
        case Op.AND | Op.OR | Op.NOT:
            return _connect(stack, op, a, b)
    return _push_atom(stack, op, a, b, scope)


def _push_number(stack: list[_Sum | Node], op: int, a: int, b: int, scope: CodeScope) -> str | None:
    if op == Op.CONST:
        problem = None if -MAX_VALUE <= a <= MAX_VALUE else f"constant {a} is out of range"
        number = _Sum((), a)
    else:
        problem = scope.number(a) if op == Op.SIGNAL else scope.argument(a, (QUANTITY, CHOICE), "number")
        number = _Sum((LinearTerm(op == Op.ARGUMENT, a, 1),), 0)
    stack.append(number)
    return problem or _unused(b)


def _numbers(stack: list[_Sum | Node], count: int) -> list[_Sum]:
    """Pop the last `count` values if they are numbers; else return an empty list."""
    found = [each for each in stack[-count:] if isinstance(each, _Sum)]
    if len(found) < count:
        return []
    del stack[-count:]
    return found


def _truths(stack: list[_Sum | Node], count: int) -> list[Node]:
    """Pop the last `count` values if they are truth values; else return an empty list."""
    found = [each for each in stack[-count:] if not isinstance(each, _Sum)]
    if len(found) < count:
        return []
    del stack[-count:]
    return found


def _arithmetic(stack: list[_Sum | Node], op: int, a: int, b: int) -> str | None:
    if op == Op.SCALE:
        operands = _numbers(stack, 1)
        if not operands:
            return "the instruction needs one number on the stack"
        if not -MAX_VALUE <= a <= MAX_VALUE:
            return f"factor {a} is out of range"
        result, problem = operands[0].scaled(a), _unused(b)
    else:
        operands = _numbers(stack, 2)
        if not operands:
            return "the instruction needs two numbers on the stack"
        result, problem = operands[0].plus(operands[1].scaled(1 if op == Op.ADD else -1)), _unused(a, b)
    stack.append(result)
    return problem or (None if result.magnitude() <= MAX_MAGNITUDE else "the number may exceed 64 bits")


def _compare(stack: list[_Sum | Node], op: int, a: int, b: int) -> str | None:
    operands = _numbers(stack, 2)
    if not operands:
        return "the instruction needs two numbers on the stack"
    left, right = reversed(operands) if op in (Op.GT, Op.GE) else operands  # l > r is r < l
    sum_ = left.plus(right.scaled(-1))  # l < r is l - r <= -1, for integers
    if sum_.magnitude() > MAX_MAGNITUDE:
        return "the number may exceed 64 bits"
    if op in (Op.EQ, Op.NE):
        equal = Equal(sum_.terms, -sum_.constant)
        stack.append(equal if op == Op.EQ else Negation(equal))
    else:
        stack.append(AtMost(sum_.terms, -sum_.constant - (op in (Op.LT, Op.GT))))
    return _unused(a, b)


def _connect(stack: list[_Sum | Node], op: int, a: int, b: int) -> str | None:
    operands = _truths(stack, 1 if op == Op.NOT else 2)
    if not operands:
        return f"the instruction needs {'one truth value' if op == Op.NOT else 'two truth values'} on the stack"
    stack.append(Negation(*operands) if op == Op.NOT else Both(*operands) if op == Op.AND else Either(*operands))
    return _unused(a, b)


def _push_atom(stack: list[_Sum | Node], op: int, a: int, b: int, scope: CodeScope) -> str | None:
    problem: str | None
    node: Node
    match op:
        case Op.SIGNAL_IN:
            problem, node = scope.enumeration(a) or scope.entry("set", b, len(scope.members)), Member(False, a, b)
        case Op.ARGUMENT_IN:
            problem = scope.argument(a, (CHOICE, ZONE), "choice and no zone")
            problem, node = problem or scope.entry("set", b, len(scope.members)), Member(True, a, b)
        case Op.KNOWN:
            problem, node = scope.entry("slot", a, len(scope.kinds)) or _unused(b), SlotKnown(a)
        case Op.POSITION_IN:
            problem, node = scope.entry("zone", a, scope.zones) or _unused(b), InsideZone(a)
        case Op.POSITION_IN_ARGUMENT:
            problem = scope.argument(a, (ZONE,), "zone") or scope.entry("table", b, scope.tables)
            node = InsideArgument(a, b)
        case Op.ARGUMENT_POINT_IN:
            problem = scope.argument(a, (PLACE,), "place") or scope.entry("zone", b, scope.zones)
            node = PointInside(a, b)
        case Op.TIME_IN:
            within = 0 <= a < DAY and 0 <= b <= DAY
            problem, node = None if within else f"{a}..{b} us is not a time of day", InWindow(a, b)
        case Op.WEEK_IN:
            problem = scope.week(a) or _unused(b)
            node = InWeek(() if problem else scope.members[a])
        case Op.PHASE_IN:
            problem, node = scope.set_of_phases(b) or _unused(a), PhaseIn(b)
        case Op.MONITOR:
            known = None if 0 <= a < scope.monitors else f"there is no monitor {a} here"
            problem, node = known or _unused(b), MonitorSays(a)
        case _:
            return f"unknown instruction {op}"
    stack.append(node)
    return problem


def windows_problem(windows: tuple[int, ...]) -> str | None:
    """What is wrong with windows of a week, or None. They must lie within the week, one after the other."""
    good = windows and len(windows) % 2 == 0 and windows[0] >= 0 and windows[-1] <= WEEK
    good = good and all(one < other for one, other in pairwise(windows))
    return None if good else "the windows of the week are out of order or out of range"


def _unused(*operands: int) -> str | None:
    return "an unused operand is not 0" if any(operands) else None


def slots_read(
    clauses: Iterable[Clause], vehicle: VehicleLimits, monitors: tuple[Monitor, ...] = ()
) -> tuple[int, ...]:
    """The slots that well-formed clauses read, directly or through the policy's temporal monitors, ascending. A test
    of the vehicle's place reads its position and height.
    """
    slots: set[int] = set()
    left, seen = list(clauses), set[int]()
    while left:
        read = _read(left.pop().code)
        slots |= read.slots
        if read.where:
            slots.update(where(vehicle))
        left += [monitors[number].when for number in read.monitors - seen]
        seen |= read.monitors
    return tuple(sorted(slots))


class _Read(NamedTuple):
    """The slots and monitors that code reads, and whether it reads the vehicle's place."""

    slots: frozenset[int]
    monitors: frozenset[int]
    where: bool


@lru_cache(maxsize=1024)  # cached, because checks and preparation read the same code for each step
def _read(code: tuple[int, ...]) -> _Read:
    named = list(zip(code[::3], code[1::3], strict=False))
    return _Read(
        frozenset(at for op, at in named if op in (Op.SIGNAL, Op.SIGNAL_IN, Op.KNOWN)),
        frozenset(at for op, at in named if op == Op.MONITOR),
        any(op in (Op.POSITION_IN, Op.POSITION_IN_ARGUMENT) for op, _ in named),
    )


def monitored(clauses: Iterable[Clause]) -> bool:
    """Whether well-formed clauses read a temporal monitor."""
    return any(Op.MONITOR in clause.code[::3] for clause in clauses)


def where(vehicle: VehicleLimits) -> tuple[int, ...]:
    """The slots of the vehicle's position and height, as far as it has them."""
    position = () if vehicle.position == -1 else (vehicle.position, vehicle.position + 1)
    return position if vehicle.height == -1 else (*position, vehicle.height)
