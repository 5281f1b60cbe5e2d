"""The examination: a driver that also asks the doctor's questions and keeps the frames of every sender. It sends what
any driver sends before a flight except the fence, and questions: all of it is housekeeping, and passes the frame
session. Nothing is armed, moved, set or uploaded.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from rtshcua.adapters.doctor.settings import SETTINGS
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.link import DatagramContents, is_radio
from rtshcua.adapters.vehicle.parameters import VehicleParameters
from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.signing import FrameVerifier
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.ports import Clock, Event, Readings, StatusText

_ASK_US: Final = 1_000_000
_ONCE: Final = ("AUTOPILOT_VERSION", "HOME_POSITION", "SYSTEM_TIME")
_MOST_TEXTS: Final = 20
_MOST_TALKERS: Final = 64
_LONG_AGO: Final = 64  # a sequence number that goes back by less than this came out of order; nothing is missing


@dataclass(slots=True)
class Talker:
    """One component of one system: its frames, how many are missing, and how many were signed."""

    frames: int = 0
    missing: int = 0
    signed: int = 0
    kind: int | None = None  # MAV_TYPE of its heartbeat,
    autopilot: int | None = None  # and MAV_AUTOPILOT
    sequence: int | None = None

    def hear(self, frame: ReceivedFrame) -> None:
        """Count one frame."""
        if self.sequence is not None:
            gap = (frame.sequence - self.sequence - 1) % 256
            self.missing += gap if gap < 256 - _LONG_AGO else 0
        self.sequence = frame.sequence
        self.frames += 1
        self.signed += frame.signed
        if frame.name == "HEARTBEAT":
            self.kind, self.autopilot = frame.message.type, frame.message.autopilot


@dataclass(slots=True)
class Stream:
    """One message of the vehicle: how often it came, the first and last time (us), and the last message."""

    count: int
    first_us: int
    last_us: int
    latest: Any

    @property
    def interval_us(self) -> int | None:
        """The mean interval; None for a single message."""
        return (self.last_us - self.first_us) // (self.count - 1) if self.count > 1 else None


class ExaminingDriver(Driver):
    """Listens and asks. `talkers` by (system, component); `streams` of the vehicle's components by name."""

    judges = True

    def __init__(
        self, policy: Policy, clock: Clock, frames: FrameSession, verifier: FrameVerifier | None = None,
        system: int | None = None, steps: Sequence[Invocation] = (), meant: Mapping[str, int] | None = None,
    ) -> None:  # fmt: skip
        super().__init__(policy, frames, fence=False, verifier=verifier, system=system, steps=steps, meant=meant)
        self.talkers: dict[tuple[int, int], Talker] = {}
        self.streams: dict[str, Stream] = {}
        self.texts: list[str] = []  # its first few texts, once each
        self.ahead_us: int | None = None  # the vehicle's UTC minus ours
        self.answered = False  # it answered a request other than TIMESYNC
        self.values: dict[int, int | None] = {}  # the policy's signals by state slot, as a run would read them
        self.told: dict[int, Stream] = {}  # how often each was reported by the selected instance and component
        self.parameters: VehicleParameters | None = None
        self._clock = clock
        self._ears = Codec(0, 0)
        self._asked_us: int | None = None
        self._heard_us = 0
        # what the autopilot itself reports is not taken from another component, as in a run
        self._of_autopilot: set[str] = set()

    def receive(self, datagram: bytes, now_us: int) -> DatagramContents:
        """Like any driver, and keep who sends and what accepted frames report."""
        self._heard_us = now_us
        heard = super().receive(datagram, now_us)
        self._meet(datagram, now_us)
        for frame in heard.frames:
            if frame.system == self.system or is_radio(frame):
                self._examine(frame, now_us)
        self._note(heard.events)
        return heard

    def overhear(self, datagram: bytes, now_us: int) -> None:
        """Take in a datagram of another sender at this port; one under the vehicle's id is not counted."""
        super().overhear(datagram, now_us)
        self._meet(datagram, now_us, but=self.system)

    def tick(self, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Like any driver, and put the questions that are due."""
        events, frames = super().tick(now_us)
        self._note(events)
        flavour = self.flavour
        if flavour is None:
            return events, frames
        if self.parameters is None:
            self.parameters = VehicleParameters(bytewise=flavour.bytewise)
            for name in dict.fromkeys((*(setting.parameter for setting in SETTINGS[flavour.name]), *self.meant)):
                self.parameters.read(name)
        send: list[Any] = self.parameters.due(self.system, now_us)
        if self._asked_us is None or now_us - self._asked_us >= _ASK_US:
            self._asked_us = now_us
            send += [messages.request(self.system, name) for name in _ONCE if not self._told(name)]
        return events, frames + self._pack(send, now_us, events)

    def _told(self, name: str) -> bool:
        """Whether it reported a requested message; before its receiver has the time it reports that it has none."""
        return name in self.streams and (name != "SYSTEM_TIME" or self.ahead_us is not None)

    def latest(self, name: str) -> Any:
        """The last message of a name; None if there was none."""
        stream = self.streams.get(name)
        return None if stream is None else stream.latest

    def _meet(self, datagram: bytes, now_us: int, but: int | None = None) -> None:
        """Count each valid frame of any sender, accepted or not."""
        for frame in self._ears.parse(datagram, now_us):
            key = (frame.system, frame.component)
            if frame.system != but and (key in self.talkers or len(self.talkers) < _MOST_TALKERS):
                self.talkers.setdefault(key, Talker()).hear(frame)

    def _count(self, slot: int) -> None:
        now_us, told = self._heard_us, self.told.get(slot)
        if told is None:
            self.told[slot] = Stream(1, now_us, now_us, None)
        else:
            told.count, told.last_us = told.count + 1, now_us

    def _examine(self, frame: ReceivedFrame, now_us: int) -> None:
        """Take in one frame of the vehicle."""
        name, message = frame.name, frame.message
        if frame.component == AUTOPILOT:
            if name not in self._of_autopilot:
                self._of_autopilot.add(name)
                self.streams.pop(name, None)
        elif name in self._of_autopilot:
            return
        stream = self.streams.get(name)
        if stream is None:
            self.streams[name] = Stream(1, now_us, now_us, message)
        else:
            stream.count, stream.last_us, stream.latest = stream.count + 1, now_us, message
        if name == "PARAM_VALUE" and self.parameters is not None:
            self.parameters.take(message)
        if frame.component != AUTOPILOT:
            return
        match name:
            case "COMMAND_ACK" | "PARAM_VALUE" | "AUTOPILOT_VERSION":
                self.answered = True
            case "SYSTEM_TIME" if message.time_unix_usec:
                self.ahead_us = message.time_unix_usec - self._clock.now().utc_us

    def _note(self, events: Iterable[Event]) -> None:
        for event in events:
            if isinstance(event, Readings):
                self.values.update(event.values)
                for slot, _ in event.values:
                    self._count(slot)
            elif isinstance(event, StatusText) and event.text not in self.texts and len(self.texts) < _MOST_TEXTS:
                self.texts.append(event.text)
