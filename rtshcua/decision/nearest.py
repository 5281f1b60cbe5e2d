"""Computes, after a refusal, the smallest change with which the request would have passed.

`ChangeSearch` finds the smallest change of values that makes a condition true or false. `offer` presents it to a
person or an agent, with names and units. `nearest` returns the changes that pass when tried.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.contracts import drains
from rtshcua.decision.evaluate import Environment, Tables, build, total
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, ranging, situation
from rtshcua.decision.times import local_time, time_of_week
from rtshcua.decision.tree import Node
from rtshcua.decision.values import FALSE, TRUE, Value, point
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import PLACE, QUANTITY, ZONE, Contract
from rtshcua.model.flat.limits import DAY, FULL, MAX_VALUE
from rtshcua.model.flat.policy import Policy, Rule
from rtshcua.model.flat.signal import ENUMERATION
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Reason


class NearestChange(NamedTuple):
    """A change of an argument cell, a state slot, or (None) the local time, to `low`..`high` or to one of `choices`."""

    argument: bool
    at: int | None
    low: int
    high: int
    choices: frozenset[int] | None

    @property
    def subject(self) -> "Subject":
        """The argument or slot that changes, or None for the local time."""
        return (self.argument, self.at)

    def allows(self, value: int) -> bool:
        """Whether the change allows a value."""
        return self.low <= value <= self.high if self.choices is None else value in self.choices


Subject: TypeAlias = tuple[bool, int | None]
#: the proposed value of each subject
Made: TypeAlias = dict[Subject, int]


class ChangeSearch:
    """Searches for changes to the values of an environment. None means that no change of a value helps, or that none
    is known.

    No present value changes the result of a temporal monitor, and an invocation stays in its phase. With
    `signals_only` the arguments stay fixed too, where a comparison has both.
    """

    def __init__(self, at: Environment, tables: Tables, *, signals_only: bool = False) -> None:
        self._at, self._tables, self._signals_only = at, tables, signals_only

    def find(self, node: tree.Node, goal: bool) -> tuple[NearestChange, ...] | None:
        """The fewest changes that, made together, give the condition the truth `goal`."""
        if build(node, self._tables)(self._at) == (TRUE if goal else FALSE):
            return ()
        match node:
            case tree.Negation(operand):
                return self.find(operand, not goal)
            case tree.Both(left, right):
                return self._all(left, right, goal) if goal else self._any(left, right, goal)
            case tree.Either(left, right):
                return self._any(left, right, goal) if goal else self._all(left, right, goal)
            case tree.AtMost(terms, bound):
                return self._within(terms, None, bound) if goal else self._within(terms, bound + 1, None)
            case tree.Equal(terms, value) if goal:
                return self._within(terms, value, value)
            case tree.Member(argument, at, members):
                chosen = self._tables.sets[members]
                return (NearestChange(argument, at, 0, 0, chosen),) if goal else None
            case tree.InWindow(start, end) if goal:
                return (NearestChange(False, None, start, min(end, DAY - 1), None),)
            case tree.InWeek(windows) if goal:
                return self._today(windows)
            case _:
                return None

    def help(self, node: tree.Node, goal: bool, made: Made) -> bool:
        """Whether the condition has the truth `goal` once the subjects have these values.

        A time of day means its next occurrence, because zones may exist on some days only. The clock is then
        exact.
        """
        here = self._at
        slots, arguments, utc, error = list(here.slots), list(here.arguments), here.utc, here.error
        for (argument, at), value in made.items():
            if at is None:
                moment = self._tables.local.next(value, utc[0][0])
                if moment is None:
                    return False
                utc, error = ((moment, moment),), (0, 0)
            else:
                (arguments if argument else slots)[at] = point(value)
        changed = Environment(slots, arguments, utc, error, here.place, here.monitors, here.phase, here.through)
        return build(node, self._tables)(changed) == (TRUE if goal else FALSE)

    def _today(self, windows: tuple[int, ...]) -> tuple[NearestChange, ...] | None:
        """The next window of this day of the local week, else the last; None if the day has none. Other days do not
        help.
        """
        moment = self._at.utc[0][0]
        day, now = divmod(time_of_week(moment + self._tables.local.offset(moment)), DAY)
        found = [
            (max(start - day * DAY, 0), min(end - day * DAY, DAY) - 1)
            for start, end in zip(windows[::2], windows[1::2], strict=True)
            if start < (day + 1) * DAY and end > day * DAY
        ]
        if not found:
            return None
        low, high = next((each for each in found if each[1] >= now), found[-1])
        return (NearestChange(False, None, low, high, None),)

    def _all(self, left: tree.Node, right: tree.Node, goal: bool) -> tuple[NearestChange, ...] | None:
        first, second = self.find(left, goal), self.find(right, goal)
        return None if first is None or second is None else _merged((*first, *second))

    def _any(self, left: tree.Node, right: tree.Node, goal: bool) -> tuple[NearestChange, ...] | None:
        found = [changes for changes in (self.find(left, goal), self.find(right, goal)) if changes is not None]
        return min(found, key=len, default=None)

    def _within(
        self, terms: tuple[tree.LinearTerm, ...], least: int | None, most: int | None
    ) -> tuple[NearestChange, ...] | None:
        """The change that brings the sum into `least`..`most` with all other terms fixed; an argument is preferred to
        a signal.
        """
        movable = sorted((term for term in terms if term.factor), key=lambda term: term.argument == self._signals_only)
        low, high, gap = total(tuple(term for term in terms if term not in movable[:1]), self._at)
        if gap or not movable:
            return None
        argument, at, factor = movable[0]
        ends = None if least is None else least - low, None if most is None else most - high
        if factor < 0:
            factor, ends = -factor, (None if ends[1] is None else -ends[1], None if ends[0] is None else -ends[0])
        first = -MAX_VALUE if ends[0] is None else -(-ends[0] // factor)
        last = MAX_VALUE if ends[1] is None else ends[1] // factor
        return None if None not in ends and first > last else (NearestChange(argument, at, first, last, None),)


def _merged(changes: Sequence[NearestChange]) -> tuple[NearestChange, ...] | None:
    """One change for each subject, or None when two contradict each other."""
    merged: dict[Subject, NearestChange] = {}
    for new in changes:
        old = merged.setdefault(new.subject, new)
        if old is not new:
            both = _both(old, new)
            if both is None:
                return None
            merged[new.subject] = both
    return tuple(merged.values())


def _both(a: NearestChange, b: NearestChange) -> NearestChange | None:
    if a.at is None or (a.choices is None) != (b.choices is None):
        return None
    if a.choices is not None and b.choices is not None:
        common = a.choices & b.choices
        return a._replace(choices=common) if common else None
    low, high = max(a.low, b.low), min(a.high, b.high)
    return a._replace(low=low, high=high) if low <= high else None


def nearest_in(change: NearestChange, value: Value) -> int:
    """The allowed value that is nearest to the present one; for a time of day, the nearer end of a window."""
    low, high = change.low, change.high
    present, _, gap, _ = value
    if change.at is None:
        return low if (low - present) % DAY <= (present - high) % DAY else high
    if gap:
        return low if high == MAX_VALUE else high
    return low if present < low else high


LOCAL_TIME = "local time"
DAYTIME = "daytime"

#: a value and its name; a quantity has no name
Option = tuple[int, str]


class Offer(NamedTuple):
    """The allowed values of a subject: the nearest quantity, or each ordinal or zone with its name."""

    change: NearestChange
    subject: str
    dimension: str
    options: tuple[Option, ...]


def offer(change: NearestChange, contract: Contract, policy: Policy, at: Environment) -> Offer:
    """The offer that corresponds to a change; without options where the subject has no such value."""
    if change.at is None:
        local = point(at.utc[0][0] + local_time(policy.vehicle).offset(at.utc[0][0]))
        return Offer(change, LOCAL_TIME, DAYTIME, ((nearest_in(change, local), ""),))
    if change.argument:
        return _argument(change, change.at, contract, policy, at)
    return _signal(change, change.at, policy, at)


def _argument(change: NearestChange, cell: int, contract: Contract, policy: Policy, at: Environment) -> Offer:
    parameter = next(parameter for parameter in contract.parameters if parameter.cell == cell)
    if parameter.kind == QUANTITY:
        low, high = max(change.low, parameter.low), min(change.high, parameter.high)
        within = change._replace(low=low, high=high)
        options: tuple[Option, ...] = ((nearest_in(within, at.arguments[cell]), ""),) if low <= high else ()
    else:
        names = tuple(zone.name for zone in policy.zones) if parameter.kind == ZONE else parameter.labels
        options = _named(change, ((value, names[value]) for value in range(parameter.low, parameter.high + 1)))
    return Offer(change, parameter.name, parameter.dimension, options)


def _signal(change: NearestChange, slot: int, policy: Policy, at: Environment) -> Offer:
    signal = next(signal for signal in policy.signals if signal.slot == slot)
    if signal.kind == ENUMERATION:
        return Offer(change, signal.name, signal.dimension, _named(change, signal.labels))
    return Offer(change, signal.name, signal.dimension, ((nearest_in(change, at.slots[slot]), ""),))


def _named(change: NearestChange, labels: Iterable[Option]) -> tuple[Option, ...]:
    return tuple(sorted(option for option in labels if change.allows(option[0])))


class Nearest(NamedTuple):
    """A value of `subject` (a parameter, a signal, or the local time) that would have passed, the nearest one.

    `value` is in the canonical unit of `dimension` (`daytime`: us since local midnight). For an enumeration or a
    zone, `choices` are the names that would pass, and `value` is the ordinal or index of the first.
    """

    subject: str
    dimension: str
    value: int
    choices: tuple[str, ...]


def nearest(
    decision: Decision, invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now
) -> tuple[Nearest, ...]:
    """The changes that, made together, satisfy the condition that decided; empty when no such change is known."""
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    match decision.reason:
        case Reason.ARGUMENT_RANGE:
            return _in_range(invocation)
        case Reason.ENVELOPE:
            return _slower(invocation, policy)
        case Reason.ENERGY:
            return _charged(invocation, policy, at)
        case Reason.INVARIANT:
            known = policy.tables.known
            at = ranging(at, invocation.planner.volume(at.slots, known), known.height, invocation.lasts_us)
    return _fewest(_conditions(decision, invocation, policy), invocation, policy, at)


def _conditions(decision: Decision, invocation: PreparedInvocation, policy: PreparedPolicy) -> list[tuple[Node, bool]]:
    """Pairs of a condition and the truth that it needed; satisfying any one pair is enough."""
    compiler, clause = policy.compiler, decision.clause
    match decision.reason:
        case Reason.OUT_OF_SCOPE:
            rules, goal = [permit.rule for permit in invocation.candidates.permits], True
        case Reason.FORBIDDEN | Reason.DEGRADED if isinstance(clause, Rule):
            rules, goal = [clause], False
        case Reason.STATE_VIOLATED | Reason.INVARIANT if isinstance(clause, Clause):
            return [(compiler.node(clause, invocation.invocation.contract), True)]
        case _:
            return []
    return [(node, goal) for rule in rules if (node := compiler.when(rule)) is not None]


def _fewest(
    conditions: list[tuple[Node, bool]], invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment
) -> tuple[Nearest, ...]:
    changes, contract = ChangeSearch(at, policy.tables), invocation.invocation.contract
    fitting: list[tuple[Nearest, ...]] = []
    for node, goal in conditions:
        offers = [offer(change, contract, policy.policy, at) for change in changes.find(node, goal) or ()]
        if offers and all(one.options for one in offers):
            tried = _tried(offers, changes, node, goal)
            if tried is not None:
                fitting.append(tried)
    return min(fitting, key=len, default=())


def _tried(offers: list[Offer], changes: ChangeSearch, node: Node, goal: bool) -> tuple[Nearest, ...] | None:
    """The offers that pass when tried. A change can break another part of the condition."""
    first: Made = {one.change.subject: one.options[0][0] for one in offers}
    kept: list[Nearest] = []
    for one in offers:
        good = [option for option in one.options if changes.help(node, goal, first | {one.change.subject: option[0]})]
        if not good:
            return None
        names = tuple(name for _, name in good if name)
        kept.append(Nearest(one.subject, one.dimension, good[0][0], names))
    return tuple(kept)


def _in_range(invocation: PreparedInvocation) -> tuple[Nearest, ...]:
    parameter = invocation.misfit
    if parameter is None or parameter.kind == PLACE:
        return ()
    argument = invocation.invocation.arguments[parameter.cell]
    value = parameter.low if argument < parameter.low else parameter.high
    return (Nearest(parameter.name, parameter.dimension, value, ()),)


def _slower(invocation: PreparedInvocation, policy: PreparedPolicy) -> tuple[Nearest, ...]:
    contract, speed = invocation.invocation.contract, policy.policy.vehicle.speed
    return tuple(
        Nearest(parameter.name, parameter.dimension, speed, ())
        for parameter in contract.parameters
        if parameter.cell == contract.motion.speed and parameter.low <= speed
    )


def _charged(invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment) -> tuple[Nearest, ...]:
    known = policy.tables.known
    volume = invocation.planner.volume(at.slots, known)
    needed = invocation.energy.needed(volume.farthest[1], volume.height[:2], drains(at.slots[known.drain])[1])
    return tuple(
        Nearest(signal.name, signal.dimension, needed, ())
        for signal in policy.policy.signals
        if signal.slot == policy.policy.vehicle.battery and needed <= FULL
    )
