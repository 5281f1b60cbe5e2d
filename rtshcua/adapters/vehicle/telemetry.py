"""Telemetry messages become readings of the policy's declared signals: quantised here, once; no float goes further."""

from collections.abc import Mapping
from typing import Any, Final

from rtshcua.decision.tree import where
from rtshcua.mavlink import dialect
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.quantise import hypot_mm, quantise
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import POSITION, Signal, SignalSource
from rtshcua.model.flat.zone import HALF_TURN, MAX_COORDINATE, Projection, project

#: Each message is asked for several times within the shortest time to stale of what it carries, within these, in us.
MOST_OFTEN_US, LEAST_OFTEN_US = 100_000, 1_000_000
_WITHIN_STALE = 4


_NONE: Final = frozenset[str]()
_NUMBERS: Final = (int, float)  # as `int | float` it would be made anew for each field


def _says_nothing(wind: Any) -> bool:
    """A multirotor of ArduPilot's that estimates no wind reports none from the south, and does so in 8 m/s (recorded):
    `atan2(-0, -0)` is -180 degrees.
    """
    return bool(wind.speed == 0 and wind.direction == -180)


class UnknownSource(ValueError):
    """A policy reads a signal from what the dialect does not have, or from what is not one number."""


class Telemetry:
    """Knows which messages carry which signals, and of whom each is taken.

    What the autopilot reports is never replaced by another component's word, and where the vehicle is and what charge
    it has is taken from the autopilot alone. Of a sensor that there are several of, the first instance counts.
    Raises UnknownSource.
    """

    def __init__(self, policy: Policy) -> None:
        vehicle = policy.vehicle
        self._own = {*where(vehicle), vehicle.battery}
        self._first: dict[tuple[int, str], Any] = {}
        self._projection = policy.projection
        self._by_message: dict[str, list[tuple[Signal, SignalSource]]] = {}
        for signal in policy.signals:
            for source in signal.sources:
                _check(signal, source)
                self._by_message.setdefault(source.message, []).append((signal, source))
        #: the messages that carry some signal, and how often each is needed, in us
        self.intervals: Mapping[str, int] = {
            name: _often(min(signal.stale_us for signal, _ in carried)) for name, carried in self._by_message.items()
        }
        #: for each signal, the messages that may carry it
        self.sources = [frozenset(source.message for source in signal.sources) for signal in policy.signals]

    def read(
        self, name: str, message: Any, component: int = AUTOPILOT, doubtful: frozenset[str] = _NONE
    ) -> tuple[tuple[int, int | None], ...]:
        """(slot, canonical integer) of every signal that this message carries; None is "reported as not known".

        So is a value that rests on a field of the autopilot's which is `doubtful`. When it was measured is not said
        here: see `source_time`.
        """
        carried = self._by_message.get(name)
        if carried is None or not self._is_first(name, message, component):
            return ()
        if component != AUTOPILOT:
            doubtful = _NONE
        empty = name == "WIND" and _says_nothing(message)
        values: list[tuple[int, int | None]] = []
        for signal, source in carried:
            if empty or (doubtful and not doubtful.isdisjoint(source.fields)):
                values += [(slot, None) for slot in range(signal.slot, signal.slot + 1 + (signal.kind == POSITION))]
            elif signal.kind == POSITION:
                x, y = _place(source, message, self._projection)
                values += [(signal.slot, x), (signal.slot + 1, y)]
            else:
                values.append((signal.slot, _number(source, message)))
        if component == AUTOPILOT:
            self._own.update(slot for slot, _ in values)
            return tuple(values)
        return tuple((slot, value) for slot, value in values if slot not in self._own)

    def _is_first(self, name: str, message: Any, component: int) -> bool:
        """Whether this comes from the lowest instance of its sensor that the component was heard to have."""
        if message.instance_field is None:
            return True
        instance = getattr(message, message.instance_field)
        first = self._first[component, name] = min(instance, self._first.get((component, name), instance))
        return bool(instance == first)


def _check(signal: Signal, source: SignalSource) -> None:
    message = dialect.load().messages.get(source.message)
    for name in source.fields:
        field = None if message is None else message.fields.get(name)
        if field is None or field.length or field.type == "char":
            raise UnknownSource(
                f"the policy reads `{signal.name}` from `{source.message}.{name}`, which is no number that a vehicle "
                "reports"
            )


def _often(stale_us: int) -> int:
    return min(max(stale_us // _WITHIN_STALE, MOST_OFTEN_US), LEAST_OFTEN_US)


def _number(source: SignalSource, message: Any) -> int | None:
    parts = [_field(source, message, field) for field in source.fields]
    if len(parts) == 1 or parts[0] is None:
        return parts[0]
    return None if parts[1] is None else hypot_mm(parts[0], parts[1])


def _place(source: SignalSource, message: Any, projection: Projection) -> tuple[int, int] | tuple[None, None]:
    latitude, longitude = (_field(source, message, field) for field in source.fields)
    if latitude is None or longitude is None:
        return None, None
    x, y = project(projection, latitude, longitude)
    # farther than any zone can be declared, or on no globe: nonsense, not a place
    if max(abs(x), abs(y)) > MAX_COORDINATE or abs(longitude) > HALF_TURN:
        return None, None
    return x, y


def _field(source: SignalSource, message: Any, field: str) -> int | None:
    raw = getattr(message, field)
    if not isinstance(raw, _NUMBERS):
        return None
    value = quantise(raw, source.numerator, source.denominator, source.unknown)
    return None if value is None or abs(value) > MAX_VALUE else value
