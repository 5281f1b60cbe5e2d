"""Runs both boundaries at once: every call is made to the one in Python and to the one in C, and both must answer the
same.
"""

import ctypes
from collections import deque
from collections.abc import Callable, Mapping
from itertools import product
from types import MappingProxyType
from typing import Any, ClassVar

from msgspec.structs import replace as with_fields

from rtshcua.adapters.vehicle import messages
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement import load as loading
from rtshcua.onboard.enforcement.executor import UNSENT
from rtshcua.onboard.enforcement.frames import OURS
from rtshcua.onboard.enforcement.isolated import (
    Caller,
    IsolatedBoundary,
    IsolatedExecutor,
    IsolatedGate,
    IsolatedIssuer,
)
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.enforcement.preparation import Owed
from rtshcua.onboard.ports import BoundaryKey, Command
from rtshcua.wire.keys import Duty
from rtshcua.wire.permit import SIZE
from rtshcua.wire.preparation import MOST, Preparation
from rtshcua.wire.receipt import Receipt
from rtshcua.wire.receipt import decode as read_receipt
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.trust import TrustRoot
from rtshcua.wire.untrusted import Untrusted
from virtual import case

#: the key with which the boundary in C signs its own evidence
OWN_KEY = case.BOUNDARY_KEY.private.private_bytes_raw()
#: the key for logs
LOG_KEY = case.KEYS[Duty.LOG].private.private_bytes_raw()

#: frames that fly links, on either autopilot
LINKS = [
    Codec(1, OURS).pack(message)
    for message in (
        *(messages.set_mode(1, mode) for mode in (Px4Mode.RETURN, Px4Mode.LAND)), messages.stop_here(1),
        *(messages.set_mode(1, mode) for mode in (CopterMode.RTL, CopterMode.LAND, CopterMode.BRAKE)),
    )
]  # fmt: skip


class Differs(AssertionError):
    """The answers of the two boundaries differ."""


def same(what: str, one: Any, other: Any) -> None:
    """Raises `Differs`."""
    if one != other:
        raise Differs(f"{what}: {one!r} in Python, {other!r} in C")


def _none() -> int:
    return -1


def library(boundary: ctypes.CDLL, own_us: Callable[[], int] = _none) -> Callable[[bytes], bytes]:
    """The boundary in C, called in this process; it uses the caller's time, or a monotonic clock of its own."""
    out = ctypes.create_string_buffer(2_048)

    def call(octets: bytes) -> bytes:
        size = boundary.rt_test_boundary_call(octets, len(octets), ctypes.c_int64(own_us()), out)
        return out.raw[:size]

    return call


def begin(
    boundary: ctypes.CDLL, signed_root: bytes, pin: bytes, vehicle: str, session_key: bytes, now: Now,
    settings: Mapping[str, int] = MappingProxyType({}), owed: Mapping[str, Owed] = MappingProxyType({}),
    link_key: bytes | None = None, stated_us: int = -1, own_us: Callable[[], int] = _none,
) -> Caller:  # fmt: skip
    """A new boundary in C, without opened missions."""
    boundary.rt_test_boundary_begin.restype = ctypes.c_char_p
    boundary.rt_test_boundary_forget()
    name = vehicle.encode()
    refused = boundary.rt_test_boundary_begin(
        signed_root, len(signed_root), pin, len(pin), name, len(name), session_key, link_key, OWN_KEY, LOG_KEY,
        listed({name: Owed(0, value) for name, value in settings.items()}), listed(owed),
        (ctypes.c_int64 * 3)(now.monotonic_us, now.utc_us, now.utc_error_us), ctypes.c_int64(stated_us),
    )  # fmt: skip
    same("the trust root", None, refused)
    return Caller(library(boundary, own_us), signs=link_key is not None)


class _Write(ctypes.Structure):
    _fields_: ClassVar = [("name", ctypes.c_char * 16), ("before", ctypes.c_uint32), ("value", ctypes.c_uint32)]


class _Preparation(ctypes.Structure):
    """`rt_preparation`."""

    _fields_: ClassVar = [
        ("serial", ctypes.c_uint64), ("restoring", ctypes.c_bool), ("not_after_us", ctypes.c_int64),
        ("writes", _Write * MOST), ("count", ctypes.c_uint32),
    ]  # fmt: skip


def listed(parameters: Mapping[str, Owed]) -> Any:
    """Parameters in the form in which the boundary in C receives them at its start."""
    made = _Preparation(count=len(parameters))
    for at, (name, each) in enumerate(parameters.items()):
        made.writes[at] = _Write(name.encode(), each.before, each.value)
    return ctypes.byref(made)


class BothIssuers:
    """`PreparationIssuer`."""

    def __init__(self, here: Any, there: IsolatedIssuer, counts: dict[str, int]) -> None:
        self._here, self._there, self._counts = here, there, counts
        self.settings = here.settings

    def permit(self, ask: bytes, now_us: int) -> bytes | Refusal:
        one: bytes | Refusal = self._here.permit(ask, now_us)
        same(f"permit {ask.hex()}", one, self._there.permit(ask, now_us))
        self._counts["preparations"] += not isinstance(one, Refusal)
        return one


class BothAttestations:
    """`Attestation`: the two sign the same."""

    def __init__(self, here: Any, there: Any) -> None:
        self._here, self._there = here, there

    @property
    def digest(self) -> bytes:
        one: bytes = self._here.digest
        same("the digest", one, self._there.digest)
        return one

    def begin(self, key: BoundaryKey | None) -> None:
        self._here.begin(key)
        self._there.begin(key)

    def statement(self, now: Now, *, final: bool = False) -> bytes | None:
        one: bytes | None = self._here.statement(now, final=final)
        same("a statement", one, self._there.statement(now, final=final))
        return one


class BothBoundaries:
    """`SoftwareBoundary`."""

    lost = None

    def __init__(self, here: Any, there: IsolatedBoundary, counts: dict[str, int]) -> None:
        self._here, self._there, self._counts = here, there, counts

    def enforce(self, request: bytes) -> bytes:
        one: bytes = self._here.enforce(request)
        same(f"enforce {request.hex()}", one, self._there.enforce(request))
        self._counts["requests"] += 1
        return one

    def consider(self, document: bytes, now: Now) -> Untrusted | None:
        return self._here.consider(document, now)

    def present(self, document: bytes, now: Now, released: int) -> bytes:
        one: bytes = self._here.present(document, now, released)
        here, there = read_receipt(one), read_receipt(self._there.present(document, now, released))
        assert isinstance(here, Receipt)
        assert isinstance(there, Receipt)
        same(f"present {document.hex()}", with_fields(here, text=there.text), there)
        self._counts["documents"] += 1
        return one


class BothGates:
    """`frames.Gate`; Python answers all other calls."""

    def __init__(self, here: Any, there: IsolatedGate, counts: dict[str, int]) -> None:
        self._here, self._there, self._counts = here, there, counts
        #: frames that were to leave
        self.lately: deque[bytes] = deque(maxlen=8)

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        self._here.observe(frame, now_us)
        self._there.observe(frame, now_us)

    def seal(self, frame: bytes, now_us: int) -> bytes | Refusal:
        one: bytes | Refusal = self._here.seal(frame, now_us)
        same(f"seal {frame.hex()}", one, self._there.seal(frame, now_us))
        self._counts["refused frames" if isinstance(one, Refusal) else "frames"] += 1
        self.lately.append(frame)
        return one

    def stands(self, now_us: int) -> bool:
        one: bool = self._here.stands(now_us)
        same("stands", one, self._there.stands(now_us))
        return one

    def __getattr__(self, name: str) -> Any:
        return getattr(self._here, name)


class BothExecutors:
    """`Executor`."""

    def __init__(self, here: Any, there: IsolatedExecutor, counts: dict[str, int]) -> None:
        self._here, self._there, self._counts = here, there, counts
        self.frames: Any = BothGates(here.frames, there.frames, counts)
        self._sealed = bytes(SIZE)  # the last received permit, and its time
        self._now_us = 0

    def _both(self, what: str, one: Command | Refusal, other: Command | Refusal) -> Command | Refusal:
        same(what, one, other)
        self._counts["refused permits" if isinstance(one, Refusal) else "dispatches"] += 1
        self._look_ahead()
        return one

    def _look_ahead(self) -> None:
        """Check that both sign the same frames ahead for each link, under the last permit."""
        for kind, link in product((STEP, FALLBACK_LINK, CONTINGENCY_LINK), range(-1, 4)):
            for frames in ((), LINKS[:2], *([frame] for frame in (*LINKS, *self.frames.lately))):
                one = self._here.ahead(self._sealed, kind, link, frames, self._now_us)
                same(f"ahead {kind} {link}", one, self._there.ahead(self._sealed, kind, link, frames, self._now_us))
                self._counts["ahead"] += not isinstance(one, Refusal) and bool(frames)

    def dispatch(self, sealed: bytes, now_us: int) -> Command | Refusal:
        self._now_us = now_us
        if len(sealed) == SIZE:  # the call has no way to say how long one is
            self._sealed = sealed
        return self._both("dispatch", self._here.dispatch(sealed, now_us), self._there.dispatch(sealed, now_us))

    def stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        there = self._there.stand_in(sealed, kind, link, now_us)
        return self._both("stand_in", self._here.stand_in(sealed, kind, link, now_us), there)

    def withdraw(self, sealed: bytes, now_us: int) -> Refusal:
        one: Refusal = self._here.withdraw(sealed, now_us)
        same("withdraw", one, self._there.withdraw(sealed, now_us))
        self._counts["withdrawn"] += one is UNSENT
        self._look_ahead()
        return one

    def prepare(self, sealed: bytes, now_us: int) -> Preparation | Refusal:
        one: Preparation | Refusal = self._here.prepare(sealed, now_us)
        same(f"prepare {sealed.hex()}", one, self._there.prepare(sealed, now_us))
        return one

    def __getattr__(self, name: str) -> Any:
        def both(*arguments: Any) -> Any:
            getattr(self._there, name)(*arguments)
            answer = getattr(self._here, name)(*arguments)
            self._look_ahead()
            return answer

        return both


class Shadow:
    """Replaces the boundary in Python by both, wherever `load` is called with a known root."""

    def __init__(self, boundary: ctypes.CDLL) -> None:
        self._library = boundary
        self.roots: dict[TrustRoot, tuple[bytes, bytes]] = {}  # the signed root, and its pinned key
        self.counts = dict.fromkeys(
            (
                "requests",
                "documents",
                "frames",
                "refused frames",
                "dispatches",
                "refused permits",
                "preparations",
                "ahead",
                "withdrawn",
            ),
            0,
        )

    def know(self, root: TrustRoot, signed: bytes, pin: bytes) -> None:
        """A root that flights are loaded under."""
        self.roots[root] = signed, pin

    def load(self, bundle: bytes, **given: Any) -> Loaded | Refusal:
        """`load`, of both."""
        signed, pin = self.roots[given["root"]]
        caller = begin(self._library, signed, pin, given["vehicle"], given["session_key"], given["now"],
                       given.get("settings", {}), given.get("owed", {}))  # fmt: skip
        there = loading.load(bundle, **{**given, "mode": EnforcementMode.PROCESS, "caller": caller})
        flight = given["flight"] if isinstance(there, Refusal) else there.in_force.flight
        here = loading.load(bundle, **{**given, "flight": flight})
        if isinstance(here, Refusal) or isinstance(there, Refusal):
            slugs = [each.slug if isinstance(each, Refusal) else "loaded" for each in (here, there)]
            same("load", *slugs)
            return here
        assert isinstance(there.boundary, IsolatedBoundary)
        assert isinstance(there.executor, IsolatedExecutor)
        assert isinstance(there.preparation, IsolatedIssuer)
        boundary: Any = BothBoundaries(here.boundary, there.boundary, self.counts)
        executor: Any = BothExecutors(here.executor, there.executor, self.counts)
        attestation: Any = BothAttestations(here.attestation, there.attestation)
        issuer: Any = BothIssuers(here.preparation, there.preparation, self.counts)
        return with_fields(here, boundary=boundary, executor=executor, attestation=attestation, preparation=issuer)
