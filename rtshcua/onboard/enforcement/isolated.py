"""A boundary in another process, or in a trusted world, which the runtime calls.

The calls are those of boundary/enforcement/calls.h: one octet for the kind of the call, followed by its data,
big-endian; an answer is 0 and the result, or 1 and a slug. The other end verifies the bundle, holds the keys,
decides, and lets frames pass; errors at this end can move nothing without its permit. This end may therefore use
its own copy of the same bundle for the flight.
"""

from collections.abc import Callable, Mapping, Sequence
from struct import Struct
from struct import error as struct_error
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua.decision.session import MOST_AHEAD, InForce
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS, SIGNATURE
from rtshcua.mavlink.signing import MINUTE, UNIT_US, Counts, Stream, stream_of, timestamp_in
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement import executor, frames, payload_gate, preparation
from rtshcua.onboard.enforcement.ahead import MOST, NOT_AHEAD, Encode, FramesAhead
from rtshcua.onboard.enforcement.allow_list import is_housekeeping, read_frame
from rtshcua.onboard.enforcement.executor import Commands, Made, SignedAhead
from rtshcua.onboard.ports import BoundaryKey, Command
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.document import FLIGHT_BYTES, MAX_DOCUMENT
from rtshcua.wire.preparation import MAC_BYTES, Preparation
from rtshcua.wire.preparation import decode as decode_preparation
from rtshcua.wire.receipt import REPLACEMENT, UNKNOWN, Receipt, decode
from rtshcua.wire.receipt import encode as encode_receipt
from rtshcua.wire.request import STEP
from rtshcua.wire.response import Status, encode_refusal
from rtshcua.wire.untrusted import Untrusted

#: makes one call, and returns its answer
Call = Callable[[bytes], bytes]

(
    PART, LOAD, ENFORCE, PRESENT, DISPATCH, STAND_IN, ENDED, LANDED, RELEASE, OBSERVE, SEAL, BEGIN, STATEMENT, DIGEST,
    PERMIT, PREPARE, PREPARED, STANDS, AHEAD, FLIGHT, LOG, TIME, WITHDRAW, HOME,
) = range(1, 25)  # fmt: skip
#: octets of a bundle or a document in one call
MAX_PART: Final = 60_000

_FINE: Final = 0
_TIME, _NOW = Struct(">q"), Struct(">qqq")
_SIZED, _AT = Struct(">qqqI"), Struct(">BI")
_SHOWN: Final = Struct(">qqqII")
_STANDING: Final = Struct(">qBb")
_PERMITTED: Final = Struct(">BhhQq")
_SERIAL_BYTES: Final = 8
_TOLD: Final = Struct(">BqqqQ")

#: the result of a missing or malformed answer
LOST: Final = Refusal("boundary-lost", "the boundary does not answer, or its answer is malformed")


class OwnTime(NamedTuple):
    """The boundary's own clock: the source of its time of day, and the moment; and the number that it expects from
    the vehicle in TIMESYNC, 0 for none.
    """

    source: ClockSource
    now: Now
    number: int


def _known(*modules: object) -> dict[str, Refusal]:
    found = (each for module in modules for each in vars(module).values() if isinstance(each, Refusal))
    return {refusal.slug: refusal for refusal in found}


#: the reasons of refusals, by slug, with the texts of the boundary in this process
_REFUSALS: Final[Mapping[str, Refusal]] = MappingProxyType(_known(executor, frames, payload_gate, preparation))


class Caller:
    """Calls a boundary. A missing or malformed answer gives `LOST`, as does every later call."""

    def __init__(self, call: Call, *, signs: bool = False, part: int = MAX_PART, most_ahead: int = MOST) -> None:
        """`signs`: it has the link's key. `part`: octets of a bundle or a document that go in one call at most;
        `most_ahead`: frames that one call has signed ahead at most.
        """
        self._call = call
        self._part = part
        self.most_ahead = most_ahead
        self.signs = signs
        #: whether the boundary is lost
        self.lost = False
        #: whether the last loaded mission had been opened before: then no step of it may begin
        self.reopened = False

    def __call__(self, kind: int, *parts: bytes) -> bytes | Refusal:
        """The result of a call, or why it is refused."""
        if self.lost:
            return LOST
        try:
            answer = self._call(bytes([kind]) + b"".join(parts))
        except OSError:
            answer = b""
        if not answer:
            return self.lose()
        if answer[0] == _FINE:
            return answer[1:]
        slug = answer[1:].decode("ascii", "replace")
        return _REFUSALS.get(slug) or Refusal(slug, "the boundary refuses the call")

    def lose(self) -> Refusal:
        """Its answers are malformed: make no further call."""
        self.lost = True
        return LOST

    def put(self, what: int, octets: bytes) -> Refusal | None:
        """Transfer the data of the next call of a kind, in parts."""
        for at in range(0, len(octets) or 1, self._part):
            answer = self(PART, _AT.pack(what, at), octets[at : at + self._part])
            if isinstance(answer, Refusal):
                return answer
        return None

    def ahead(self, sealed: bytes, kind: int, link: int, frames: Sequence[bytes], now_us: int) -> SignedAhead | Refusal:
        """Have the frames of a link signed ahead: as `Executor.ahead`."""
        listed = (len(frame).to_bytes(2) + frame for frame in frames)
        answer = self(AHEAD, _STANDING.pack(now_us, kind, link), sealed, *listed)
        if isinstance(answer, Refusal):
            return answer
        each = SIGNATURE if self.signs else 0
        if len(answer) != _SERIAL_BYTES + each * len(frames):
            return self.lose()
        begins = (_SERIAL_BYTES + each * number for number in range(len(frames)))
        return SignedAhead(int.from_bytes(answer[:_SERIAL_BYTES]), tuple(answer[at : at + each] for at in begins))

    def load(self, bundle: bytes, now: Now) -> bytes | Refusal:
        """Load a bundle; returns the id of its flight, which the boundary draws."""
        refused = self.put(LOAD, bundle)
        answer = refused or self(LOAD, _SIZED.pack(*_times(now), len(bundle)))
        if isinstance(answer, Refusal):
            return answer
        if len(answer) != FLIGHT_BYTES + 1:
            return self.lose()
        self.reopened = bool(answer[-1])
        return answer[:-1]

    def sign_log(self, checkpoint: bytes) -> bytes | Refusal:
        """The signature of the log's key under the checkpoint that begins the log of the flight, once."""
        return self(LOG, checkpoint)

    def time(self, *, settle: bool = False) -> OwnTime | Refusal:
        """The time by its own clock. `settle`: stop waiting for a better source, so that the operator's statement
        holds.
        """
        answer = self(TIME, bytes([settle]))
        if isinstance(answer, Refusal):
            return answer
        try:
            source, monotonic_us, utc_us, error_us, number = _TOLD.unpack(answer)
            return OwnTime(ClockSource(source), Now(monotonic_us, utc_us, error_us), number)
        except (struct_error, ValueError):
            return self.lose()

    def flight(self) -> bytes | Refusal:
        """The id of the flight that the next bundle begins."""
        answer = self(FLIGHT)
        return answer if isinstance(answer, Refusal) or len(answer) == FLIGHT_BYTES else self.lose()


def _times(now: Now) -> tuple[int, int, int]:
    return now.monotonic_us, now.utc_us, now.utc_error_us


class IsolatedBoundary:
    """`SoftwareBoundary` over calls. `in_force` and `commands` are this end's own copy of what is in force."""

    def __init__(self, caller: Caller, in_force: InForce, commands: Commands) -> None:
        self._caller = caller
        self._in_force = in_force
        self._commands = commands
        #: the commands of missions that may come into force, made ahead, by the document that contains them
        self._ready: dict[bytes, Made] = {}

    @property
    def lost(self) -> str | None:
        """The loss of the boundary and its consequences, as text; None while it works."""
        if not self._caller.lost:
            return None
        unverified = ", and frames from the vehicle are not verified" if self._caller.signs else ""
        return f"no further decisions are made{unverified}: only links that were signed ahead fly"

    def enforce(self, request: bytes) -> bytes:
        """The boundary's response; after its loss, a response that nothing was decided."""
        answer = self._caller(ENFORCE, request)
        return encode_refusal(Status.MALFORMED) if isinstance(answer, Refusal) else answer

    def consider(self, document: bytes, now: Now) -> Untrusted | None:
        """Verify a document ahead, for this end's copy. Returns why it is not trusted."""
        refused = self._in_force.consider(document, now)
        after = self._in_force.considered(document)
        if after is not None:
            self._ready[document] = self._commands.made(after.mission)
            for old in list(self._ready)[:-MOST_AHEAD]:
                self._ready.pop(old, None)
        return refused

    def present(self, document: bytes, now: Now, released: int) -> bytes:
        """The boundary's receipt; an accepted document is in force at this end too."""
        if len(document) > MAX_DOCUMENT:
            return encode_receipt(Receipt(UNKNOWN, "too-large", f"the limit is {MAX_DOCUMENT} bytes"))
        misfit = self._in_force.misfit(document, released)
        if misfit is not None:  # the boundary would verify it first, and answer nothing meanwhile
            return encode_receipt(Receipt(REPLACEMENT, misfit.slug, str(misfit)))
        refused = self._caller.put(PRESENT, document)
        answer = refused or self._caller(PRESENT, _SHOWN.pack(*_times(now), released, len(document)))
        if isinstance(answer, Refusal):
            return encode_receipt(Receipt(UNKNOWN, answer.slug, answer.text))
        receipt = decode(answer)
        if isinstance(receipt, Refusal):
            self._caller.lose()
        elif receipt.accepted:
            self._follow(document, now, receipt)
        return answer

    def _follow(self, document: bytes, now: Now, receipt: Receipt) -> None:
        """Apply an accepted document at this end, except for the decided steps, which only the boundary knows."""
        self._in_force.take(document, now, decided=0, released=receipt.step if receipt.kind == REPLACEMENT else 0)
        self._commands.called_off = self._in_force.called_off
        if receipt.kind == REPLACEMENT:
            self._commands.replace(self._in_force.bundle.mission, self._ready.pop(document, None))


class IsolatedGate:
    """The gate over calls: `frames.Gate`, and `mavlink.signing.Verifier` where the boundary has the link's key.

    After its loss, frames signed ahead are sent, and without a key housekeeping too. Incoming frames cannot be
    verified then: frames that look like the vehicle's are accepted all the same, so that the descent is observed.
    """

    may_be_lost = True

    def __init__(self, caller: Caller, commands: Commands) -> None:
        self._caller = caller
        #: the frames that are sent after the loss
        self.ahead = FramesAhead(commands, caller.ahead, caller.most_ahead)
        self._counts = Counts()
        self._heard: dict[Stream, tuple[int, int]] = {}  # the last timestamp of a verified frame, and its time

    @property
    def counts(self) -> Counts:
        """The received frames, by the boundary's verdict."""
        return self._counts

    def stands(self, now_us: int) -> bool:
        """Whether the vehicle is known to be on the ground and disarmed, without a permitted command under way."""
        return self._caller(STANDS, _TIME.pack(now_us)) == b"\1"

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        """Show it a valid frame. With a key it has seen the frame when it verified it."""
        if not self._caller.signs:
            self._caller(OBSERVE, _TIME.pack(now_us), frame)

    def accept(self, frame: bytes, now_us: int) -> bool:
        """Whether the origin of a frame is proven; such a frame is observed at once."""
        if not frame[FLAGS] & FLAG_SIGNED:
            self._counts.unsigned += 1
            return False
        answer = self._caller(OBSERVE, _TIME.pack(now_us), frame)
        if self._caller.lost:
            return self._seems_to_be(frame, now_us)
        names = ("accepted", "unsigned", "forged", "strayed", "stale", "crowded")
        if isinstance(answer, Refusal) or len(answer) != 1 or answer[0] >= len(names):
            return False
        setattr(self._counts, names[answer[0]], getattr(self._counts, names[answer[0]]) + 1)
        if answer[0] == 0:
            self._heard[stream_of(frame)] = timestamp_in(frame), now_us
        return answer[0] == 0

    def _seems_to_be(self, frame: bytes, now_us: int) -> bool:
        """Whether a frame continues a stream that was verified: replayed frames and other streams do not. A forger
        could still simulate another flight, and cause another kind of descent.
        """
        stream, timestamp = stream_of(frame), timestamp_in(frame)
        last, heard_us = self._heard.get(stream, (None, 0))
        if last is None or not last < timestamp <= last + MINUTE + (now_us - heard_us) // UNIT_US:
            self._counts.stale += 1
            return False
        self._heard[stream] = timestamp, now_us
        self._counts.unverified += 1
        return True

    def seal(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The octets to send for a frame, or why it is refused."""
        answer = self._caller(SEAL, _TIME.pack(now_us), frame)
        if self._caller.lost:
            return self._seal_alone(frame)
        if self._caller.signs and not isinstance(answer, Refusal):
            self.ahead.sent(answer)
        return answer

    def _seal_alone(self, octets: bytes) -> bytes | Refusal:
        frame = read_frame(octets)
        if frame is None:
            return frames.NOT_ONE_FRAME
        if is_housekeeping(frame):
            return frames.UNSIGNED if self._caller.signs else octets
        return self.ahead.take(frame)

    @property
    def is_mute(self) -> bool:
        """Whether nothing is left that could sign a request."""
        return self._caller.lost and self._caller.signs

    def renew_ahead(self, encode: Encode, now_us: int, *, begins: bool) -> Sequence[str]:
        """Have the due frames signed ahead; return the reasons for those that are not."""
        return () if self._caller.lost else self.ahead.renew(encode, now_us, begins=begins)


class IsolatedExecutor:
    """`Executor` over calls. Commands are looked up at this end and permitted at the other; after its loss, those
    signed ahead there.
    """

    def __init__(self, caller: Caller, commands: Commands, gate: IsolatedGate) -> None:
        self._caller = caller
        self._commands = commands
        self.frames = gate

    def dispatch(self, sealed: bytes, now_us: int) -> Command | Refusal:
        """The command of a permit at a monotonic time, or why it is refused."""
        return self._permitted(self._caller(DISPATCH, _TIME.pack(now_us), sealed), sealed)

    def stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        """The command of a link, by the standing permit of a step that was sent, or why it is refused."""
        answer = self._caller(STAND_IN, _STANDING.pack(now_us, kind, link), sealed)
        if not self._caller.lost:
            return self._permitted(answer, sealed)
        return self.frames.ahead.begin(kind, link) or NOT_AHEAD

    def _permitted(self, answer: bytes | Refusal, sealed: bytes) -> Command | Refusal:
        if isinstance(answer, Refusal):
            return answer
        try:
            kind, step, link, serial, not_after_us = _PERMITTED.unpack(answer)
            command: Command = self._commands.command(kind, step, link, serial, not_after_us)
        except (struct_error, LookupError):
            return self._caller.lose()
        if kind == STEP:
            self.frames.ahead.stands(sealed, step)
        else:
            self.frames.ahead.flown()
        return command

    def withdraw(self, sealed: bytes, now_us: int) -> Refusal:
        """Withdraw the permit of a step: `UNSENT`, or why it is not withdrawn."""
        refused = self._caller(WITHDRAW, _TIME.pack(now_us), sealed)
        if isinstance(refused, Refusal):
            return refused
        self.frames.ahead.withdrawn(sealed)
        return executor.UNSENT

    def prepare(self, sealed: bytes, now_us: int) -> Preparation | Refusal:
        """The parameters that a preparation permit allows to be set, or why it is refused."""
        refused = self._caller(PREPARE, _TIME.pack(now_us), sealed)
        if isinstance(refused, Refusal):
            return refused
        return decode_preparation(sealed[:-MAC_BYTES]) or self._caller.lose()

    def prepared(self) -> None:
        """The parameters are set, or setting them was given up."""
        self._caller(PREPARED)

    def ended(self, token: int | None = None) -> None:
        """The running step ended, or that command did."""
        self._caller(ENDED, b"" if token is None else token.to_bytes(8, "big"))
        self.frames.ahead.ended(token)

    def landed(self) -> None:
        """The vehicle landed: standing permits lapse."""
        self._caller(LANDED)
        self.frames.ahead.lapse()

    def release(self) -> None:
        """Send nothing more that moves the vehicle."""
        self._caller(RELEASE)
        self.frames.ahead.close()

    def ahead(self, sealed: bytes, kind: int, link: int, frames: Sequence[bytes], now_us: int) -> SignedAhead | Refusal:
        """Have the frames of a link signed ahead: as `Executor.ahead`."""
        return self._caller.ahead(sealed, kind, link, frames, now_us)


class IsolatedIssuer:
    """`PreparationIssuer` over calls: the other end received the configuration, and the owed parameters, when it
    began.
    """

    def __init__(self, caller: Caller, settings: Mapping[str, int]) -> None:
        self._caller = caller
        #: the parameters to set before the flight
        self.settings = dict(settings)

    def permit(self, ask: bytes, now_us: int) -> bytes | Refusal:
        """The permit for a requested preparation, at a monotonic time."""
        return self._caller(PERMIT, _TIME.pack(now_us), ask)


class IsolatedAttestation:
    """`Attestation` over calls: the other end has the key, which the caller passed when it began."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._begun = False

    @property
    def digest(self) -> bytes:
        """The digest to store for the next session, 32 octets; zero octets of a lost boundary."""
        answer = self._caller(DIGEST)
        return START if isinstance(answer, Refusal) else answer

    def begin(self, key: BoundaryKey | None) -> int | None:
        """Begin the flight's log, with a session of this number, or of the next one that the boundary counts. Returns
        the number; None if none begins. Raises RuntimeError on a second call.
        """
        if self._begun:
            raise RuntimeError("the boundary's session has begun already")
        answer = LOST if key is None else self._caller(BEGIN, key.session.to_bytes(8, "big"), key.before)
        self._begun = not isinstance(answer, Refusal)
        return None if isinstance(answer, Refusal) else int.from_bytes(answer[:8], "big")

    def statement(self, now: Now, *, final: bool = False) -> bytes | None:
        """A signed statement, None without a key or after the final one. `now` counts if it has no clock of its own."""
        answer = self._caller(STATEMENT, bytes([final]), _NOW.pack(*_times(now))) if self._begun else LOST
        return None if isinstance(answer, Refusal) else answer

    def home(self) -> bytes | None:
        """What the boundary's home attests of itself (`wire.attestation`), None without a key."""
        answer = self._caller(HOME) if self._begun else LOST
        return None if isinstance(answer, Refusal) else answer
