"""Our end of the link: what came, once it proved to be the vehicle's, what leaves, once the boundary let it, and
whether it is up.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.modes import is_another
from rtshcua.mavlink.radio import RADIO, RADIO_SYSTEM, UnsignedRadio
from rtshcua.mavlink.signing import FrameVerifier
from rtshcua.onboard.enforcement.frames import OURS, UNSIGNED, Gate
from rtshcua.onboard.ports import Command, Event

#: what we call ourselves before we know whose system we belong to; nothing is sent under it
_NOBODY: Final = 255
#: the system id that both autopilots are delivered with (`MAV_SYS_ID`, `SYSID_THISMAV`)
_DELIVERED: Final = 1
#: what the boundary learns of the vehicle from
_OBSERVED: Final = frozenset({"HEARTBEAT", "GLOBAL_POSITION_INT", "EXTENDED_SYS_STATE", "PARAM_VALUE"})


def is_radio(frame: ReceivedFrame) -> bool:
    """Whether it is the status of a SiK radio in a link between two: it speaks for itself, as no part of a vehicle.

    Which vehicle's link it is about nobody can tell where several speak, so with a named `system` it is not heard.
    """
    return frame.name == "RADIO_STATUS" and (frame.system, frame.component) == (RADIO_SYSTEM, RADIO)


def two_speak(system: int, who: str) -> str:
    """That somebody else speaks under the ids of the vehicle, for a person."""
    return f"two senders use the ids {system}/{AUTOPILOT}: {who} besides the vehicle; give each component its own ids"


class DatagramContents(NamedTuple):
    """What a datagram brought: events, frames that answer it, and its good frames, for the raw log."""

    events: Sequence[Event]
    answers: Sequence[bytes]
    frames: Sequence[ReceivedFrame]


class VehicleLink:
    """Frames in and out. There is no other way out than through `frames`, the boundary's gate.

    `verifier` holds the link's key, if it has one: what is not signed with it is dropped. With a `system`, nobody else
    is heard from the beginning: the operator said which one is flown. Others may speak too then, but under no
    circumstances under the same id: two autopilots that send to one port, of which one is flown, must not go unnoticed.
    """

    def __init__(self, frames: Gate, verifier: FrameVerifier | None = None, system: int | None = None) -> None:
        self._frames = frames
        self._verifier = verifier
        self._named = system is not None
        self._greets_as = system or _DELIVERED
        self._codec = Codec(_NOBODY, OURS, only=None if system is None else {system}, verifier=verifier)
        self._codec_ahead = Codec(_NOBODY, OURS)
        self._system = 0
        #: until the flight begins: what is not the chosen vehicle's, of its own sender and of another one
        self._others: tuple[Codec, Codec] | None = None
        #: another vehicle that was heard on the link before the flight, in words; None while there is none that matters
        self.crowd: str | None = None

    def settle(self, system: int) -> None:
        """From now on be part of this system, and hear nobody else."""
        self._system = system
        heard = {system} if self._named else {system, RADIO_SYSTEM}
        self._codec = Codec(system, OURS, only=heard, verifier=self._verifier)
        self._codec_ahead = Codec(system, OURS)
        others = Codec(0, 0, only=frozenset(range(256)) - {system}, verifier=self._verifier)
        # with a key, a second sender of the vehicle's own frames is nobody: at most it repeats them
        self._others = others, Codec(0, 0) if self._verifier is None else others

    @property
    def outdated(self) -> int:
        """How many frames were signed with the link's key, and are too old to be believed. An autopilot whose signing
        clock is behind sends such until it hears a later timestamp: ArduPilot's counts frames while it hears nobody.
        """
        return 0 if self._verifier is None else self._verifier.counts.stale

    def greet(self, now_us: int) -> list[bytes]:
        """Our heartbeat to a vehicle that waits to be spoken to, before it is known which one it is. It is of the
        system that was named, or of the one that autopilots are delivered as.
        """
        return self._sealed(self._system or self._greets_as, messages.heartbeat(), now_us)

    def ask_who(self, system: int, now_us: int) -> list[bytes]:
        """Ask who an autopilot is that was heard, and not chosen yet: for its HEARTBEAT."""
        return self._sealed(system, messages.request(system, "HEARTBEAT"), now_us)

    def _sealed(self, system: int, message: Message, now_us: int) -> list[bytes]:
        sealed = self._frames.seal(Codec(system, OURS).pack(message), now_us)
        return [] if isinstance(sealed, Refusal) else [sealed]

    def begin(self) -> None:
        """The flight begins: from now on nothing is made of other vehicles."""
        self._others = None

    def overhear(self, datagram: bytes, now_us: int, *, elsewhere: bool = True) -> None:
        """Look for another vehicle in a datagram; `elsewhere`: of another sender than the vehicle's."""
        if self._others is None:
            return
        for frame in self._others[elsewhere].parse(datagram, now_us):
            beats = frame.component == AUTOPILOT and frame.name == "HEARTBEAT"
            if not beats or not is_another(frame.message.type, frame.message.autopilot):
                continue
            ours, theirs = self._system, frame.system
            if theirs == ours:
                self.crowd = f"two vehicles send here as system {ours}: give each its own id"
            elif not self._named and self.crowd is None:
                self.crowd = f"two vehicles send here, systems {ours} and {theirs}: `--system` selects one"

    def meets(self, other: str) -> None:
        """Another vehicle speaks under the ids of ours, in words: before the flight that keeps it from being ready."""
        if self._others is not None:
            self.crowd = other

    def parse(self, datagram: bytes, now_us: int) -> list[ReceivedFrame]:
        """The good frames in a datagram, in order; never raises, whatever the bytes."""
        if self._others is not None:
            self.overhear(datagram, now_us, elsewhere=False)
        received = self._codec.parse(datagram, now_us)
        for each in received:
            _, name, system, component, _, signed, frame = each
            if component == OURS or (system == RADIO_SYSTEM and self._is_nobody(each)):
                received = [other for other in received if other is not each]
            elif name in _OBSERVED:
                self._frames.observe(unsigned(frame) if signed else frame, now_us)
            elif name == "RADIO_STATUS" and not signed and isinstance(self._verifier, UnsignedRadio):
                self._verifier.temper(each.message, now_us)
        return received

    def _is_nobody(self, frame: ReceivedFrame) -> bool:
        """Whether a frame comes under a radio's system id, and is neither of the vehicle nor a radio's status."""
        return self._system not in (0, RADIO_SYSTEM) and not is_radio(frame)

    def pack(self, send: Iterable[Message], now_us: int) -> tuple[list[bytes], list[Refusal]]:
        """The frames that may be sent, and why others may not."""
        frames: list[bytes] = []
        refused: list[Refusal] = []
        for message in send:
            sealed = self._frames.seal(self._codec.pack(message), now_us)
            if not isinstance(sealed, Refusal):
                frames.append(sealed)
            elif sealed is not UNSIGNED:
                refused.append(sealed)
        return frames, refused

    @property
    def is_mute(self) -> bool:
        """Whether nothing can be asked any more."""
        return self._frames.is_mute

    def renew_ahead(
        self, encode: Callable[[Command], Sequence[Message]], now_us: int, *, begins: bool
    ) -> Sequence[str]:
        """Have signed ahead what is due, where there may be a need for it; why something is not, in words. The frames
        have numbers of their own: they count as none of those that leave.
        """
        codec = self._codec_ahead
        return self._frames.renew_ahead(
            lambda command: [codec.pack(each) for each in encode(command)], now_us, begins=begins
        )


# ---------------------------------------------------------------- whether it is up

#: Nothing at all came from the autopilot for this long: the link is silent. Its streams come several times a second.
SILENT_US: Final = 1_000_000
#: Nothing that was asked was answered for this long, though the autopilot is heard: it does not hear us.
UNANSWERED_US: Final = 3_000_000
#: Between two looks: the computer stood still, and what is read next waited.
STOOD_US: Final = 500_000

SILENT: Final = "silent"
UNANSWERED: Final = "heard, but answers nothing"


class LinkWatch:
    """Whether the link to the autopilot is up, in both directions, and a clock that only runs while it is.

    Nothing that we send arrives on a link that is cut, and nothing that we see is the present. So what waits for an
    effect or an answer waits in *link time*: a manoeuvre does not fail because nobody could hear of its success.
    Told of every frame, question and answer; `slack` stretches its limits, see `Driver`. Times in us.
    """

    def __init__(self, slack: int = 1) -> None:
        self._silent_us, self._unanswered_limit_us = SILENT_US * slack, UNANSWERED_US * slack
        self._stood_us = STOOD_US * slack
        #: when a frame of the autopilot last came
        self.heard_us: int | None = None
        self._unanswered_us: int | None = None  # since when a question stands open
        self._seen_us: int | None = None
        #: link time: how long the link was up in sum, as of the last look
        self.up_us = 0
        #: whether it ever answered anything
        self.answers = False
        #: whether it counts as unanswered though it never answered anything, too
        self.strict = False
        #: whether it answered nothing for too long, and did not since; also while it is silent
        self.mute = False
        #: why the link is down; None while it is up
        self.down: str | None = None
        #: when the computer last went on that had stood still
        self.stood_us: int | None = None

    def asked(self, now_us: int) -> None:
        """Something was asked that the autopilot answers."""
        if self._unanswered_us is None:
            self._unanswered_us = now_us

    def unasked(self) -> None:
        """Nothing is asked any more, so that no answer is missed."""
        self._unanswered_us = None

    def answered(self) -> None:
        """It answered."""
        self._unanswered_us, self.answers, self.mute = None, True, False

    def look(self, now_us: int) -> bool:
        """Let time pass; True when `down` is another than at the last look."""
        heard_us, seen_us, was, silent_us = self.heard_us, self._seen_us, self.down, self._silent_us
        if heard_us is None:
            return False
        self._seen_us = now_us
        if seen_us is not None and now_us - seen_us > self._stood_us:
            self.stood_us = now_us
        if seen_us is not None and was is None:
            self.up_us += min(now_us - seen_us, silent_us)  # we may have been held up
        down, asked_us = None, self._unanswered_us
        if now_us - heard_us > silent_us:
            # What was asked meanwhile could not be answered; the question is put anew when it is heard again.
            down, self._unanswered_us = SILENT, None
        elif asked_us is not None and now_us - asked_us > self._unanswered_limit_us and (self.answers or self.strict):
            down, self.mute = UNANSWERED, True
        self.down = down
        return was != down
