"""Our end of the link: which frames are received as the vehicle's, which leave with the boundary's permission, and
whether the link is up.
"""

from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.streams import StreamRequests
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.layouts import COMMAND_LONG, LAYOUTS
from rtshcua.mavlink.modes import is_another
from rtshcua.mavlink.radio import RADIO, RADIO_SYSTEM, UnsignedRadio
from rtshcua.mavlink.signing import FrameVerifier
from rtshcua.onboard.enforcement.allow_list import Frame, is_housekeeping, read_frame
from rtshcua.onboard.enforcement.frames import OURS, UNSIGNED, Gate
from rtshcua.onboard.ports import Command, Event

#: our system id before the vehicle's is known; nothing is sent under it
_NOBODY: Final = 255
#: the default system id of both autopilots (`MAV_SYS_ID`, `SYSID_THISMAV`)
_DELIVERED: Final = 1
#: messages from which the boundary learns about the vehicle
_OBSERVED: Final = frozenset({"HEARTBEAT", "GLOBAL_POSITION_INT", "EXTENDED_SYS_STATE", "PARAM_VALUE"})


def is_radio(frame: ReceivedFrame) -> bool:
    """Whether it is the status of a SiK radio between two ends of a link, which is not part of a vehicle. With several
    vehicles the link it is about is unknown, so with a given `system` it is ignored.
    """
    return frame.name == "RADIO_STATUS" and (frame.system, frame.component) == (RADIO_SYSTEM, RADIO)


def two_speak(system: int, who: str) -> str:
    """The message that another sender uses the vehicle's ids."""
    return f"two senders use the ids {system}/{AUTOPILOT}: {who} besides the vehicle; give each component its own ids"


class DatagramContents(NamedTuple):
    """The contents of a datagram: events, frames to send in reply, and its valid frames for the raw log."""

    events: Sequence[Event]
    answers: Sequence[bytes]
    frames: Sequence[ReceivedFrame]


class VehicleLink:
    """Receives and sends frames. Every frame leaves through `frames`, the boundary's gate.

    `verifier` holds the link's key, if any: frames without its signature are dropped. With a `system` all other systems
    are ignored from the beginning, because the operator selected the vehicle. Others may then send too, but never under
    the same id: two autopilots on one port must not go unnoticed.
    """

    def __init__(self, frames: Gate, verifier: FrameVerifier | None = None, system: int | None = None) -> None:
        self._frames = frames
        self._verifier = verifier
        self._named = system is not None
        self._greets_as = system or _DELIVERED
        self._codec = Codec(_NOBODY, OURS, only=None if system is None else {system}, verifier=verifier)
        self._codec_ahead = Codec(_NOBODY, OURS)
        self._system = 0
        #: until the flight begins: decoders for other vehicles, from the vehicle's sender and from another one
        self._others: tuple[Codec, Codec] | None = None
        #: another vehicle that was heard on the link before the flight, in words; None if none matters
        self.crowd: str | None = None

    def settle(self, system: int) -> None:
        """Join this system and ignore all others from now on."""
        self._system = system
        heard = {system} if self._named else {system, RADIO_SYSTEM}
        self._codec = Codec(system, OURS, only=heard, verifier=self._verifier)
        self._codec_ahead = Codec(system, OURS)
        others = Codec(0, 0, only=frozenset(range(256)) - {system}, verifier=self._verifier)
        # with a key, a second sender of the vehicle's own frames can only repeat them
        self._others = others, Codec(0, 0) if self._verifier is None else others

    @property
    def outdated(self) -> int:
        """The number of frames that were signed with the link's key but are too old. An autopilot whose signing clock
        is behind sends such frames until it receives a later timestamp: ArduPilot's clock advances per frame until
        then.
        """
        return 0 if self._verifier is None else self._verifier.counts.stale

    def greet(self, now_us: int) -> list[bytes]:
        """Our heartbeat to a vehicle that waits to be addressed, before it is known. It uses the given system id or the
        autopilots' default.
        """
        return self._sealed(self._system or self._greets_as, messages.heartbeat(), now_us)

    def ask_who(self, system: int, now_us: int) -> list[bytes]:
        """Request the HEARTBEAT of an autopilot that was heard but not chosen yet."""
        return self._sealed(system, messages.request(system, "HEARTBEAT"), now_us)

    def _sealed(self, system: int, message: Message, now_us: int) -> list[bytes]:
        sealed = self._frames.seal(Codec(system, OURS).pack(message), now_us)
        return [] if isinstance(sealed, Refusal) else [sealed]

    def begin(self) -> None:
        """Begin the flight: other vehicles are ignored from now on."""
        self._others = None

    def overhear(self, datagram: bytes, now_us: int, *, elsewhere: bool = True) -> None:
        """Look for another vehicle in a datagram. `elsewhere`: it comes from a sender other than the vehicle's."""
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
        """Note another vehicle under our vehicle's ids, in words: before the flight it prevents readiness."""
        if self._others is not None:
            self.crowd = other

    def parse(self, datagram: bytes, now_us: int) -> list[ReceivedFrame]:
        """The valid frames in a datagram, in order. Never raises, whatever the bytes."""
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
        """Whether a frame has a radio's system id but is neither the vehicle's nor a radio's status."""
        return self._system not in (0, RADIO_SYSTEM) and not is_radio(frame)

    def pack(self, send: Iterable[Message], now_us: int) -> tuple[list[bytes], list[Refusal]]:
        """The frames that may be sent, and the reasons why others may not."""
        frames: list[bytes] = []
        refused: list[Refusal] = []
        for message in send:
            sealed = self._frames.seal(self._codec.pack(message), now_us)
            if not isinstance(sealed, Refusal):
                frames.append(sealed)
            elif sealed is not UNSIGNED:
                refused.append(sealed)
        return frames, refused

    def pass_on(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The frame of another program, as the boundary lets it leave, or why it does not."""
        return self._frames.seal(frame, now_us)

    @property
    def is_mute(self) -> bool:
        """Whether nothing can be asked any more."""
        return self._frames.is_mute

    def renew_ahead(
        self, encode: Callable[[Command], Sequence[Message]], now_us: int, *, begins: bool
    ) -> Sequence[str]:
        """Have frames signed in advance where they may be needed; return the reasons why some are not, in words. These
        frames have sequence numbers of their own.
        """
        codec = self._codec_ahead
        return self._frames.renew_ahead(
            lambda command: [codec.pack(each) for each in encode(command)], now_us, begins=begins
        )


# ---------------------------------------------------------------- requests of a gateway's clients
# They are a part of what the boundary's gate lets out at any time. Our heartbeat, texts and the dialogue about missions
# are not among them, and no report becomes rarer than this program needs it, or so frequent that it crowds out others.

NO_VEHICLE: Final = Refusal("no-vehicle", "no vehicle was heard yet")
NOT_A_REQUEST: Final = Refusal("not-a-request", "the frame is not a request that is passed on")
BUSY: Final = Refusal("busy", "the vehicle is being asked for the reports of this flight: ask again later")
ON_A_LINE: Final = Refusal("rate", "the rates on this link are planned within its capacity, and are not changed")

#: the shortest interval that a client may request, in us: 50 a second
SHORTEST_US: Final = 20_000
_MESSAGES: Final = frozenset(
    {layouts.PARAM_REQUEST_READ, layouts.PARAM_REQUEST_LIST, layouts.LOG_REQUEST_LIST, layouts.TIMESYNC}
)
_command: Final = LAYOUTS[COMMAND_LONG].getter("command")
_interval: Final = LAYOUTS[COMMAND_LONG].getter("param1 param2")


def command_of(frame: bytes) -> int | None:
    """The number of the command in a frame; None if it is not a COMMAND_LONG."""
    found = read_frame(frame)
    return None if found is None or found.message != COMMAND_LONG else int(_command(found.fields))


def refusal_of(frame: bytes, streams: StreamRequests) -> Refusal | None:
    """Why a request must not be passed on; None if it may."""
    found = read_frame(frame)
    if found is None or not is_housekeeping(found):
        return NOT_A_REQUEST
    if found.message in _MESSAGES:
        return None
    number = _command(found.fields) if found.message == COMMAND_LONG else 0
    if number == enums.MAV_CMD_REQUEST_MESSAGE:
        return None
    return _rate(found, streams) if number == enums.MAV_CMD_SET_MESSAGE_INTERVAL else NOT_A_REQUEST


def _rate(frame: Frame, streams: StreamRequests) -> Refusal | None:
    """Why a requested rate is refused; None if it is not."""
    if streams.plan.capacity is not None:
        return ON_A_LINE
    if streams.waits:
        return BUSY
    message, interval_us = _interval(frame.fields)
    if not (isfinite(message) and isfinite(interval_us)):
        return NOT_A_REQUEST
    slowest_us = streams.slowest_us(int(message))
    if slowest_us == 0:
        return Refusal("rate", f"the rate of message {int(message)} is not changed")
    if slowest_us is not None and not 0 < interval_us <= slowest_us:
        return Refusal("rate", f"this flight needs message {int(message)} every {slowest_us // 1_000} ms or sooner")
    if 0 < interval_us < SHORTEST_US:
        return Refusal("rate", f"at most every {SHORTEST_US // 1_000} ms")
    return None


# ---------------------------------------------------------------- link state

#: The link is silent after this long without a frame of the autopilot. Its streams come several times a second.
SILENT_US: Final = 1_000_000
#: The autopilot does not hear us after this long without an answer, although it is heard.
UNANSWERED_US: Final = 3_000_000
#: A gap this long between two calls means that the computer stood still, and that the next frames have waited.
STOOD_US: Final = 500_000

SILENT: Final = "silent"
UNANSWERED: Final = "heard, but answers nothing"


class LinkWatch:
    """Whether the link to the autopilot is up in both directions, and a clock that only runs while it is.

    On a broken link nothing arrives, and nothing received is current. So timeouts for effects and answers count *link
    time*: a manoeuvre does not fail because its success could not be heard. It is notified of every frame, question and
    answer; `slack` multiplies its limits, see `Driver`. Times in us.
    """

    def __init__(self, slack: int = 1) -> None:
        self._silent_us, self._unanswered_limit_us = SILENT_US * slack, UNANSWERED_US * slack
        self._stood_us = STOOD_US * slack
        #: when the last frame of the autopilot arrived
        self.heard_us: int | None = None
        self._unanswered_us: int | None = None  # since when a question is unanswered
        self._seen_us: int | None = None
        #: link time: the total time that the link was up, as of the last call
        self.up_us = 0
        #: whether it has ever answered
        self.answers = False
        #: whether it also counts as unanswered if it has never answered
        self.strict = False
        #: whether it has not answered for too long, also while it is silent
        self.mute = False
        #: why the link is down; None while it is up
        self.down: str | None = None
        #: when the computer last resumed after standing still
        self.stood_us: int | None = None

    def asked(self, now_us: int) -> None:
        """Note a question that the autopilot answers."""
        if self._unanswered_us is None:
            self._unanswered_us = now_us

    def unasked(self) -> None:
        """Note that no question is open, so that no answer is missed."""
        self._unanswered_us = None

    def answered(self) -> None:
        """Note an answer."""
        self._unanswered_us, self.answers, self.mute = None, True, False

    def look(self, now_us: int) -> bool:
        """Let time pass; return whether `down` changed."""
        heard_us, seen_us, was, silent_us = self.heard_us, self._seen_us, self.down, self._silent_us
        if heard_us is None:
            return False
        self._seen_us = now_us
        if seen_us is not None and now_us - seen_us > self._stood_us:
            self.stood_us = now_us
        if seen_us is not None and was is None:
            self.up_us += min(now_us - seen_us, silent_us)  # this process may have been held up
        down, asked_us = None, self._unanswered_us
        if now_us - heard_us > silent_us:
            # An earlier question could not be answered; it is repeated once the vehicle is heard again.
            down, self._unanswered_us = SILENT, None
        elif asked_us is not None and now_us - asked_us > self._unanswered_limit_us and (self.answers or self.strict):
            down, self.mute = UNANSWERED, True
        self.down = down
        return was != down
