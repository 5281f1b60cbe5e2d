"""Read the policy's signals from telemetry messages. Values are quantised here, once: no float goes further."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final, NamedTuple, TypeAlias

from rtshcua.adapters.vehicle.drain import Consumption
from rtshcua.decision.rates import Rate, rates
from rtshcua.decision.tree import where
from rtshcua.mavlink import dialect
from rtshcua.mavlink.enums import MAV_BATTERY_FUNCTION_AVIONICS, MAV_BATTERY_FUNCTION_PAYLOAD
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.quantise import hypot_mm, quantise
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import DRAIN, NUMBER, POSITION, Signal, SignalSource
from rtshcua.model.flat.zone import HALF_TURN, MAX_COORDINATE, Projection, project

_Read: TypeAlias = Callable[[Any], int | None]  # a field of a message
Where = tuple[tuple[str, int], ...]
"""The fields that select a sensor, and their raw values."""

_NONE: Final = frozenset[str]()
_NUMBERS: Final = (int, float)  # `int | float` would be built anew for each field


def _says_nothing(wind: Any) -> bool:
    """Whether a WIND report is the one that an ArduPilot multirotor without a wind estimate sends: 0 m/s from -180
    degrees, which is `atan2(-0, -0)`, even in a wind of 8 m/s (recorded).
    """
    return bool(wind.speed == 0 and wind.direction == -180)


class UnknownSource(ValueError):
    """A policy reads a signal from a field that the dialect does not have or that is not a single number."""


class Telemetry:
    """Maps messages to signals, by sender.

    A value of the autopilot is never replaced by that of another component; position and charge are taken from the
    autopilot alone. Of several instances of a sensor the first one counts, and of several batteries the one with the
    least charge, see `Batteries`. Raises UnknownSource.
    """

    def __init__(self, policy: Policy, contracts: Sequence[Contract] = ()) -> None:
        self._vehicle = vehicle = policy.vehicle
        self._own = {*where(vehicle), vehicle.battery}
        # sensors that the autopilot has reported: each always has the same slots
        self._told: set[tuple[str, Where]] = set()
        self._first: dict[tuple[int, str, Where], Any] = {}
        self._by_message: dict[str, list[_Carried]] = {}
        #: the batteries; the one with the least charge counts
        self.batteries = Batteries(_battery_stale_us(policy))
        measured = next((each for each in policy.signals if each.name == DRAIN and each.kind == NUMBER), None)
        self._drain = -1 if measured is None else measured.slot
        #: the measured consumption of charge
        self.consumption = Consumption(vehicle)
        self._height: int | None = None
        slots = () if measured is None else (measured.slot, vehicle.position, vehicle.height)
        self._measured = _carry(policy, *slots)
        #: notes for the operator, to be taken from here
        self.notes: list[str] = self.batteries.notes
        self.consumption.notes = self.notes
        #: messages of the autopilot that need no selection, with the instance that counts
        self._whole: dict[str, int | None] = {}
        for signal in policy.signals:
            for source in signal.sources:
                _check(signal, source)
                carried = _carried(signal, source, policy.projection)
                self._by_message.setdefault(source.message, []).append(carried)
        self._uniform = {name for name, each in self._by_message.items() if not any(one.where for one in each)}
        self._uniform -= {"WIND", BATTERY}
        #: the messages that carry a signal, and how often the policy and the mission's contracts need each
        self.rates: Mapping[str, Rate] = rates(policy, contracts)
        #: for each signal, the messages that may carry it
        self.sources = [frozenset(source.message for source in signal.sources) for signal in policy.signals]

    def need(self, policy: Policy, contracts: Sequence[Contract]) -> None:
        """Set the contracts of the mission's steps, which determine the needed rates."""
        self.rates = rates(policy, contracts)

    def read(
        self, name: str, message: Any, component: int = AUTOPILOT, doubtful: frozenset[str] = _NONE, now_us: int = 0
    ) -> tuple[tuple[int, int | None], ...]:
        """Return (slot, canonical integer) for every signal in this message; None is "reported as unknown".

        A value of the autopilot that rests on a `doubtful` field is unknown, too. The message arrived at `now_us`;
        `source_time` says when the value was measured.
        """
        values = self._read(name, message, component, doubtful, now_us)
        return self._measure(values, now_us) if name in self._measured else values

    def _measure(self, values: tuple[tuple[int, int | None], ...], now_us: int) -> tuple[tuple[int, int | None], ...]:
        """The same values, with the measured consumption in the slot of `battery.drain`."""
        known, vehicle = dict(values), self._vehicle
        self._height = known.get(vehicle.height, self._height)
        if vehicle.position in known:
            self.consumption.move(known[vehicle.position], known[vehicle.position + 1], self._height, now_us)
        if self._drain in known:
            known[self._drain] = self.consumption.take(known[self._drain], now_us)
        return tuple(known.items())

    def _read(
        self, name: str, message: Any, component: int, doubtful: frozenset[str], now_us: int
    ) -> tuple[tuple[int, int | None], ...]:
        carried = self._by_message.get(name)
        if carried is None:
            return ()
        if component != AUTOPILOT:
            values, _ = self._select(name, message, component, carried, _NONE)
            return tuple((slot, value) for slot, value in values if slot not in self._own)
        if not doubtful and name in self._whole and _instance(message) == self._whole[name]:
            return tuple([value for each in carried for value in each.read(message)])
        values, found = self._select(name, message, component, carried, doubtful)
        if name == BATTERY:
            charges = [reading for each in carried if each.is_charge for reading in each.read(message)]
            values += self.batteries.take(message, charges, now_us) if charges else ()
        self._learn(name, message, values, found)
        return tuple(values)

    def _learn(
        self, name: str, message: Any, values: list[tuple[int, int | None]], found: list[tuple[str, Where]]
    ) -> None:
        """Note the slots that the autopilot reports itself, and the messages that may be read without a selection."""
        if not self._told.issuperset(found):
            self._told.update(found)
            self._own.update(slot for slot, _ in values)
        if found and name in self._uniform:
            self._whole[name] = _instance(message)

    def _select(
        self, name: str, message: Any, component: int, carried: "Sequence[_Carried]", doubtful: frozenset[str]
    ) -> tuple[list[tuple[int, int | None]], list[tuple[str, Where]]]:
        """The values of the first instance of each selected sensor, charges excepted, and the sensors found."""
        values: list[tuple[int, int | None]] = []
        found: list[tuple[str, Where]] = []
        instance, empty = _instance(message), name == "WIND" and _says_nothing(message)
        for each in carried:
            if each.where and not _is_selected(each.where, message):
                continue
            if not (each.is_charge or instance is None or self._is_first(name, instance, component, each.where)):
                continue
            found.append((name, each.where))
            if not each.is_charge:
                unknown = empty or (doubtful and not doubtful.isdisjoint(each.fields))
                values += [(slot, None) for slot in each.slots] if unknown else each.read(message)
        return values, found

    def _is_first(self, name: str, instance: int, component: int, where: Where) -> bool:
        """Whether this is the lowest instance of a selected sensor that the component has sent."""
        key = component, name, where
        first = self._first[key] = min(instance, self._first.get(key, instance))
        return bool(instance == first)


def _carry(policy: Policy, *slots: int) -> frozenset[str]:
    """The messages that carry one of these slots."""
    return frozenset(
        source.message
        for signal in policy.signals
        if not set(signal.slots).isdisjoint(slots)
        for source in signal.sources
    )


#: the message about each battery, and its field for the charge
BATTERY: Final = "BATTERY_STATUS"
_CHARGE: Final = ("battery_remaining",)
_FEEDS_NO_MOTOR: Final = frozenset({MAV_BATTERY_FUNCTION_AVIONICS, MAV_BATTERY_FUNCTION_PAYLOAD})
#: how many reports of other batteries must come before a battery counts as silent
_AMONG: Final = 3
#: us: two reports within this time establish a battery; a battery that counts may be silent no longer than this
COUNTS_US: Final = 60_000_000
#: A battery that reports seldom is silent after this many of its usual intervals, taken from the last intervals.
_SELDOM: Final = 3
_TIMES: Final = 5


@dataclass(slots=True)
class _Charge:
    """One battery: its last values by slot, their time, whether it counts, the reports of others since, its last
    intervals, and whether it reported more than once while it did not count.
    """

    values: Mapping[int, int | None]
    at_us: int
    counts: bool
    since: int = 0
    between_us: tuple[int, ...] = ()
    now_and_then: bool = False

    @property
    def usual_us(self) -> int:
        """The usual interval between two reports; 0 where unknown."""
        return sorted(self.between_us)[(len(self.between_us) - 1) // 2] if self.between_us else 0


class Batteries:
    """The batteries that supply the motors; the one with the least charge counts.

    A battery that is reported to feed avionics or a payload does not count. ArduPilot never reports the function, so
    there all count. A battery counts from its second report on, if that came within a minute or the battery was not
    silent in between: a single report with another number is an error or comes from another sender. No charge is
    reported before it is known which of the batteries count; on the ground that takes up to a minute after a single
    report, once for each number. If a battery that counts does not know its charge, the charge is unknown. The same
    applies if it is silent for longer than the time to stale or, for longer intervals, than `_SELDOM` usual intervals,
    but at most a minute.
    """

    def __init__(self, stale_us: int) -> None:
        self._stale_us = stale_us
        self._charges: dict[tuple[int, bool], _Charge] = {}  # by number and whether it feeds motors
        self._known = False
        #: the motors may turn, so a new battery is no longer waited for
        self.armed = False
        #: each battery that was reported twice: its function (MAV_BATTERY_FUNCTION) and its charge in %
        self.told: dict[int, tuple[int, int]] = {}
        #: notes for the operator, to be taken from here
        self.notes: list[str] = []

    @staticmethod
    def flies(function: int) -> bool:
        """Whether a battery with this MAV_BATTERY_FUNCTION counts."""
        return function not in _FEEDS_NO_MOTOR

    def take(
        self, message: Any, readings: Sequence[tuple[int, int | None]], now_us: int
    ) -> Sequence[tuple[int, int | None]]:
        """Take in one BATTERY_STATUS with its own readings; return the readings that count."""
        number, function = message.id, message.battery_function
        flies, charges = self.flies(function), self._charges
        charges[number, flies] = self._after(charges.get((number, flies)), dict(readings), now_us)
        counts = charges[number, flies].counts
        if counts:
            self._tell(number, function, message.battery_remaining)
        if not flies:
            return ()
        for other, each in charges.items():
            each.since += other != (number, flies)
        if not self._are_known(now_us):
            return [(slot, None) for slot, _ in readings] if self._known else ()
        return self._worst(readings, now_us) if counts else ()

    def _worst(self, readings: Sequence[tuple[int, int | None]], now_us: int) -> Sequence[tuple[int, int | None]]:
        counted = [each for (_, flying), each in self._charges.items() if flying and each.counts]
        silent = any(self._is_silent(each, now_us) for each in counted)
        return [(slot, None if silent else _least(counted, slot)) for slot, _ in readings]

    def _after(self, before: _Charge | None, values: Mapping[int, int | None], now_us: int) -> _Charge:
        """The state of a battery after one more report; `before` is its previous state."""
        if before is None:
            return _Charge(values, now_us, counts=False)
        between_us = max(now_us - before.at_us, 0)
        counts = before.counts or between_us <= COUNTS_US or not self._is_silent(before, now_us)
        times = (*before.between_us[1 - _TIMES :], between_us) if counts else ()
        return _Charge(values, now_us, counts, between_us=times, now_and_then=not counts)

    def awaited(self, now_us: int) -> int | None:
        """The number of a battery that was reported once, so that it is unknown whether it counts."""
        for (number, flying), each in self._charges.items():
            if not flying or each.counts or each.now_and_then:
                continue
            if not self._is_silent(each, now_us) or (not self.armed and now_us - each.at_us <= COUNTS_US):
                return number
        return None

    def _are_known(self, now_us: int) -> bool:
        """Whether it is known of each battery whether it counts; once known, it stays known while armed."""
        known = (self.armed and self._known) or self.awaited(now_us) is None
        self._known = self._known or known
        return known

    def _is_silent(self, battery: _Charge, now_us: int) -> bool:
        most_us = max(self._stale_us, min(_SELDOM * battery.usual_us, COUNTS_US))
        return now_us - battery.at_us > most_us and battery.since >= _AMONG

    def _tell(self, number: int, function: int, remaining: int) -> None:
        new = number not in self.told
        self.told[number] = function, remaining
        if new and len(self.told) > 1:
            self.notes.append(f"the vehicle has {len(self.told)} batteries: {self.summary}")

    @property
    def summary(self) -> str:
        """The batteries and which of them count, in words."""
        flying = [number for number, (function, _) in sorted(self.told.items()) if self.flies(function)]
        words = [
            f"{number} with {'an unknown charge' if charge < 0 else f'{charge} %'}" + ("" if self.flies(function) else
            f" ({_FEEDS[function]}, which does not count)")
            for number, (function, charge) in sorted(self.told.items())
        ]  # fmt: skip
        counts = ", and the one with the least charge counts" if len(flying) > 1 else ""
        return ", ".join(words) + counts


def _least(batteries: "Sequence[_Charge]", slot: int) -> int | None:
    """The least of several charges; None where one is not known."""
    known = [each.values[slot] for each in batteries]
    return None if None in known else min(known)  # type: ignore[type-var]


_FEEDS: Final = {MAV_BATTERY_FUNCTION_AVIONICS: "avionics", MAV_BATTERY_FUNCTION_PAYLOAD: "payload"}


def _is_charge(source: SignalSource) -> bool:
    """Whether a signal is the charge of any battery, not of a selected one."""
    return source.fields == _CHARGE and not source.where


def _battery_stale_us(policy: Policy) -> int:
    """The time to stale of the charge; the shortest, where several signals read it."""
    every = [
        signal.stale_us for signal in policy.signals for source in signal.sources
        if source.message == BATTERY and _is_charge(source)
    ]  # fmt: skip
    return min(every, default=0)


def _instance(message: Any) -> int | None:
    """The instance of a sensor that a message is about; None for messages without instances."""
    field = message.instance_field
    return None if field is None else getattr(message, field)


def _is_selected(where: Where, message: Any) -> bool:
    """Whether a message is about the selected sensor."""
    return all(getattr(message, name) == value for name, value in where)


def _check(signal: Signal, source: SignalSource) -> None:
    message = dialect.load().messages.get(source.message)
    for name in (*source.fields, *(name for name, _ in source.where)):
        field = None if message is None else message.fields.get(name)
        if field is None or field.length or field.type == "char":
            raise UnknownSource(
                f"the policy reads `{signal.name}` from `{source.message}.{name}`, which is not a number that a "
                "vehicle reports"
            )


class _Carried(NamedTuple):
    """How a message carries a signal: the fields it rests on, its slots, their reader, and the sensor selection."""

    fields: tuple[str, ...]
    slots: tuple[int, ...]
    read: Callable[[Any], Sequence[tuple[int, int | None]]]
    where: Where
    is_charge: bool


def _carried(signal: Signal, source: SignalSource, projection: Projection) -> _Carried:
    """Prepare the reader once: it is called for each message."""
    first, *more = [_field(source, field) for field in source.fields]
    slot, where, charge = signal.slot, source.where, source.message == BATTERY and _is_charge(source)
    if signal.kind == POSITION:
        return _Carried(source.fields, (slot, slot + 1), _place(slot, first, more[0], projection), where, charge)
    return _Carried(source.fields, (slot,), _number(slot, first, *more), where, charge)


def _number(slot: int, first: _Read, second: _Read | None = None) -> Callable[[Any], Sequence[tuple[int, int | None]]]:
    """A number, or the length of a vector."""
    if second is None:
        return lambda message: ((slot, first(message)),)

    def length(message: Any) -> Sequence[tuple[int, int | None]]:
        a, b = first(message), second(message)
        return ((slot, None if a is None or b is None else hypot_mm(a, b)),)

    return length


def _place(
    slot: int, latitude_of: _Read, longitude_of: _Read, projection: Projection
) -> Callable[[Any], Sequence[tuple[int, int | None]]]:
    nowhere = (slot, None), (slot + 1, None)

    def place(message: Any) -> Sequence[tuple[int, int | None]]:
        latitude, longitude = latitude_of(message), longitude_of(message)
        if latitude is None or longitude is None:
            return nowhere
        x, y = project(projection, latitude, longitude)
        # beyond any zone that can be declared, or not on the globe
        if max(abs(x), abs(y)) > MAX_COORDINATE or abs(longitude) > HALF_TURN:
            return nowhere
        return (slot, x), (slot + 1, y)

    return place


def _field(source: SignalSource, field: str) -> _Read:
    value_of = attrgetter(field)
    numerator, denominator, unknown = source.numerator, source.denominator, source.unknown

    def read(message: Any) -> int | None:
        raw = value_of(message)
        if denominator == 1 and type(raw) is int:  # nothing to round
            value = None if raw in unknown else raw * numerator
        elif isinstance(raw, _NUMBERS):
            value = quantise(raw, numerator, denominator, unknown)
        else:
            return None
        return None if value is None or abs(value) > MAX_VALUE else value

    return read
