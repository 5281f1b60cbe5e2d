"""A world as bytes, to restore it, and to compare two worlds except for unread state.

Both follow whatever attributes the real objects have. What never changes (policy, mission, compiled conditions) is kept
by reference. What is only written (evidence, what a display shows), and what is not read before it is set anew, is left
out of the comparison; times become ages, and ages beyond `OLD` are all alike, because nothing compares them with more;
serial numbers of permits become what can still be done with them. `docs/model-checking.md` has the reasons.
"""

import io
import marshal
import pickle
from collections import deque
from collections.abc import Callable, Iterable
from enum import Enum
from hashlib import blake2b
from types import BuiltinFunctionType, FunctionType, MethodType
from typing import Any

from msgspec import Struct

from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.boundary import PermitIssuer, SoftwareBoundary
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.runtime.admission import Admission, InvocationQueue
from rtshcua.onboard.runtime.controller import MissionController
from rtshcua.onboard.runtime.fallback_flight import Fallback
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.monitor import StateMonitor, VehicleStatus
from rtshcua.onboard.runtime.runtime import EventHandler
from rtshcua.onboard.runtime.view import Decided, RunStage
from rtshcua.wire.boundary_chain import BoundaryChain
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.permit import AGAIN, SIZE, open_permit
from rtshcua.wire.trust import TrustRoot

#: the start of monotonic and UTC time, in us: distinct from every other number
BEGIN_US = 1 << 52
_REACH = 1 << 40
_TIMES = 1 << 50
#: the first serial number of permits: distinct from every other number too
SERIALS = 1 << 46

#: the modules with the classes of a bundle's contents; requests and answers (`situation`) are not among them
_FIXED = ("rtshcua.model.flat.", "rtshcua.wire.bundle", "rtshcua.wire.trust")
_ONCE = (PreparedInvocation, PreparedPolicy, Recorder, Limits, Enum, type, FunctionType, BuiltinFunctionType)
#: attributes that only affect records; the time of the last request, which is only compared to detect time going back;
#: and caches
_ONLY_WRITTEN: dict[type, tuple[str, ...]] = {
    Admission: ("_last", "_repeated", "recent"),
    EventHandler: ("_gap", "_refused_us", "_unrecorded"),
    SoftwareBoundary: ("_now_us", "_last"),
    BoundaryChain: (
        "_marks",
        "ahead",
        "aside",
        "count",
        "declined",
        "digest",
        "frames",
        "left",
        "repeated",
        "stopped",
    ),
    StateMonitor: ("_state", "_held"),
}
#: attributes that are only read in these stages, and set when a run enters them
_READ_IN: dict[tuple[type, str], tuple[RunStage, ...]] = {
    (MissionController, "_began_us"): (RunStage.WAITING,),
    (MissionController, "retry"): (RunStage.DECIDING,),
    (MissionController, "_supervisor"): (RunStage.RUNNING,),
    (VehicleStatus, "ready"): (RunStage.WAITING,),
    (InvocationQueue, "released_us"): (RunStage.DECIDING,),
    (Fallback, "_chain"): (RunStage.FALLING,),
}


_PLAIN = frozenset((str, bool, type(None)))
#: objects that are constant during a search
_ALWAYS = frozenset((PreparedPolicy, Policy, TrustRoot, Limits))


def _unread(stage: RunStage, late: bool) -> dict[type, tuple[str, ...]]:
    """The attributes that are not read in a stage, by class. A `late` step keeps its release while it runs."""
    unread = dict(_ONLY_WRITTEN)
    for (kind, name), stages in _READ_IN.items():
        counts_on = late and kind is InvocationQueue and stage is RunStage.RUNNING
        if stage not in stages and not counts_on:
            unread[kind] = (*unread.get(kind, ()), name)
    return unread


_UNREAD = {(stage, late): _unread(stage, late) for stage in RunStage for late in (False, True)}


def fixed(kind: type) -> bool:
    """Whether objects of this class are immutable and made once."""
    if issubclass(kind, _ONCE):
        return True
    frozen = issubclass(kind, Struct) and kind.__struct_config__.frozen
    return frozen and kind.__module__.startswith(_FIXED) and not kind.__module__.endswith(".situation")


class Snapshots:
    """Takes and restores worlds. `unwatched`: types of objects that are shared and not compared. `late`: a step that
    runs may be waited for again.
    """

    def __init__(
        self, key: bytes, utc_us: int, old_us: int, unwatched: tuple[type, ...] = (), *, late: bool = False
    ) -> None:
        self._shared: dict[int, Any] = {}
        self._keeps: dict[type, bool] = {}
        self._unwatched = unwatched
        self._compare = _Comparison(key, utc_us, old_us, unwatched, self._reference, late=late)

    def take(self, world: object) -> bytes:
        """Return the world in a form that can be restored any number of times."""
        buffer = io.BytesIO()
        pickler = pickle.Pickler(buffer, protocol=5)
        pickler.persistent_id = self._reference  # type: ignore[method-assign]
        pickler.dump(world)
        return buffer.getvalue()

    def restore(self, data: bytes) -> Any:
        """Return an independent copy of the world."""
        unpickler = pickle.Unpickler(io.BytesIO(data))
        unpickler.persistent_load = self._shared.__getitem__  # type: ignore[method-assign]
        return unpickler.load()

    def canonical(self, world: object, now_us: int, stage: RunStage, standing: bytes | None) -> bytes:
        """A digest that is equal for worlds which differ only in unread state and absolute time.

        `stage` is the stage of the run, and `standing` the stored permit.
        """
        return blake2b(marshal.dumps(self.plain(world, now_us, stage, standing), 2), digest_size=16).digest()

    def plain(self, world: object, now_us: int, stage: RunStage, standing: bytes | None) -> Any:
        """Return the compared state as tuples."""
        return self._compare.plain(world, now_us, stage, standing)

    def _reference(self, thing: Any) -> int | None:
        kind = type(thing)
        keeps = self._keeps.get(kind)
        if keeps is None:
            keeps = self._keeps[kind] = fixed(kind) or issubclass(kind, self._unwatched)
        if not keeps:
            return None
        self._shared.setdefault(id(thing), thing)
        return id(thing)


Rule = Callable[[Any], Any]


class _Comparison:
    """Makes plain tuples of a world, by one cached rule for each class."""

    def __init__(
        self, key: bytes, utc_us: int, old_us: int, unwatched: tuple[type, ...], refer: Callable[[Any], int | None],
        *, late: bool,
    ) -> None:  # fmt: skip
        self._late = late
        self._key = key
        self._utc_us = utc_us
        self._old_us = old_us
        self._unwatched = unwatched
        self._refer = refer
        self._rules: dict[type, Rule] = {int: self._number, bytes: self._octets}
        for kind in _PLAIN:
            self._rules[kind] = _itself
        self._now_us = 0
        self._unread: dict[type, tuple[str, ...]] = {}
        self._stands = range(0)
        self._seen: dict[int, int] = {}
        self._alike: dict[int, int] = {}
        self._values: dict[Any, int] = {}

    def plain(self, world: object, now_us: int, stage: RunStage, standing: bytes | None) -> Any:
        self._now_us = now_us
        self._unread = _UNREAD[stage, self._late]
        permit = None if standing is None else open_permit(standing, self._key)
        self._stands = range(0)
        if permit is not None:
            self._stands = range(permit.serial, permit.serial + 1 + permit.fallbacks + permit.contingencies + AGAIN)
        self._seen = {}
        return self._of(world)

    def _of(self, thing: Any) -> Any:
        kind = type(thing)
        rule = self._rules.get(kind)
        if rule is None:
            rule = self._rules[kind] = self._rule(kind)
        return rule(thing)

    def _rule(self, kind: type) -> Rule:
        name = kind.__qualname__
        if issubclass(kind, (Recorder, Decided, *self._unwatched)):
            return lambda thing: "unwatched"
        if issubclass(kind, Bundle):
            return lambda thing: ("bundle", thing.mission_digest)
        if issubclass(kind, PreparedInvocation):
            return lambda thing: ("invocation", thing.invocation.binding)
        if issubclass(kind, Invocation):
            return lambda thing: ("invocation", thing.binding)
        if issubclass(kind, (PermitIssuer, FrameSession)):
            return lambda thing: name  # the next serial is unused; no frame is sent in a search
        if issubclass(kind, type):
            return lambda thing: ("type", thing.__qualname__)
        if issubclass(kind, Enum):
            return lambda thing: (name, thing.name)
        if fixed(kind):
            return self._shared
        if issubclass(kind, (set, frozenset)):
            return self._members
        if issubclass(kind, dict):
            return lambda thing: tuple([(self._of(key), self._of(value)) for key, value in thing.items()])
        if issubclass(kind, (tuple, list, deque)):
            return self._row
        if issubclass(kind, int):
            return self._number
        if issubclass(kind, MethodType):
            return lambda thing: (thing.__name__, self._of(thing.__self__))
        return self._attributes(kind, name)

    def _attributes(self, kind: type, name: str) -> Rule:
        if issubclass(kind, Struct):
            names: tuple[str, ...] = kind.__struct_fields__
            if kind.__struct_config__.frozen:
                return lambda thing: (name, *[self._of(getattr(thing, each)) for each in names])
        elif hasattr(kind, "__slots__"):
            names = tuple(kind.__slots__)
        else:
            return lambda thing: self._once(thing) or (name, *self._named(kind, thing.__dict__.items()))
        return lambda thing: self._once(thing) or (
            name, *self._named(kind, [(each, getattr(thing, each)) for each in names])
        )  # fmt: skip

    def _named(self, kind: type, attributes: Iterable[tuple[str, Any]]) -> list[Any]:
        unread, rules = self._unread.get(kind, ()), self._rules
        found: list[Any] = []
        for name, value in attributes:
            if name in unread:
                continue
            of = type(value)
            if of in _PLAIN:
                found.append((name, value))
            elif of not in _ALWAYS:
                rule = rules.get(of)
                found.append((name, rule(value) if rule is not None else self._of(value)))
        return found

    def _once(self, thing: Any) -> tuple[str, int] | None:
        """Describe a mutable object where it first occurs."""
        seen = self._seen
        number = seen.get(id(thing))
        if number is not None:
            return "seen", number
        seen[id(thing)] = len(seen)
        return None

    def _row(self, thing: Any) -> Any:
        rules = self._rules
        return tuple([rules[type(each)](each) if type(each) in rules else self._of(each) for each in thing])

    def _shared(self, thing: Any) -> Any:
        """Describe an immutable object by its value: a replacement that is opened twice is equal."""
        number = self._alike.get(id(thing))
        if number is None:
            self._refer(thing)  # and it stays where it is
            number = self._alike[id(thing)] = self._values.setdefault(thing, len(self._values))
        return "shared", number

    def _members(self, thing: Any) -> Any:
        """Describe a set; of serials, those that can still be used."""
        stands = self._stands
        return tuple(sorted([self._of(each) for each in thing if not _is_serial(each) or each in stands]))

    def _number(self, number: int) -> Any:
        if number < SERIALS:
            return number
        if number < _TIMES:
            return self._serial(number) if _is_serial(number) else number
        for zero_us, now_us in ((BEGIN_US, self._now_us), (self._utc_us, self._utc_us + self._now_us - BEGIN_US)):
            if abs(number - zero_us) < _REACH:
                return "t", min(max(now_us - number, -self._old_us), self._old_us)
        return number

    def _serial(self, number: int) -> Any:
        """Describe a serial by its distance from the standing permit; older ones are distinguished by their holders."""
        if number in self._stands:
            return "s", number - self._stands.start
        return ("s", "newer") if number > self._stands.start else ("s", "older")

    def _octets(self, octets: bytes) -> Any:
        permit = open_permit(octets, self._key) if len(octets) == SIZE else None
        if permit is None:
            return octets
        # It is only kept for its links: the validity for its own step does not count any more.
        serial = self._number(permit.serial)
        return "p", permit.kind, permit.step, permit.link, serial, permit.fallbacks, permit.contingencies


def _itself(thing: Any) -> Any:
    return thing


def _is_serial(number: Any) -> bool:
    return type(number) is int and SERIALS <= number < SERIALS + _REACH
