"""A state changed by hand: `battery=20 %`, `gps.fix=fix_3d`, `position=47.39 N, 8.54 E`, `wind.speed=unknown`."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.analysis.space import means_unknown, reported_range
from rtshcua.ground.checker.ranges import accepted
from rtshcua.ground.checker.symbols import Extent
from rtshcua.ground.language.exact_values import exact
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION, Signal
from rtshcua.model.flat.situation import State
from rtshcua.model.flat.zone import MAX_COORDINATE, project
from rtshcua.model.quantity import UNITS, Dimension

NOT_KNOWN = "unknown"
_TRUTHS = {"true": TRUE, "false": FALSE, NOT_KNOWN: UNKNOWN}
_NUMBER = re.compile(r"(-?)\s*([0-9][0-9_]*(?:\.[0-9]+)?)\s*(\S*)(?:\s+above\s+home)?")
_PLACE = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*([NS])\s*,\s*([0-9]+(?:\.[0-9]+)?)\s*([EW])")


class Setting(NamedTuple):
    """What is set, and to what, as written."""

    name: str
    text: str


def settings(texts: Sequence[str]) -> tuple[Setting, ...] | Refusal:
    """What is set by hand, each signal and each condition once."""
    found: dict[str, Setting] = {}
    for each in texts:
        name, equals, text = (" ".join(part.split()) for part in each.rpartition("="))
        if not equals:
            return Refusal("usage", f"`{each}` sets nothing", "write a signal and its value: `battery=20 %`")
        if name in found:
            return Refusal("usage", f"`{name}` is given twice", "keep one of them")
        found[name] = Setting(name, text)
    return tuple(found.values())


def given(state: State, setting: Setting, policy: Policy, dialect: Dialect) -> State | Refusal:
    """The state with one signal changed; `name=unknown` for one that is missing, `CONDITION=true` over time.

    As in a test, what the signal has under `unknown at` is missing, and what its fields cannot carry is refused.
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
        found = _value(signal, text, policy, dialect)
        if not isinstance(found, Refusal) and means_unknown(signal, found[0]):
            found = (None,)
    if isinstance(found, Refusal):
        return found
    for slot, value in zip(slots, found, strict=True):
        values[slot] = value
    return State(tuple(values), state.ages, state.monitors)


def _over_time(state: State, name: str, text: str, policy: Policy) -> State | Refusal:
    """The truth of a condition over time, which is called as it is written."""
    conditions = [" ".join(monitor.when.text.split()) for monitor in policy.monitors]
    if name not in conditions:
        names = [signal.name for signal in policy.signals]
        near = nearest(name, [*names, *conditions])
        known = ", ".join(f"`{each}`" for each in [*names, *conditions])
        help = f"did you mean `{near}`?" if near is not None else f"it reads {known}"
        return Refusal("usage", f"the policy reads no signal `{name}`", help)
    truth = _TRUTHS.get(text)
    if truth is None:
        return Refusal("usage", f"`{text}` is no truth of `{name}`", "write `true`, `false` or `unknown`")
    monitors = tuple(
        truth if condition == name else old for condition, old in zip(conditions, state.monitors, strict=True)
    )
    return State(state.values, state.ages, monitors)


def _value(signal: Signal, text: str, policy: Policy, dialect: Dialect) -> tuple[int, ...] | Refusal:
    if signal.kind == POSITION:
        return _place(signal, text, policy)
    if signal.kind == ENUMERATION:
        value = next((value for value, label in signal.labels if label == text), None)
        labels = [label for _, label in signal.labels]
        near = nearest(text, labels)
        help = f"did you mean `{near}`?" if near is not None else f"it is one of {', '.join(labels)}"
        return Refusal("usage", f"`{text}` is no value of `{signal.name}`", help) if value is None else (value,)
    return _number(signal, text, reported_range(signal, dialect))


def _number(signal: Signal, text: str, values: Extent) -> tuple[int, ...] | Refusal:
    dimension = Dimension(signal.dimension)
    measured = Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension
    units = ", ".join(f"`{name}`" for name, unit in UNITS.items() if unit.dimension is measured)
    help = f"write a {dimension.value} with one of the units {units}" if units else "write a whole number"
    match = _NUMBER.fullmatch(text)
    if match is None:
        return Refusal("usage", f"`{text}` is no value of `{signal.name}`", help)
    found = exact(match[2], match[3] or None, negative=bool(match[1]))
    if found.trouble is not None or found.dimension is not measured or abs(found.value) > MAX_VALUE:
        return Refusal("usage", f"`{text}` is no {dimension.value} that `{signal.name}` can have", help)
    if not values.has(found.value):
        accepts = accepted(values, dimension, found.value)
        return Refusal("usage", f"`{signal.name}` is never `{text}`", accepts)
    return (found.value,)


def _place(signal: Signal, text: str, policy: Policy) -> tuple[int, ...] | Refusal:
    match = _PLACE.fullmatch(text)
    help = "write `47.39774 N, 8.54559 E`, within 500 km of home"
    if match is None:
        return Refusal("usage", f"`{text}` is no value of `{signal.name}`", help)
    latitude = exact(match[1], "deg", negative=match[2] == "S")
    longitude = exact(match[3], "deg", negative=match[4] == "W")
    if latitude.trouble is not None or longitude.trouble is not None:
        return Refusal("usage", f"`{text}` has more than 7 decimals", help)
    place = project(policy.projection, latitude.value, longitude.value)
    if max(map(abs, place)) > MAX_COORDINATE:
        return Refusal("usage", f"`{text}` is too far from the vehicle's home", help)
    return place
