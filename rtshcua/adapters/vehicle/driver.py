"""A vehicle without its socket: frames in, events and frames out, time given; for real and virtual time."""

from collections.abc import Sequence
from typing import NamedTuple

from rtshcua.adapters.ardupilot.flavour import ARDUPILOT
from rtshcua.adapters.px4.flavour import PX4
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.commander import Commander
from rtshcua.adapters.vehicle.flavour import Flavour, Message
from rtshcua.adapters.vehicle.manoeuvre import Manoeuvre
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.adapters.vehicle.streams import ALWAYS, Streams
from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.mavlink.frames import Codec, Received
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.ports import AirState, Command, Event, LinkBack, LinkLost, Readings, Ready, Sent

#: Component id of the onboard controller that mediates.
COMPONENT = 191
HEARTBEAT_US = 1_000_000
LINK_LOST_US = 3_000_000

_AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_FLAVOURS = {flavour.autopilot: flavour for flavour in (PX4, ARDUPILOT)}


class Heard(NamedTuple):
    """What a datagram brought: events, frames that answer it, and its good frames, for the raw log."""

    events: Sequence[Event]
    answers: Sequence[bytes]
    frames: Sequence[Received]


class Driver:
    """One vehicle, chosen by the first heartbeat of an autopilot that we know; frames of other systems do not count.

    `slack` stretches every wait for an answer or an effect. It is 1, but for a simulated vehicle that lives so much
    faster than life that the machine's own hold-ups would count as silence.
    """

    def __init__(self, policy: Policy, slack: int = 1) -> None:
        self._telemetry = Telemetry(policy)
        self._home_within = policy.vehicle.home_within
        self._streams = Streams({**self._telemetry.intervals, **ALWAYS}, self._telemetry.sources)
        self._codec = Codec(255, COMPONENT)
        self._flavour: Flavour | None = None
        self._seen = Observed()
        self._system = 0
        self._commander = Commander(slack)
        self._manoeuvre: Manoeuvre | None = None
        self._spoken: set[str] = set()
        self._beat_us: int | None = None
        self._silent = False
        self._was_ready = False
        self._was_air: tuple[bool, bool] | None = None

    @property
    def flavour(self) -> Flavour | None:
        """Which autopilot it is; None before its first heartbeat."""
        return self._flavour

    @property
    def seen(self) -> Observed:
        """What it was last seen to do."""
        return self._seen

    @property
    def unready(self) -> str | None:
        """What `Ready` waits for, in words; None once it was given, or when only streams are still to come."""
        if self._was_ready:
            return None
        return self._seen.unready or (None if self._seen.airborne else self._far_from_home())

    def receive(self, datagram: bytes, now_us: int) -> Heard:
        """Take in a datagram; whatever its bytes, never raises."""
        events: list[Event] = []
        send: list[Message] = []
        received = self._codec.parse(datagram)
        for frame in received:
            if self._flavour is None:
                self._choose(frame)
            if frame.system == self._system and self._flavour is not None:
                self._take(frame, now_us, events)
                self._advance(now_us, send, events)
        return Heard(events, self._pack(send), received)

    def tick(self, now_us: int) -> tuple[list[Event], list[bytes]]:
        """What is due at a time: heartbeat, requests for streams, retries, a link that fell silent."""
        if self._flavour is None:
            return [], []
        send: list[Message] = []
        events: list[Event] = []
        if self._beat_us is None or now_us - self._beat_us >= HEARTBEAT_US:
            self._beat_us = now_us
            send.append(messages.heartbeat())
        send += self._streams.due(self._system, now_us)
        heard_us = self._seen.heartbeat_us
        if not self._silent and heard_us is not None and now_us - heard_us > LINK_LOST_US:
            self._silent = True
            events.append(LinkLost(now_us))
        self._advance(now_us, send, events)
        if not self._was_ready and self._is_ready(now_us):
            self._was_ready = True
            events.append(Ready(now_us))
        return events, self._pack(send)

    def begin(self, command: Command, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Start a manoeuvre in place of the one under way. Raises RuntimeError before a vehicle was heard."""
        if self._flavour is None:
            raise RuntimeError("no vehicle has been heard yet, so nothing can be commanded")
        before = frozenset[int]() if self._manoeuvre is None else self._manoeuvre.modes
        stages = self._flavour.stages(command, self._seen, self._system)
        self._manoeuvre = Manoeuvre(command, self._flavour, self._seen, stages, self._commander, before)
        frames = self._pack(self._manoeuvre.start(self._seen, now_us))
        return [Sent(now_us, command.token)] if frames else [], frames

    def release(self) -> None:
        """Stand down: nothing that moves the vehicle is sent any more."""
        self._manoeuvre = None

    def _choose(self, frame: Received) -> None:
        if frame.name != "HEARTBEAT" or frame.component != _AUTOPILOT:
            return
        self._flavour = _FLAVOURS.get(frame.message.autopilot)
        if self._flavour is not None:
            self._system = frame.system
            self._codec = Codec(frame.system, COMPONENT, only={frame.system})

    def _take(self, frame: Received, now_us: int, events: list[Event]) -> None:
        name, message = frame.name, frame.message
        if frame.component == _AUTOPILOT:
            self._spoken.add(name)
        elif name in self._spoken:
            return  # what the autopilot itself tells is not taken from anybody else
        if name == "COMMAND_ACK":
            self._acknowledge(frame, now_us)
            return
        self._streams.heard(name, now_us)
        values = self._telemetry.read(name, message, frame.component)
        if values:
            events.append(Readings(now_us, values))
        if frame.component != _AUTOPILOT:
            return
        self._seen.take(name, message, now_us)
        if name == "HEARTBEAT" and self._silent:
            self._silent = False
            events.append(LinkBack(now_us))
        air = (self._seen.armed, self._seen.airborne)
        if air != self._was_air and self._seen.landed_state:
            self._was_air = air
            events.append(AirState(now_us, *air))

    def _acknowledge(self, frame: Received, now_us: int) -> None:
        message = frame.message
        if frame.component != _AUTOPILOT or message.target_component not in (0, COMPONENT):
            return
        if message.command == messages.SET_INTERVAL:
            self._streams.answered(message.result == 0)
        else:
            self._commander.acknowledge(message.command, message.result, now_us)

    def _advance(self, now_us: int, send: list[Message], events: list[Event]) -> None:
        if self._manoeuvre is not None:
            out, happened = self._manoeuvre.advance(self._seen, now_us)
            send += out
            events += happened

    def _is_ready(self, now_us: int) -> bool:
        seen = self._seen
        return seen.ready and self._streams.settled(now_us) and (seen.airborne or self._far_from_home() is None)

    def _far_from_home(self) -> str | None:
        """On the ground, where it stands becomes its home, which all of the policy is drawn around."""
        away = self._telemetry.distance_from_home(self._seen.latitude, self._seen.longitude)
        if away <= self._home_within:
            return None
        return f"it stands {away // 1_000} m from the policy's home, more than {self._home_within // 1_000} m"

    def _pack(self, send: Sequence[Message]) -> list[bytes]:
        return [self._codec.pack(message) for message in send]
