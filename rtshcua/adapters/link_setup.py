"""SETUP_SIGNING: a link key is put on the vehicle, on the ground, and what that does is observed, not assumed.

https://mavlink.io/en/guide/message_signing.html ("Secret Key Management"): the key crosses the link as it is, so
somebody has to vouch for the link, and there is no acknowledgement. So the effect is asked for: requests with and
without a signature go out in turn, and what is answered is reported. Silence counts only between two answers.

This is no part of a flight: it has no permit, and the frames below are all that it ever sends. What it learns of an
autopilot by its release is in `after_setup`, with the sources.
"""

import select
from collections.abc import Callable, Generator, Hashable
from functools import partial
from typing import Any, Final, NamedTuple, TypeVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.transport import Transport
from rtshcua.codec.frames import Codec, ReceivedFrame, is_addressed
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import enums
from rtshcua.mavlink.modes import ARDUPILOT, PX4, is_vehicle
from rtshcua.mavlink.signing import SignedLink, SigningState

_AUTOPILOT: Final = enums.MAV_COMP_ID_AUTOPILOT1
_OURS: Final = enums.MAV_COMP_ID_ONBOARD_COMPUTER
_NAMES: Final = {PX4: "px4", ARDUPILOT: "ardupilot"}

#: us: how long to wait for a heartbeat, then for another vehicle, then for its reports
_HEARTBEAT_US: Final = 10_000_000
_ANOTHER_US: Final = 1_500_000
_TELL_US: Final = 6_000_000
#: how old a report of the motors or the ground may be when the key is sent
_FRESH_US: Final = 2_500_000
_SAFE: Final = "a key can only be set on a vehicle that is disarmed and on the ground"
#: how long a key may take to take effect, and how often it is sent
_SHOW_US: Final = 1_500_000
_TRIES: Final = 3
#: the least time for an answer; on slow links, this many round trips
_ANSWER_US: Final = 1_000_000
_ROUND_TRIPS: Final = 4
#: requests of each kind
_ROUNDS: Final = 2
_AGAIN_US: Final = 500_000
_GREET_US: Final = 1_000_000
_MOST_TEXTS: Final = 8
_WAIT_S: Final = 0.02

_T = TypeVar("_T")
#: a part of the procedure: yields while it waits, and returns a value at the end
_Part = Generator[None, None, _T]


class SetUp(NamedTuple):
    """The result. `release` is that of AUTOPILOT_VERSION; `already`: it had the key, and nothing was sent."""

    autopilot: str
    system: int
    release: tuple[int, int, int] | None
    already: bool
    signs: bool
    answers_signed: bool
    answers_unsigned: bool
    texts: tuple[str, ...]
    """What it said meanwhile (STATUSTEXT); as it came, to be shown as what others say."""

    @property
    def insists(self) -> bool:
        """Whether the key is effective on this link: only signed frames are answered."""
        return self.signs and self.answers_signed and not self.answers_unsigned


def after_setup(autopilot: str, release: tuple[int, int, int] | None) -> str:
    """How an autopilot of this release uses a key, in words. Sources: ArduPilot `GCS_Signing.cpp`, pull requests 10311
    (not while armed) and 29546 (MAVn_OPTIONS), and `tests/recorded` (both channels); PX4 pull requests 25284 (1.17) and
    26894 (1.18), the page "MAVLink Message Signing" of its guide, and the release notes of 1.18.
    """
    if autopilot == "ardupilot":
        also = ", nor on a port where MAVn_OPTIONS switches signing off" if release is None or release >= (4, 7) else ""
        return (
            "ArduPilot keeps the key in its storage over restarts, signs on every port, and obeys nothing unsigned but "
            f"RADIO_STATUS; this does not hold on its first port (SERIAL0, usually USB){also}"
        )
    if release is None:
        return "PX4 accepts a key from 1.17 on; this one does not report its release"
    if release < (1, 17):
        return "PX4 before 1.17 does not know SETUP_SIGNING: it signs nothing and obeys every sender"
    if release < (1, 18):
        return (
            "PX4 1.17 takes a key over USB alone and keeps it on the SD card; it obeys nothing unsigned only with "
            "MAV_SIGN_CFG 1 (but over USB) or 2"
        )
    return (
        "PX4 from 1.18 on keeps the key on the SD card, signs on every link, and obeys nothing unsigned on any, "
        "USB included; another key must come signed with this one, or after the card's "
        "mavlink/mavlink-signing-key.bin was removed"
    )


class LinkSetup:
    """One set-up, with the time as an argument (us, monotonic). It ends with a `result`."""

    def __init__(
        self, key: bytes, utc_us: int, now_us: int, system: int | None = None, *, begins: bool = False
    ) -> None:
        """`system` selects one of several vehicles; `begins`: our side may send first on this transport."""
        self.result: SetUp | Refusal | None = None
        self._key = key
        self._link = SignedLink(key, SigningState(0, {}), utc_us, now_us)
        self._wanted = system
        self._begins = begins
        self._codec = Codec(0, 0)
        self._sender = Codec(system or 1, _OURS)
        self._steps = self._course()
        self._outbox: list[bytes] = []
        self._now_us = now_us
        self._greeted_us: int | None = None
        self._system = 0
        self._autopilot = 0
        self._kind = (0, 0)
        self._other: int | None = None
        self._armed: tuple[bool, int] | None = None  # and the time of that report
        self._landed: tuple[int, int] | None = None
        self._version: tuple[int, int, int] | None = None
        self._verified = self._answers = 0
        self._texts: list[str] = []

    @property
    def met(self) -> bool:
        """Whether a vehicle was heard."""
        return bool(self._system)

    def receive(self, octets: bytes, now_us: int) -> None:
        """Take in received octets."""
        self._now_us = now_us
        for frame in self._codec.parse(octets):
            self._hear(frame)

    def overhear(self, octets: bytes) -> None:
        """Take in the octets of another sender, only to detect another vehicle, under any id."""
        for frame in Codec(0, 0).parse(octets):
            if _is_autopilot(frame) and self._wanted in (None, frame.system):
                self._other = frame.system

    def tick(self, now_us: int) -> list[bytes]:
        """Continue; return the frames to send."""
        self._now_us = now_us
        if self.result is None:
            next(self._steps, None)
        if self._begins and not self.met and self._due(self._greeted_us, _GREET_US):
            self._greeted_us = now_us
            self._outbox.append(self._sender.pack(messages.heartbeat()))
        frames, self._outbox = self._outbox, []
        return frames

    # ---------------------------------------------------------------- receiving

    def _hear(self, frame: ReceivedFrame) -> None:
        message = frame.message
        if _is_autopilot(frame):
            self._meet(frame)
        if frame.system != self._system or frame.component != _AUTOPILOT:
            return
        if frame.signed:
            self._verified += self._link.accept(frame.frame, self._now_us)
        match frame.name:
            case "HEARTBEAT" if _kind(message) == self._kind:
                self._armed = bool(message.base_mode & enums.MAV_MODE_FLAG_SAFETY_ARMED), self._now_us
            case "EXTENDED_SYS_STATE":
                self._landed = message.landed_state, self._now_us
            case "AUTOPILOT_VERSION":
                major, minor, patch, _ = message.flight_sw_version.to_bytes(4)
                self._version = major, minor, patch
                self._answers += 1
            case "COMMAND_ACK" if message.command == enums.MAV_CMD_REQUEST_MESSAGE and self._is_ours(message):
                self._answers += 1
            case "STATUSTEXT" if len(self._texts) < _MOST_TEXTS and message.text not in self._texts:
                self._texts.append(message.text)

    def _is_ours(self, message: Any) -> bool:
        """Whether an answer is addressed to us: another ground station may request messages, too."""
        return is_addressed(message, self._system, _OURS)

    def _meet(self, frame: ReceivedFrame) -> None:
        if self._wanted is not None and frame.system != self._wanted:
            return
        if not self._system:
            self._system, self._autopilot, self._kind = frame.system, frame.message.autopilot, _kind(frame.message)
            self._sender = Codec(frame.system, _OURS)
        elif frame.system != self._system:
            self._other = frame.system

    # ---------------------------------------------------------------- the procedure

    def _course(self) -> _Part[None]:
        """The procedure, from the first heartbeat to the result."""
        if not (yield from self._until(lambda: self.met, _HEARTBEAT_US)):
            self.result = Refusal(
                "no-vehicle", "no heartbeat from a vehicle within 10 s", "check that it is on and sends to this address"
            )
            return
        yield from self._until(lambda: self._other is not None, _ANOTHER_US)
        if self._other is not None:
            text = f"several vehicles send there: system {self._system}, and another sender's {self._other}"
            if self._other != self._system:
                text = f"several vehicles send there: systems {self._system} and {self._other}"
            self.result = Refusal("two-vehicles", text, "`--system` selects one")
            return
        already = self._verified > 0
        if self._link.counts.forged and not already:
            self.result = Refusal(
                "other-key", "the vehicle signs with another key", "change the key with the ground station that "
                "has the present one, or remove the present one as the autopilot's documentation describes",
            )  # fmt: skip
            return
        answer_us = max(_ANSWER_US, _ROUND_TRIPS * (yield from self._ask(signed=already)))
        if self.result is None and not already:
            yield from self._send_key()
        if self.result is None:
            yield from self._probe(answer_us, already=already)

    def _ask(self, *, signed: bool) -> _Part[int]:
        """Ask for the release and whether it is on the ground; return the time of the first answer, in us."""
        begun_us = self._now_us
        asked_us: int | None = None
        took_us: int | None = None
        while self._now_us - begun_us < _TELL_US and not (self._version and self._is_fresh(self._landed)):
            if self._due(asked_us, _AGAIN_US):
                asked_us = self._now_us
                for name in ("AUTOPILOT_VERSION", "EXTENDED_SYS_STATE"):
                    self._request(name, signed=signed)
            yield
            if took_us is None and self._answers:
                took_us = self._now_us - begun_us
        if took_us is None:
            self.result = Refusal(
                "no-answer", "the vehicle is heard but answers nothing", "check that frames reach it; a vehicle that "
                "requires signatures of another key answers nobody else",
            )  # fmt: skip
        return took_us or 0

    def _send_key(self) -> _Part[None]:
        self.result = self._unfit()
        for _ in range(_TRIES):
            if self._unfit() is not None:  # the effect of a key that was sent before is tested all the same
                return
            stamp = self._link.state.timestamp
            setup = mavlink.MAVLink_setup_signing_message(self._system, _AUTOPILOT, list(self._key), stamp)
            self._outbox.append(self._sender.pack(setup))
            if (yield from self._until(lambda: self._verified > 0, _SHOW_US)):
                return
            self._landed = None
            self._request("EXTENDED_SYS_STATE", signed=False)
            yield from self._until(lambda: self._landed is not None, _ANSWER_US)

    def _unfit(self) -> Refusal | None:
        """Why no key is sent now; None where it may be."""
        if not self._is_fresh(self._armed) or not self._is_fresh(self._landed):
            help = "try again on the ground; a vehicle that never reports this is set up by a ground station"
            return Refusal("not-landed", "the vehicle does not report whether it is disarmed and on the ground", help)
        assert self._armed is not None
        assert self._landed is not None
        if self._armed[0]:
            return Refusal("armed", "the motors are armed", _SAFE)
        if self._landed[0] != enums.MAV_LANDED_STATE_ON_GROUND:
            return Refusal("not-landed", "the vehicle is not on the ground", _SAFE)
        return None

    def _probe(self, wait_us: int, *, already: bool) -> _Part[None]:
        """Send unsigned and signed requests in turn, and note which are answered."""
        answered = {False: False, True: True}
        verified = self._verified
        for _ in range(_ROUNDS):
            answered[False] |= yield from self._answered(wait_us, signed=False)
            # an earlier silence only counts if this one is answered
            answered[True] &= yield from self._answered(wait_us, signed=True)
        if not answered[True] and not answered[False]:
            text = (
                "the vehicle answers nothing"
                if already
                else "since the key was sent the vehicle answers nothing, signed or unsigned"
            )
            self.result = Refusal(
                "no-answer", text, "check the link; the same command again looks first and does not send the key twice"
            )
            return
        name = _NAMES[self._autopilot]
        signs = self._verified > verified
        self.result = SetUp(
            name, self._system, self._version, already, signs, answered[True], answered[False], tuple(self._texts)
        )

    def _answered(self, wait_us: int, *, signed: bool) -> _Part[bool]:
        for _ in range(_TRIES if signed else 1):
            answered_since = partial(self._has_answered, self._answers)
            self._request("AUTOPILOT_VERSION", signed=signed)
            if (yield from self._until(answered_since, wait_us)):
                # the rest of this answer must not count for the next request
                yield from self._until(lambda: False, _AGAIN_US)
                return True
        return False

    # ---------------------------------------------------------------- helpers

    def _has_answered(self, before: int) -> bool:
        return self._answers > before

    def _until(self, reached: Callable[[], bool], time_us: int) -> _Part[bool]:
        """Wait for a condition for at most this time; return whether it was met."""
        end_us = self._now_us + time_us
        while not reached() and self._now_us < end_us:
            yield
        return reached()

    def _request(self, name: str, *, signed: bool) -> None:
        frame = self._sender.pack(messages.request(self._system, name))
        self._outbox.append(self._link.sign(frame, self._now_us) if signed else frame)

    def _due(self, last_us: int | None, each_us: int) -> bool:
        return last_us is None or self._now_us - last_us >= each_us

    def _is_fresh(self, told: tuple[Any, int] | None) -> bool:
        return told is not None and self._now_us - told[1] <= _FRESH_US


def _kind(heartbeat: Any) -> tuple[int, int]:
    return heartbeat.type, heartbeat.autopilot


def _is_autopilot(frame: ReceivedFrame) -> bool:
    beats = frame.name == "HEARTBEAT" and frame.component == _AUTOPILOT
    return beats and is_vehicle(frame.message.type, frame.message.autopilot)


def carry_out(setup: LinkSetup, transport: Transport, now_us: Callable[[], int]) -> SetUp | Refusal:
    """Run a set-up over a transport, in real time."""
    peer: Hashable | None = None
    while setup.result is None:
        transport.tend(now_us())
        select.select(transport.readable(), [], [], _WAIT_S)
        while (received := transport.receive()) is not None:
            octets, sender = received
            if peer is not None and sender != peer:
                setup.overhear(octets)
                continue
            setup.receive(octets, now_us())
            peer = sender if setup.met else None
        for frame in setup.tick(now_us()):
            if peer is not None or transport.begins:
                transport.send(frame, peer)
    return setup.result
