"""A state for a hypothetical decision: the vehicle where the plan has it before a step, signals as the contract
requires them, and overrides such as `battery=20 %`, `gps.fix=fix_3d`, `position=47.39 N, 8.54 E`, `wind.speed=unknown`.
"""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rtshcua.decision.nearest import ChangeSearch, nearest_in
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.temporal import lasting
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.analysis.space import means_unknown, reported_range
from rtshcua.ground.checker.ranges import accepted
from rtshcua.ground.checker.symbols import Extent
from rtshcua.ground.language.exact_values import exact
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL, MAX_VALUE
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import CELL, ENUMERATION, POSITION, Signal
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.flat.zone import MAX_COORDINATE, project
from rtshcua.model.quantity import UNITS, Dimension

#: passes over the clauses, because a change for one clause may break another
_ROUNDS = 4

#: the voltage of a full lithium cell, mV
_FULL_CELL = 4_200


def nominal(invocations: Sequence[PreparedInvocation], step: int, policy: PreparedPolicy, now: Now) -> State:
    """Return a fresh state in which the step's own clauses hold, as far as changes of single signals allow."""
    invocation, flat = invocations[step], policy.policy
    values = _start(flat)
    x, y, height = place_before(invocations, step)
    for slot, value in ((flat.vehicle.position, x), (flat.vehicle.position + 1, y), (flat.vehicle.height, height)):
        values[slot] = value
    values[flat.vehicle.battery] = FULL
    for signal in flat.signals:
        if signal.name == CELL:
            values[signal.slot] = _FULL_CELL
    fixed = {flat.vehicle.position, flat.vehicle.position + 1, flat.vehicle.height}
    for _ in range(_ROUNDS):
        for clause in _clauses_of(invocation):
            _satisfy(clause, invocation, policy, now, values, fixed)
    return lasting(_fresh_state(values), policy, now)


def place_before(invocations: Sequence[PreparedInvocation], step: int) -> tuple[int, int, int]:
    """The planned position before a step: local x, y and height in mm; at home before the first step."""
    x, y, height = 0, 0, 0
    for invocation in invocations[:step]:
        plan = invocation.invocation.plan
        if plan.path:
            x, y = plan.path[-2:]
        if plan.kind in (MotionKind.HOME, MotionKind.LAND):
            height = 0
        elif plan.kind != MotionKind.HOLD:
            height = plan.last_height
    return x, y, height


def _start(policy: Policy) -> list[int | None]:
    values: list[int | None] = [0] * policy.slots
    for signal in policy.signals:
        if signal.kind == ENUMERATION and signal.labels:
            known = {unknown for source in signal.sources for unknown in source.unknown}
            values[signal.slot] = next((value for value, _ in signal.labels if value not in known), signal.labels[0][0])
        elif signal.kind == POSITION:
            values[signal.slot + 1] = 0
    return values


def _fresh_state(values: Sequence[int | None]) -> State:
    return State(tuple(values), (0,) * len(values))


def _clauses_of(invocation: PreparedInvocation) -> Iterator[Clause]:
    for guards in (invocation.require, invocation.assume, invocation.maintain):
        yield from (clause for clause, _ in guards)


def _satisfy(
    clause: Clause,
    invocation: PreparedInvocation,
    policy: PreparedPolicy,
    now: Now,
    values: list[int | None],
    fixed: set[int],
) -> None:
    """Change the signals that a clause reads, except those in `fixed`, so that the clause holds."""
    sets = situation(_fresh_state(values), policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    node = policy.compiler.node(clause, invocation.invocation.contract)
    for change in ChangeSearch(at, policy.tables, signals_only=True).find(node, True) or ():
        if change.argument or change.at is None or change.at in fixed:
            continue
        choices = change.choices
        values[change.at] = min(choices) if choices else nearest_in(change, at.slots[change.at])


NOT_KNOWN = "unknown"
_TRUTHS = {"true": TRUE, "false": FALSE, NOT_KNOWN: UNKNOWN}
_NUMBER = re.compile(r"(-?)\s*([0-9][0-9_]*(?:\.[0-9]+)?)\s*(\S*)(?:\s+above\s+home)?")
_PLACE = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*([NS])\s*,\s*([0-9]+(?:\.[0-9]+)?)\s*([EW])")


class SignalOverride(NamedTuple):
    """The name of a signal or condition, and its value as written."""

    name: str
    text: str


def read_overrides(texts: Sequence[str]) -> tuple[SignalOverride, ...] | Refusal:
    """Parse `NAME=VALUE` overrides. A repeated name is refused."""
    found: dict[str, SignalOverride] = {}
    for each in texts:
        name, equals, text = (" ".join(part.split()) for part in each.rpartition("="))
        if not equals:
            return Refusal("usage", f"`{each}` has no `=`", "write a signal and its value: `battery=20 %`")
        if name in found:
            return Refusal("usage", f"`{name}` is given twice", "keep one of them")
        found[name] = SignalOverride(name, text)
    return tuple(found.values())


def overridden(state: State, setting: SignalOverride, policy: Policy, dialect: Dialect) -> State | Refusal:
    """Return the state with one signal changed: `name=unknown` for a missing one, `CONDITION=true` for one over time.

    As in a test, a value that the signal lists under `unknown at` is missing, and a value that its fields cannot carry
    is refused.
    """
    name, text = setting
    signal = next((each for each in policy.signals if each.name == name), None)
    if signal is None:
        return _over_time(state, name, text, policy)
    values = list(state.values)
    slots = signal.slots
    if text == NOT_KNOWN:
        found: tuple[int | None, ...] | Refusal = (None,) * len(slots)
    else:
        found = _signal_value(signal, text, policy, dialect)
        if not isinstance(found, Refusal) and means_unknown(signal, found[0]):
            found = (None,)
    if isinstance(found, Refusal):
        return found
    for slot, value in zip(slots, found, strict=True):
        values[slot] = value
    return State(tuple(values), state.ages, state.monitors)


def _over_time(state: State, name: str, text: str, policy: Policy) -> State | Refusal:
    """Return the state with a changed truth of a condition over time, which is named by its text."""
    conditions = [" ".join(monitor.when.text.split()) for monitor in policy.monitors]
    if name not in conditions:
        names = [signal.name for signal in policy.signals]
        near = nearest(name, [*names, *conditions])
        known = ", ".join(f"`{each}`" for each in [*names, *conditions])
        help = f"did you mean `{near}`?" if near is not None else f"known: {known}"
        return Refusal("usage", f"the policy reads no signal `{name}`", help)
    truth = _TRUTHS.get(text)
    if truth is None:
        return Refusal("usage", f"`{text}` is not a value of `{name}`", "write `true`, `false` or `unknown`")
    monitors = tuple(
        truth if condition == name else old for condition, old in zip(conditions, state.monitors, strict=True)
    )
    return State(state.values, state.ages, monitors)


def _signal_value(signal: Signal, text: str, policy: Policy, dialect: Dialect) -> tuple[int, ...] | Refusal:
    if signal.kind == POSITION:
        return _place_value(signal, text, policy)
    if signal.kind == ENUMERATION:
        value = next((value for value, label in signal.labels if label == text), None)
        labels = [label for _, label in signal.labels]
        near = nearest(text, labels)
        help = f"did you mean `{near}`?" if near is not None else f"accepted: {', '.join(labels)}"
        return Refusal("usage", f"`{text}` is not a value of `{signal.name}`", help) if value is None else (value,)
    return _number_value(signal, text, reported_range(signal, dialect))


def _number_value(signal: Signal, text: str, values: Extent) -> tuple[int, ...] | Refusal:
    dimension = Dimension(signal.dimension)
    measured = Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension
    units = ", ".join(f"`{name}`" for name, unit in UNITS.items() if unit.dimension is measured)
    help = f"write a {dimension.value} with one of the units {units}" if units else "write a whole number"
    match = _NUMBER.fullmatch(text)
    if match is None:
        return Refusal("usage", f"`{text}` is not a value of `{signal.name}`", help)
    found = exact(match[2], match[3] or None, negative=bool(match[1]))
    if found.trouble is not None or found.dimension is not measured or abs(found.value) > MAX_VALUE:
        return Refusal("usage", f"`{text}` is not a {dimension.value} that `{signal.name}` can have", help)
    if not values.has(found.value):
        accepts = accepted(values, dimension, found.value)
        return Refusal("usage", f"`{signal.name}` cannot be `{text}`", accepts)
    return (found.value,)


def _place_value(signal: Signal, text: str, policy: Policy) -> tuple[int, ...] | Refusal:
    match = _PLACE.fullmatch(text)
    help = "write `47.39774 N, 8.54559 E`, within 500 km of home"
    if match is None:
        return Refusal("usage", f"`{text}` is not a value of `{signal.name}`", help)
    latitude = exact(match[1], "deg", negative=match[2] == "S")
    longitude = exact(match[3], "deg", negative=match[4] == "W")
    if latitude.trouble is not None or longitude.trouble is not None:
        return Refusal("usage", f"`{text}` has more than 7 decimals", help)
    place = project(policy.projection, latitude.value, longitude.value)
    if max(map(abs, place)) > MAX_COORDINATE:
        return Refusal("usage", f"`{text}` is too far from the vehicle's home", help)
    return place
