"""The space of possible situations, the start of every search, and the possible values of signals."""

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from rtshcua.decision.evaluate import Tables
from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.decision.times import LocalTime
from rtshcua.decision.values import MISSING, Span, Value, interval, maybe, members
from rtshcua.ground.analysis.plane import Plane
from rtshcua.ground.checker.ranges import OPEN, Carrier, carried
from rtshcua.ground.checker.symbols import Extent
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Contract
from rtshcua.model.flat.limits import DAY, FULL, MAX_VALUE, WEEK
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, NUMBER, POSITION, Signal
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.quantity import Dimension


def means_unknown(signal: Signal, value: int) -> bool:
    """Whether each source of an enumeration lists the value under `unknown at`."""
    return signal.kind == ENUMERATION and all(value in source.unknown for source in signal.sources)


def reported_range(signal: Signal, dialect: Dialect) -> Extent:
    """Return the least and the greatest value of a number; open for other kinds and for unknown messages."""
    if signal.kind != NUMBER or any(source.message not in dialect.messages for source in signal.sources):
        return OPEN
    carriers = (
        Carrier(source.message, source.fields, source.numerator, source.denominator) for source in signal.sources
    )
    return carried(dialect, Dimension(signal.dimension), carriers)


ANYWHERE = interval(-MAX_COORDINATE, MAX_COORDINATE)
#: dimensions whose values lie between 0 and `FULL`
_WHOLE = frozenset({Dimension.RATIO.value})


class SituationSpace(NamedTuple):
    """A set of situations: a value for each argument cell and state slot, UTC and its error.

    `phases` are the phases that the invocation may be in, as indexes into the policy's names; -1 stands for all phases
    that the policy does not name. `monitors` has the possible truth values of each temporal monitor.
    """

    arguments: tuple[Value, ...]
    slots: tuple[Value, ...]
    utc: tuple[Span, ...]
    error: Span
    phases: frozenset[int]
    monitors: tuple[int, ...]
    tables: Tables
    plane: Plane


def space_of(prepared: PreparedPolicy, contract: Contract | None, plane: Plane | None = None) -> SituationSpace:
    """Return all situations in which a skill may be invoked. With None they are those of any skill, without arguments.

    Pass the `plane` of an earlier space of the policy, which caches the relations of its zones.
    """
    policy = prepared.policy
    return SituationSpace(
        arguments=() if contract is None else arguments_of(contract),
        slots=(*signals(policy), MISSING),
        utc=_moments(prepared, contract),
        error=(0, 0),
        phases=frozenset(range(-1, len(policy.phases))),
        monitors=(7,) * len(policy.monitors),
        tables=prepared.tables,
        plane=plane or Plane(policy.zones, prepared.tables.zones),
    )


def arguments_of(contract: Contract) -> tuple[Value, ...]:
    """Return the range of each argument cell."""
    cells: dict[int, Value] = {}
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            cells[parameter.cell] = cells[parameter.cell + 1] = ANYWHERE
        elif parameter.kind in (CHOICE, ZONE):
            cells[parameter.cell] = members(range(parameter.low, max(parameter.low, parameter.high) + 1))
        else:
            cells[parameter.cell] = interval(parameter.low, parameter.high)
    return tuple(cells[cell] for cell in sorted(cells))


def signals(policy: Policy) -> Sequence[Value]:
    """Return a value for each slot: all that its signal may report, or missing."""
    values: list[Value] = [MISSING] * policy.slots
    for signal in policy.signals:
        if signal.kind == POSITION:
            values[signal.slot] = values[signal.slot + 1] = maybe(ANYWHERE)
        elif signal.kind == ENUMERATION:
            reported = _reported(signal)
            values[signal.slot] = maybe(members(reported)) if reported else MISSING
        elif signal.dimension in _WHOLE:
            values[signal.slot] = maybe(interval(0, FULL))
        else:
            least = 0 if all(len(source.fields) > 1 for source in signal.sources) else -MAX_VALUE
            values[signal.slot] = maybe(interval(least, MAX_VALUE))  # two components form a magnitude
    return values


def _reported(signal: Signal) -> list[int]:
    """Return the possible members of an enumeration, without those that mean that the value is unknown."""
    return [value for value, _ in signal.labels if not means_unknown(signal, value)]


def _moments(prepared: PreparedPolicy, contract: Contract | None) -> tuple[Span, ...]:
    """Return time spans that cover every way in which time can affect a condition.

    The start and end dates of the zones divide time into intervals. Each interval contributes one day, or one week if a
    condition reads the day of the week. It also contributes the days around one clock change of each kind.
    """
    policy, local = prepared.policy, prepared.tables.local
    period = WEEK if reads_days(policy, contract) else DAY
    dates = sorted(
        {moment for zone in policy.zones for moment in (zone.dates[:1] + tuple(d + 1 for d in zone.dates[1:]))}
    )
    known = local.known()
    if dates:
        starts = [max(dates[0] - period, 0), *dates]
        ends = [*(date - 1 for date in dates), dates[-1] + period - 1]
    elif known is None:
        return ((0, period - 1),)
    else:
        starts, ends = [local.steady()], [known[1] - 1]
    found: list[Span] = []
    for low, high in zip(starts, ends, strict=True):
        if low <= high:
            found.append((low, min(high, low + period - 1)))
            found += _set_clocks(local, low, high)
    return tuple(found)


def _set_clocks(local: LocalTime, low: int, high: int) -> Iterator[Span]:
    """Yield the days before and after the clock changes in an interval, once for each kind of change."""
    seen: set[tuple[int, int]] = set()
    for moment, before, after in local.changes():
        if low <= moment <= high and (before, after) not in seen:
            seen.add((before, after))
            yield max(low, moment - DAY), min(high, moment + DAY - 1)


def reads_days(policy: Policy, contract: Contract | None = None) -> bool:
    """Whether some condition or zone depends on the day of the week."""
    contracts = policy.contracts if contract is None else (contract, *policy.contracts)
    clauses = (clause for one in contracts for clause in (*one.require, *one.assume, *one.maintain))
    whens = (rule.when for rule in policy.rules if rule.when is not None)
    code = (clause.code[::3] for clause in chain(clauses, whens, (monitor.when for monitor in policy.monitors)))
    return any(zone.weekly for zone in policy.zones) or any(Op.WEEK_IN in ops for ops in code)
