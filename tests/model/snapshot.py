"""A world as bytes: to go back to it, and to tell whether two are the same but for the time at which they are.

Both follow whatever attributes the real objects have; nothing here knows the names of any. What never changes (policy,
mission, compiled conditions) is kept by reference. What is only written (evidence, what a display shows) is left out of
the comparison, times become ages, and ages beyond `OLD` are all alike, because nothing compares them with more.
"""

import io
import pickle
from collections.abc import Callable
from enum import Enum
from hashlib import blake2b
from types import BuiltinFunctionType, FunctionType
from typing import Any

from msgspec import Struct

from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.evidence.chain import Recorder
from rtshcua.model.flat.mission import Invocation
from rtshcua.onboard.runtime.flight import Limits
from rtshcua.onboard.runtime.view import Decided
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.permit import SIZE, open_permit

#: where monotonic and UTC time begin, in us: far from every other number, and from each other
BEGIN_US = 1 << 52
_REACH = 1 << 40
_TIMES = 1 << 50

#: where the classes of what a bundle says are; what is asked and answered (`situation`) is not among them
_FIXED = ("rtshcua.model.flat.", "rtshcua.wire.bundle", "rtshcua.wire.trust")
_ONCE = (PreparedInvocation, PreparedPolicy, Recorder, Limits, Enum, type, FunctionType, BuiltinFunctionType)


def fixed(kind: type) -> bool:
    """Whether objects of this class never change, and are made once."""
    if issubclass(kind, _ONCE):
        return True
    frozen = issubclass(kind, Struct) and kind.__struct_config__.frozen
    return frozen and kind.__module__.startswith(_FIXED) and not kind.__module__.endswith(".situation")


class Snapshots:
    """Takes and restores worlds. `unwatched`: types of objects that are shared and not compared."""

    def __init__(self, key: bytes, utc_us: int, old_us: int, unwatched: tuple[type, ...] = ()) -> None:
        self._key = key
        self._utc_us = utc_us
        self._old_us = old_us
        self._shared: dict[int, Any] = {}
        self._keeps: dict[type, bool] = {}
        self._unwatched = unwatched
        self._rules: dict[type, Callable[[Any], object] | None] = {}
        self._values: dict[object, int] = {}
        self._now_us = 0

    def take(self, world: object) -> bytes:
        """The world, to be restored as often as wanted."""
        return _dumps(world, self._reference)

    def restore(self, data: bytes) -> Any:
        """A world of its own."""
        unpickler = pickle.Unpickler(io.BytesIO(data))
        unpickler.persistent_load = self._shared.__getitem__  # type: ignore[method-assign]
        return unpickler.load()

    def canonical(self, world: object, now_us: int) -> bytes:
        """A digest that worlds share which differ only in what nothing reads, and in what time it is."""
        self._now_us = now_us
        return blake2b(_dumps(world, self._ageless), digest_size=16).digest()

    # ------------------------------------------------------------------------------------------ by reference

    def _reference(self, thing: Any) -> int | None:
        kind = type(thing)
        keeps = self._keeps.get(kind)
        if keeps is None:
            keeps = self._keeps[kind] = fixed(kind) or issubclass(kind, self._unwatched)
        if not keeps:
            return None
        self._shared.setdefault(id(thing), thing)
        return id(thing)

    # ------------------------------------------------------------------------------------------ for comparing

    def _ageless(self, thing: Any) -> object:
        kind = type(thing)
        try:
            if kind is str:  # nearly half of all
                return self._values[thing]
            rule = self._rules[kind]
        except KeyError:
            rule = self._rules[kind] = self._rule(kind)
        return None if rule is None else rule(thing)

    def _rule(self, kind: type) -> Callable[[Any], object] | None:
        if kind is int:
            return self._number
        if kind is bytes:
            return self._octets
        if kind is str:
            return self._alike
        if issubclass(kind, (Recorder, Decided, *self._unwatched)):
            return lambda thing: "unwatched"
        if issubclass(kind, Bundle):
            return lambda thing: ("bundle", thing.mission_digest)
        if issubclass(kind, PreparedInvocation):
            return lambda thing: ("invocation", thing.invocation.binding)
        if issubclass(kind, Invocation):
            return lambda thing: ("invocation", thing.binding)
        if issubclass(kind, type):
            return lambda thing: ("type", thing.__qualname__)
        if issubclass(kind, Enum):
            return lambda thing: ("member", kind.__name__, thing.name)
        if fixed(kind):
            return lambda thing: ("shared", self._reference(thing))
        return None

    def _alike(self, value: object) -> int:
        """Equal texts are one, whether or not they are one object."""
        return self._values.setdefault(value, len(self._values))

    def _number(self, number: int) -> object:
        if number < _TIMES:
            return None
        for zero_us, now_us in ((BEGIN_US, self._now_us), (self._utc_us, self._utc_us + self._now_us - BEGIN_US)):
            if abs(number - zero_us) < _REACH:
                return "t", min(max(now_us - number, -self._old_us), self._old_us)
        return None

    def _octets(self, octets: bytes) -> object:
        permit = open_permit(octets, self._key) if len(octets) == SIZE else None
        if permit is None:
            return self._alike(octets)
        late = self._number(permit.not_after_us)
        return "p", permit.kind, permit.step, permit.link, permit.serial, permit.fallbacks, permit.contingencies, late


def _dumps(world: object, persistent: Callable[[Any], object]) -> bytes:
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer, protocol=5)
    pickler.persistent_id = persistent  # type: ignore[method-assign]
    pickler.dump(world)
    return buffer.getvalue()
