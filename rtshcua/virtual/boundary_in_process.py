"""An in-process stand-in for the boundary process, in virtual time, which can die like a process.

It replaces `boundary/home/process` and answers the calls of `boundary/enforcement/calls.h` with the boundary in
Python. It has neither the link's key nor the log's: it signs no frame and begins no log (LOG is `malformed`).
"""

from collections.abc import Mapping
from struct import Struct
from struct import error as struct_error
from types import MappingProxyType
from typing import Final

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import UTC_UNKNOWN_US, Now
from rtshcua.onboard.enforcement import isolated as calls
from rtshcua.onboard.enforcement.executor import UNSENT, Executor
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.load import SESSION_KEY_BYTES, EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import Owed
from rtshcua.onboard.ports import BoundaryKey, Command
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.permit import SIZE, open_permit
from rtshcua.wire.request import FALLBACK_LINK
from rtshcua.wire.trust import TrustRoot

_FINE, _REFUSED = b"\0", b"\1"
_NONE: Final = b""
_SESSION: Final = bytes(SESSION_KEY_BYTES)  # permits need no protection in virtual time
_MALFORMED: Final = Refusal("malformed", "malformed call")
_NOT_LOADED: Final = Refusal("not-loaded", "no bundle is in force")
_TIME, _PART, _LOADED, _SHOWN = Struct(">q"), Struct(">BI"), Struct(">qqqI"), Struct(">qqqII")
_STANDING, _PERMITTED, _BEGIN, _TOKEN = Struct(">qBb"), Struct(">BhhQq"), Struct(">Q32s"), Struct(">Q")
_FRAME: Final = Struct(">H")
_STATED, _TOLD = Struct(">?qqq"), Struct(">BqqqQ")


class Served:
    """A boundary as a callable that answers encoded calls (`isolated.Call`), until it is `dead`.

    It opens bundles for the vehicle `vehicle` under a trust root; `key` signs its own evidence.
    """

    def __init__(
        self, root: TrustRoot, vehicle: str, key: SigningKey | None = None,
        settings: Mapping[str, int] = MappingProxyType({}), owed: Mapping[str, Owed] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        self._root, self._vehicle, self._key = root, vehicle, key
        self._settings, self._owed = dict(settings), dict(owed)
        self._staged = {calls.LOAD: b"", calls.PRESENT: b""}
        self._loaded: Loaded | None = None
        #: the gate of outbound frames, independent of the bundle
        self.gate = FrameSession()
        self.dead = False

    def __call__(self, octets: bytes) -> bytes:
        """Answer one call. Raise ConnectionResetError once it is dead."""
        if self.dead:
            raise ConnectionResetError
        try:
            answer = self._answer(octets[0], octets[1:]) if octets else _MALFORMED
        except struct_error:
            answer = _MALFORMED
        return _REFUSED + answer.slug.encode() if isinstance(answer, Refusal) else _FINE + answer

    def _answer(self, kind: int, rest: bytes) -> bytes | Refusal:
        match kind:
            case calls.PART:
                return self._stage(rest)
            case calls.LOAD:
                return self._open(rest)
            case calls.OBSERVE:
                self.gate.observe(rest[_TIME.size :], *_TIME.unpack_from(rest))
                return bytes(1)
            case calls.SEAL:
                return self.gate.seal(rest[_TIME.size :], *_TIME.unpack_from(rest))
            case calls.TIME:  # it has no clock of its own
                return _TOLD.pack(ClockSource.SHARED, 0, 0, UTC_UNKNOWN_US, 0)
            case calls.FLIGHT:
                return bytes(FLIGHT_BYTES)
            case calls.STANDS:
                return bytes([self.gate.stands(*_TIME.unpack(rest))])
        return _NOT_LOADED if self._loaded is None else self._answer_of(self._loaded, kind, rest)

    def _answer_of(self, loaded: Loaded, kind: int, rest: bytes) -> bytes | Refusal:
        """Answer a call about the bundle in force."""
        match kind:
            case calls.ENFORCE:
                return loaded.boundary.enforce(rest)
            case calls.PRESENT:
                *now, released, _ = _SHOWN.unpack(rest)
                return loaded.boundary.present(self._staged[calls.PRESENT], Now(*now), released)
            case calls.PERMIT:
                return loaded.preparation.permit(rest[_TIME.size :], *_TIME.unpack_from(rest))
            case calls.BEGIN:
                if self._key is None:
                    return Refusal("no-boundary-key", "the boundary has no key of its own")
                loaded.attestation.begin(BoundaryKey(self._key, *_BEGIN.unpack(rest)))
                return rest
            case calls.STATEMENT:
                final, *now = _STATED.unpack(rest)
                said = loaded.attestation.statement(Now(*now), final=final)
                return Refusal("no-boundary-key", "the boundary signs no evidence") if said is None else said
            case calls.DIGEST:
                return loaded.attestation.digest
        assert isinstance(loaded.executor, Executor)
        return _executed(loaded.executor, kind, rest)

    def _stage(self, rest: bytes) -> bytes | Refusal:
        """Append a part of a bundle or document; a part at offset 0 starts over."""
        what, at = _PART.unpack_from(rest)
        if what not in self._staged or at not in (0, len(self._staged[what])):
            return _MALFORMED
        self._staged[what] = self._staged[what][:at] + rest[_PART.size :]
        return _NONE

    def _open(self, rest: bytes) -> bytes | Refusal:
        *now, _ = _LOADED.unpack(rest)
        loaded = load(
            self._staged[calls.LOAD], root=self._root, vehicle=self._vehicle, now=Now(*now),
            mode=EnforcementMode.PROCESS,
            session_key=_SESSION, flight=bytes(FLIGHT_BYTES), peer_is_own_simulator=True,
            settings=self._settings, owed=self._owed,
        )  # fmt: skip
        if isinstance(loaded, Refusal):
            return loaded
        assert isinstance(loaded.executor, Executor)
        loaded.executor.frames = self.gate
        self._loaded = loaded
        return loaded.in_force.flight + bytes(1)


def _executed(executor: Executor, kind: int, rest: bytes) -> bytes | Refusal:
    """Answer a call to the executor."""
    match kind:
        case calls.DISPATCH:
            return _dispatch(executor, rest)
        case calls.STAND_IN:
            return _stand_in(executor, rest)
        case calls.AHEAD:
            return _ahead(executor, rest)
        case calls.WITHDRAW:
            refused = executor.withdraw(rest[_TIME.size :], *_TIME.unpack_from(rest))
            return _NONE if refused is UNSENT else refused
        case calls.PREPARE:
            found = executor.prepare(rest[_TIME.size :], *_TIME.unpack_from(rest))
            return found if isinstance(found, Refusal) else _NONE
        case calls.PREPARED:
            executor.prepared()
        case calls.ENDED:
            executor.ended(*(_TOKEN.unpack(rest) if rest else ()))
        case calls.LANDED:
            executor.landed()
        case calls.RELEASE:
            executor.release()
        case _:
            return _MALFORMED
    return _NONE


def _dispatch(executor: Executor, rest: bytes) -> bytes | Refusal:
    sealed = rest[_TIME.size :]
    permit = open_permit(sealed, _SESSION)
    ref = (0, 0, 0) if permit is None else (permit.kind, permit.step, permit.link)
    return _permitted(ref, executor.dispatch(sealed, *_TIME.unpack_from(rest)))


def _stand_in(executor: Executor, rest: bytes) -> bytes | Refusal:
    (now_us, what, link), sealed = _STANDING.unpack_from(rest), rest[_STANDING.size :]
    permit = open_permit(sealed, _SESSION)
    step = -1 if permit is None or what != FALLBACK_LINK else permit.step
    return _permitted((what, step, link), executor.stand_in(sealed, what, link, now_us))


def _permitted(ref: tuple[int, int, int], command: Command | Refusal) -> bytes | Refusal:
    if isinstance(command, Refusal):
        return command
    return _PERMITTED.pack(*ref, command.token, command.not_after_us)


def _ahead(executor: Executor, rest: bytes) -> bytes | Refusal:
    now_us, what, link = _STANDING.unpack_from(rest)
    sealed, at = rest[_STANDING.size : _STANDING.size + SIZE], _STANDING.size + SIZE
    frames: list[bytes] = []
    while at < len(rest):
        (size,) = _FRAME.unpack_from(rest, at)
        frames.append(rest[at + _FRAME.size : at + _FRAME.size + size])
        at += _FRAME.size + size
    found = executor.ahead(sealed, what, link, frames, now_us)
    return found if isinstance(found, Refusal) else _TOKEN.pack(found.token)
