"""A boundary elsewhere: in another process, or in a trusted world. What the runtime has of it is a way to call it.

The calls are those of boundary/enforcement/calls.h: an octet that says which, and what follows it, big-endian; an
answer is 0 and what is given back, or 1 and a slug. The other end verified the bundle itself, holds the keys, decides,
and lets frames out; whatever this end does wrong, nothing moves that it did not permit. So this end may keep what it
needs to fly by its own reading of the same bundle.
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
from rtshcua.onboard.enforcement import executor, frames, preparation
from rtshcua.onboard.enforcement.ahead import NOT_AHEAD, Encode, FramesAhead
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

#: makes one call, and gives its answer
Call = Callable[[bytes], bytes]

(
    PART, LOAD, ENFORCE, PRESENT, DISPATCH, STAND_IN, ENDED, LANDED, RELEASE, OBSERVE, SEAL, BEGIN, STATEMENT, DIGEST,
    PERMIT, PREPARE, PREPARED, STANDS, AHEAD, FLIGHT, LOG, TIME, WITHDRAW,
) = range(1, 24)  # fmt: skip
#: octets of a bundle or a document that go in one call
MAX_PART: Final = 60_000

_FINE: Final = 0
_TIME, _NOW = Struct(">q"), Struct(">qqq")
_SIZED, _AT = Struct(">qqqI"), Struct(">BI")
_SHOWN: Final = Struct(">qqqII")
_STANDING: Final = Struct(">qBb")
_PERMITTED: Final = Struct(">BhhQq")
_SERIAL_BYTES: Final = 8
_TOLD: Final = Struct(">BqqqQ")

#: what an answer that makes no sense, or none at all, comes to
LOST: Final = Refusal("boundary-lost", "the boundary does not answer, or answers what makes no sense")


class OwnTime(NamedTuple):
    """What the boundary's own clock says: where it has the time of day from, and the moment; and the number that it
    wants back from the vehicle in TIMESYNC, 0 for none.
    """

    source: ClockSource
    now: Now
    number: int


def _known(*modules: object) -> dict[str, Refusal]:
    found = (each for module in modules for each in vars(module).values() if isinstance(each, Refusal))
    return {refusal.slug: refusal for refusal in found}


#: why a permit or a frame is refused, by slug: the texts are those of the boundary in this process
_REFUSALS: Final[Mapping[str, Refusal]] = MappingProxyType(_known(executor, frames, preparation))


class Caller:
    """Calls a boundary. Where nobody answers, or what makes no sense, that is `LOST`, and so is all from then on."""

    def __init__(self, call: Call, *, signs: bool = False) -> None:
        """`signs`: it has the link's key."""
        self._call = call
        self.signs = signs
        #: whether the boundary is gone
        self.lost = False
        #: whether the mission that was loaded last had been opened before: then no step of it may begin
        self.reopened = False

    def __call__(self, kind: int, *parts: bytes) -> bytes | Refusal:
        """What a call gives back, or why it is refused."""
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
        return _REFUSALS.get(slug) or Refusal(slug, "the boundary refuses it")

    def lose(self) -> Refusal:
        """Its answers make no sense: nothing more is asked."""
        self.lost = True
        return LOST

    def put(self, what: int, octets: bytes) -> Refusal | None:
        """Hand over what the next call of a kind is about, in parts."""
        for at in range(0, len(octets) or 1, MAX_PART):
            answer = self(PART, _AT.pack(what, at), octets[at : at + MAX_PART])
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
        """Hand a bundle over: the id of its flight, which the boundary draws."""
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
        """What its own clock says. `settle`: no more is waited for, so what an operator stated holds."""
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
    """`SoftwareBoundary` over calls. `in_force` and `commands` are this end's own reading of what is in force."""

    def __init__(self, caller: Caller, in_force: InForce, commands: Commands) -> None:
        self._caller = caller
        self._in_force = in_force
        self._commands = commands
        #: the commands of missions that may come into force, made ahead, by the document that brings them
        self._ready: dict[bytes, Made] = {}

    @property
    def lost(self) -> str | None:
        """That it is gone, in words, and what that means; None while it is there."""
        if not self._caller.lost:
            return None
        unverified = ", and what comes from the vehicle is not verified" if self._caller.signs else ""
        return f"nothing is decided any more{unverified}: links fly as they were signed ahead, and nothing else does"

    def enforce(self, request: bytes) -> bytes:
        """The boundary's response; of one that is gone, that nothing was decided."""
        answer = self._caller(ENFORCE, request)
        return encode_refusal(Status.MALFORMED) if isinstance(answer, Refusal) else answer

    def consider(self, document: bytes, now: Now) -> Untrusted | None:
        """Look at a document ahead, for what this end makes of it. Gives why it is not to be trusted."""
        refused = self._in_force.consider(document, now)
        after = self._in_force.considered(document)
        if after is not None:
            self._ready[document] = self._commands.made(after.mission)
            for old in list(self._ready)[:-MOST_AHEAD]:
                self._ready.pop(old, None)
        return refused

    def present(self, document: bytes, now: Now, released: int) -> bytes:
        """The boundary's receipt; what it accepted is in force at this end too."""
        if len(document) > MAX_DOCUMENT:
            return encode_receipt(Receipt(UNKNOWN, "too-large", f"at most {MAX_DOCUMENT} bytes are read"))
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
        """What the boundary found good is found good here, but for the steps that are decided, which it alone knows."""
        self._in_force.take(document, now, decided=0, released=receipt.step if receipt.kind == REPLACEMENT else 0)
        self._commands.called_off = self._in_force.called_off
        if receipt.kind == REPLACEMENT:
            self._commands.replace(self._in_force.bundle.mission, self._ready.pop(document, None))


class IsolatedGate:
    """The gate over calls: `frames.Gate`, and `mavlink.signing.Verifier` where the boundary has the link's key.

    When it is lost, what was signed ahead leaves, and without a key housekeeping too. Nothing that comes can be
    verified then: what looks as the vehicle's frames looked is taken in all the same, so that the way down is seen.
    """

    may_be_lost = True

    def __init__(self, caller: Caller, commands: Commands) -> None:
        self._caller = caller
        #: what leaves when it is lost
        self.ahead = FramesAhead(commands, caller.ahead)
        self._counts = Counts()
        self._heard: dict[Stream, tuple[int, int]] = {}  # the last timestamp of what was verified, and when it came

    @property
    def counts(self) -> Counts:
        """What came, by what the boundary made of it."""
        return self._counts

    def stands(self, now_us: int) -> bool:
        """Whether the vehicle is known to be on the ground, disarmed, and nothing permitted is under way."""
        return self._caller(STANDS, _TIME.pack(now_us)) == b"\1"

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        """Show it one good frame. With a key it has seen the frame when it verified it."""
        if not self._caller.signs:
            self._caller(OBSERVE, _TIME.pack(now_us), frame)

    def accept(self, frame: bytes, now_us: int) -> bool:
        """Whether a frame proves where it comes from; one that does is observed at once."""
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
        """Whether a frame goes on where a stream left off that was verified: nothing that was recorded does, and no
        other stream. Who makes frames up can tell of another flight, and have it brought down in another way.
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
        """The octets to send for a frame, or why it is not sent."""
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
        """Whether nobody is there any more to sign a question."""
        return self._caller.lost and self._caller.signs

    def renew_ahead(self, encode: Encode, now_us: int, *, begins: bool) -> Sequence[str]:
        """Have signed ahead what is due; why something is not, in words."""
        return () if self._caller.lost else self.ahead.renew(encode, now_us, begins=begins)


class IsolatedExecutor:
    """`Executor` over calls. What is to be sent is looked up at this end; what may be is decided at the other, and when
    that is lost was signed ahead there.
    """

    def __init__(self, caller: Caller, commands: Commands, gate: IsolatedGate) -> None:
        self._caller = caller
        self._commands = commands
        self.frames = gate

    def dispatch(self, sealed: bytes, now_us: int) -> Command | Refusal:
        """What to send for a permit at a monotonic time, or why nothing is sent."""
        return self._permitted(self._caller(DISPATCH, _TIME.pack(now_us), sealed), sealed)

    def stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        """What to send for a link by the standing permit of a step that was sent, or why nothing is sent."""
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
        """Give the permit of a step up: `UNSENT`, or why it is not given up."""
        refused = self._caller(WITHDRAW, _TIME.pack(now_us), sealed)
        if isinstance(refused, Refusal):
            return refused
        self.frames.ahead.withdrawn(sealed)
        return executor.UNSENT

    def prepare(self, sealed: bytes, now_us: int) -> Preparation | Refusal:
        """What may be set of the vehicle from now on, by a preparation permit, or why nothing may."""
        refused = self._caller(PREPARE, _TIME.pack(now_us), sealed)
        if isinstance(refused, Refusal):
            return refused
        return decode_preparation(sealed[:-MAC_BYTES]) or self._caller.lose()

    def prepared(self) -> None:
        """What was to be set is set, or was given up."""
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
        """Nothing more that moves the vehicle is to be sent."""
        self._caller(RELEASE)
        self.frames.ahead.close()

    def ahead(self, sealed: bytes, kind: int, link: int, frames: Sequence[bytes], now_us: int) -> SignedAhead | Refusal:
        """Have the frames of a link signed ahead: as `Executor.ahead`."""
        return self._caller.ahead(sealed, kind, link, frames, now_us)


class IsolatedIssuer:
    """`PreparationIssuer` over calls: the other end was told what is configured, and what is owed, when it began."""

    def __init__(self, caller: Caller, settings: Mapping[str, int]) -> None:
        self._caller = caller
        #: what is set before the flight
        self.settings = dict(settings)

    def permit(self, ask: bytes, now_us: int) -> bytes | Refusal:
        """The permit for what is asked for, at a monotonic time."""
        return self._caller(PERMIT, _TIME.pack(now_us), ask)


class IsolatedAttestation:
    """`Attestation` over calls: the other end has the key, which the caller gave it when it began."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._begun = False

    @property
    def digest(self) -> bytes:
        """The digest to keep for the next session, 32 octets; zero octets of a boundary that is gone."""
        answer = self._caller(DIGEST)
        return START if isinstance(answer, Refusal) else answer

    def begin(self, key: BoundaryKey | None) -> int | None:
        """The flight's log begins, with a session of this number, or of the next of those that the boundary kept, which
        is the answer; None where none begins. Raises RuntimeError for a second time.
        """
        if self._begun:
            raise RuntimeError("the boundary's session has begun already")
        answer = LOST if key is None else self._caller(BEGIN, key.session.to_bytes(8, "big"), key.before)
        self._begun = not isinstance(answer, Refusal)
        return None if isinstance(answer, Refusal) else int.from_bytes(answer[:8], "big")

    def statement(self, now: Now, *, final: bool = False) -> bytes | None:
        """A signed statement, None without a key or after the final one. `now` counts where it has no own clock."""
        answer = self._caller(STATEMENT, bytes([final]), _NOW.pack(*_times(now))) if self._begun else LOST
        return None if isinstance(answer, Refusal) else answer
