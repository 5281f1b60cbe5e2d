"""A vehicle without its socket: frames in, events and frames out, time given; for real and virtual time."""

from collections.abc import Mapping, Sequence
from functools import partial

from rtshcua.adapters.ardupilot.flavour import ARDUPILOT
from rtshcua.adapters.px4.flavour import PX4
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.announcer import Announcer
from rtshcua.adapters.vehicle.commander import Commander
from rtshcua.adapters.vehicle.crash import CrashWatch
from rtshcua.adapters.vehicle.datum import NoDatum
from rtshcua.adapters.vehicle.estimator import STALE_US, Estimator
from rtshcua.adapters.vehicle.flavour import Flavour, Message, Stages, mode_name
from rtshcua.adapters.vehicle.link import Heard, Link
from rtshcua.adapters.vehicle.link_watch import SILENT, UNANSWERED, LinkWatch
from rtshcua.adapters.vehicle.manoeuvre import Aids, Manoeuvre
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.adapters.vehicle.preflight import HEEDED, Preflight
from rtshcua.adapters.vehicle.progress import Brakes
from rtshcua.adapters.vehicle.source_time import SourceTime
from rtshcua.adapters.vehicle.streams import ALWAYS, AT_TIMES, Streams
from rtshcua.adapters.vehicle.telemetry import Telemetry
from rtshcua.adapters.vehicle.texts import Texts
from rtshcua.codec.frames import Received
from rtshcua.mavlink.signing import Verifier
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import OURS, Gate
from rtshcua.onboard.ports import (
    AirState,
    Command,
    Crashed,
    Event,
    Failed,
    LinkBack,
    LinkLost,
    Noted,
    Readings,
    Ready,
    Said,
    Sent,
    TakenOver,
)

COMPONENT = OURS
HEARTBEAT_US = 1_000_000

_AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_WITHIN_STALE = 8  # so that a poor link does not silence the estimator
_FLAVOURS = {flavour.autopilot: flavour for flavour in (PX4, ARDUPILOT)}


class Driver:
    """One vehicle, chosen by the first heartbeat of an autopilot that we know; frames of other systems do not count.

    `slack` stretches every wait for an answer or an effect. It is 1, but for a simulated vehicle that lives so much
    faster than life that the machine's own hold-ups would count as silence. `fence` False: the vehicle's own fence is
    left as it is. Whatever is sent goes out through `frames`; with a `verifier` only what it accepts comes in.
    `manoeuvres` are ways to fly by flavour (`px4`) and by flavour and skill (`px4.spray_area`): see `adapters.packs`.
    With a `system` only the autopilot of this MAVLink system id is chosen; without, it is not ready beside another one.
    """

    def __init__(
        self, policy: Policy, frames: Gate, slack: int = 1, *, fence: bool = True,
        verifier: Verifier | None = None, manoeuvres: Mapping[str, Stages] | None = None,
        system: int | None = None,
    ) -> None:  # fmt: skip
        self._policy = policy
        self._fence = fence
        self._manoeuvres = manoeuvres or {}
        self._telemetry = Telemetry(policy)
        self._streams = Streams({}, ())
        self._preflight: Preflight | None = None
        self._texts = Texts()
        self._announcer = Announcer()
        self.link = Link(frames, verifier, system)
        self.source = SourceTime()
        self._flavour: Flavour | None = None
        self._seen = Observed()
        self._system = 0
        self._commander = Commander(slack)
        self._aids: Aids | None = None
        self._manoeuvre: Manoeuvre | None = None
        self._others: str | None = None  # what showed that somebody else flies it: nothing of ours is begun any more
        self._unsent: int | None = None  # the token of a command of which no frame left yet
        self._moving = False  # a frame that moves the vehicle is among those to be packed
        self._watch = LinkWatch(slack)
        self._crash = CrashWatch()
        self._spoken: set[str] = set()
        self._beat_us: int | None = None
        self._was_ready = False
        self._released = False
        self._was_air: tuple[bool, bool] | None = None
        self._heeded: set[str] = set()  # what more is made of than readings

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
        if self._preflight is None or self._seen.airborne:
            return self.link.crowd or self._seen.unready
        preflight = self._preflight
        waits = self.link.crowd or self.source.unready or self._mute or preflight.astray
        return waits or self._seen.unready or preflight.unready

    @property
    def _mute(self) -> str | None:
        """Before anything flies it must have answered: its mode has to be known before each frame that moves it."""
        return None if self._watch.answers else "it answers nothing that it is asked"

    def overhear(self, datagram: bytes, now_us: int) -> None:
        """Take in a datagram of another sender than the vehicle's."""
        self.link.overhear(datagram, now_us)

    def receive(self, datagram: bytes, now_us: int) -> Heard:
        """Take in a datagram; whatever its bytes, never raises."""
        events: list[Event] = []
        send: list[Message] = []
        received = self.link.parse(datagram, now_us)
        for frame in received:
            if self._flavour is None:
                self._choose(frame)
            if frame.system == self._system and self._flavour is not None:
                if frame.component == _AUTOPILOT:
                    self._watch.heard(now_us)
                    self._look(now_us, events)
                told = self._take(frame, now_us, events, send)
                if told or (self._manoeuvre is not None and now_us >= self._manoeuvre.due_us):
                    self._advance(now_us, send, events)
        return Heard(events, self._pack(send, now_us, events) if send else [], received)

    def tick(self, now_us: int) -> tuple[list[Event], list[bytes]]:
        """What is due at a time: heartbeat, requests for streams, retries, a link that went down."""
        if self._flavour is None:
            return [], []
        send: list[Message] = []
        events: list[Event] = []
        if self._beat_us is None or now_us - self._beat_us >= HEARTBEAT_US:
            self._beat_us = now_us
            send.append(messages.heartbeat())
        self._seen.pass_time(now_us)
        send += map(messages.time_sync, self.source.due(now_us))
        send += self._streams.due(self._system, now_us)
        send += self._prepare(now_us)
        self._hear(self._texts.due(now_us), events)
        self._look(now_us, events)
        self._advance(now_us, send, events)
        send += self._ask(now_us)
        if not self._was_ready and self._is_ready(now_us):
            self._was_ready = True
            events.append(Ready(now_us, self._flown_by_others()))
        events += self._notes(now_us)
        send += self._announcer.due(now_us, busy=bool(send) or self._commander.waits)
        return events, self._pack(send, now_us, events)

    def begin(self, command: Command, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Start a manoeuvre in place of the one under way. Raises RuntimeError before a vehicle was heard.

        What goes out may be a question only: a frame that moves the vehicle waits until its mode is known.
        """
        if self._flavour is None or self._aids is None:
            raise RuntimeError("no vehicle has been heard yet, so nothing can be commanded")
        if self._others is not None:  # also where this was on its way while the takeover showed
            return [Failed(now_us, command.token, "taken-over", self._others)], []
        self.link.begin()
        before = frozenset[int]() if self._manoeuvre is None else self._manoeuvre.modes
        try:
            stages = self._way(self._flavour, command)(command, self._seen, self._system)
        except NoDatum as error:
            return [Failed(now_us, command.token, "no-datum", str(error))], []
        except Exception as error:  # noqa: BLE001  a pack's code: whatever it raises, its skill has failed
            return [Failed(now_us, command.token, "broken-manoeuvre", str(error))], []
        self._manoeuvre = Manoeuvre(command, self._aids, self._seen, stages, before)
        self._unsent = command.token
        events: list[Event] = []
        send: list[Message] = []
        self._advance(now_us, send, events)
        return events, self._pack(send, now_us, events)

    def _way(self, flavour: Flavour, command: Command) -> Stages:
        """How this skill is flown: in a way of its own, if a pack brings one, else as any of its kind."""
        own = self._manoeuvres.get(f"{flavour.name}.{command.skill}")
        return own or self._manoeuvres.get(flavour.name, flavour.stages)

    def release(self) -> None:
        """Stand down: nothing that moves the vehicle is sent any more."""
        self._manoeuvre, self._unsent, self._released = None, None, True

    def announce(self, severity: int, text: str) -> None:
        """Tell any ground station; goes out with a later `tick`, when the link has nothing better to do."""
        self._announcer.add(severity, text)

    def _choose(self, frame: Received) -> None:
        if frame.name != "HEARTBEAT" or frame.component != _AUTOPILOT:
            return
        flavour = self._flavour = _FLAVOURS.get(frame.message.autopilot)
        if flavour is not None:
            self._system = frame.system
            self.link.settle(frame.system)
            self._seen.estimator = Estimator(flavour.estimator)
            wanted = {**self._telemetry.intervals, **ALWAYS, flavour.estimator: STALE_US // _WITHIN_STALE}
            self._streams = Streams(wanted, self._telemetry.sources, AT_TIMES)
            slack = self._commander.slack
            self._aids = Aids(flavour, Brakes.of(self._policy.vehicle), self._commander)
            self._preflight = Preflight(self._policy, flavour, self._seen, fence=self._fence, slack=slack)
            self._heeded = {*self._seen.heeded, *HEEDED, "STATUSTEXT"}

    def _take(self, frame: Received, now_us: int, events: list[Event], send: list[Message]) -> bool:
        """Take in one frame; False if a manoeuvre sees nothing new in it."""
        name, message, component = frame.name, frame.message, frame.component
        at_us = self.source.of(frame, now_us)
        if self.source.stepped:
            self._seen.made_us.clear()
        if component == _AUTOPILOT:
            self._spoken.add(name)
        elif name in self._spoken:
            return False  # what the autopilot itself tells is not taken from anybody else
        if name == "COMMAND_ACK":
            self._acknowledge(frame, now_us)
            return True
        self._streams.heard(name, now_us)
        if name in self._telemetry.carriers:
            values = self._telemetry.read(name, message, component, partial(self._vouched, name, now_us))
            if values and at_us is not None:
                events.append(Readings(at_us, values))
        if component != _AUTOPILOT or name not in self._heeded:
            return False
        before = self._seen.mode
        self._seen.take(name, message, now_us, at_us)
        crashed = self._crash.look(self._seen, now_us)
        if crashed is not None:
            events.append(Crashed(now_us, crashed))
            self._others = "crashed"
        match name:
            case "HEARTBEAT":
                self._watch_mode(before, now_us, events)
            case "ATTITUDE":
                return False
            case "STATUSTEXT":
                self._hear(self._texts.take(message, now_us), events)
            case _ if self._preflight is not None and self._is_for_us(message):
                send += self._preflight.take(name, message, self._system, now_us)
        air = (self._seen.armed, self._seen.airborne)
        if air != self._was_air and self._seen.landed_state:
            self._was_air = air
            events.append(AirState(now_us, *air))
        return True

    def _acknowledge(self, frame: Received, now_us: int) -> None:
        message = frame.message
        if frame.component != _AUTOPILOT or not self._is_for_us(message):
            return
        self._watch.answered()
        if message.command == messages.SET_INTERVAL:
            self._streams.answered(message.result == 0, now_us)
        else:
            self._commander.acknowledge(message.command, message.result, self._seen.up_us)

    def _is_for_us(self, message: Message) -> bool:
        return getattr(message, "target_component", 0) in (0, COMPONENT)

    def _vouched(self, name: str, now_us: int, field: str) -> bool:
        return self._seen.estimator.vouches_for(name, field, now_us)

    def _hear(self, said: Sequence[Said], events: list[Event]) -> None:
        for each in said:
            self._seen.say(each.severity, each.text)
            events.append(each)

    def _watch_mode(self, before: int | None, now_us: int, events: list[Event]) -> None:
        """In the air, and outside of any manoeuvre of ours, too, whoever changes the mode has taken over."""
        mode, flavour = self._seen.mode, self._flavour
        if self._manoeuvre is not None or self._released or not self._seen.airborne or mode is None or flavour is None:
            return
        if before not in (None, mode) and (before, mode) not in flavour.natural:
            self._others = mode_name(flavour, mode)
            events.append(TakenOver(now_us, self._others))

    def _prepare(self, now_us: int) -> list[Message]:
        """On the ground, before it is ready: what has to be settled with the vehicle."""
        if self._preflight is None or self._was_ready or not self._seen.down:
            return []
        return self._preflight.due(self._system, now_us)

    def _notes(self, now_us: int) -> list[Event]:
        told = [self._seen.notes, self._streams.notes]
        if self._preflight is not None:
            told.append(self._preflight.notes)
        if not any(told):
            return []
        events: list[Event] = [Noted(now_us, text) for notes in told for text in notes]
        for notes in told:
            notes.clear()
        return events

    def _look(self, now_us: int, events: list[Event]) -> None:
        """Whether the link is up, and how long it was so far."""
        was = self._watch.down
        if self._watch.look(now_us):
            events += self._link_changed(was, self._watch.down, now_us)
        self._seen.up_us = self._watch.up_us

    def _link_changed(self, was: str | None, down: str | None, now_us: int) -> list[Event]:
        """What is made of it: one that is heard and does not hear us may still be sent what stops it."""
        events: list[Event] = []
        if SILENT in (was, down):
            self._streams.interrupted()
            events.append(LinkBack(now_us) if was == SILENT else LinkLost(now_us, SILENT, self._watch.heard_us or 0))
        if UNANSWERED in (was, down):
            events.append(
                Noted(now_us, "it is heard, but answers nothing" if down == UNANSWERED else "it answers again")
            )
        return events

    def _advance(self, now_us: int, send: list[Message], events: list[Event]) -> None:
        """Go on with the manoeuvre; where a frame of it waits for the mode, ask at once."""
        manoeuvre = self._manoeuvre
        if manoeuvre is None:
            return
        try:
            out, happened = manoeuvre.advance(self._seen, now_us)
        except Exception as error:  # noqa: BLE001  see `begin`
            events += self._break(manoeuvre, error, now_us)
            return
        self._moving = self._moving or bool(out)
        send += out
        events += happened
        for event in happened:
            if isinstance(event, TakenOver):
                self._others = event.how
        if manoeuvre.waits:
            send += self._ask(now_us)

    def _ask(self, now_us: int) -> list[Message]:
        """Ask for the mode, if it is time to."""
        if self._aids is None or self._released:
            return []
        flies = self._seen.airborne or (self._manoeuvre is not None and not self._manoeuvre.over)
        asks = self._aids.mode.due(self._system, self._seen, now_us, flies=flies)
        if asks:
            self._watch.asked(now_us)
        return asks

    def _break(self, manoeuvre: Manoeuvre, error: Exception, now_us: int) -> list[Event]:
        if manoeuvre.over:
            return []
        manoeuvre.over = True
        return [Failed(now_us, manoeuvre.token, "broken-manoeuvre", str(error))]

    def _flown_by_others(self) -> str:
        """How it flies already, if nothing of ours would make it; what lands is left to it."""
        seen, flavour = self._seen, self._flavour
        if not seen.airborne or flavour is None or seen.mode is None:
            return ""
        if seen.landing:
            return "landing"
        return "" if seen.mode in flavour.ours else mode_name(flavour, seen.mode)

    def _is_ready(self, now_us: int) -> bool:
        seen = self._seen
        if self.link.crowd is not None or not seen.ready or not self._streams.settled(now_us):
            return False
        if seen.airborne:
            return True
        if self._mute is not None or self.source.unready is not None:
            return False
        return self._preflight is None or self._preflight.unready is None

    def _pack(self, send: Sequence[Message], now_us: int, events: list[Event]) -> list[bytes]:
        """The frames that the boundary lets out. A manoeuvre that it stops has failed."""
        frames, refused = self.link.pack(send, now_us)
        moving, self._moving = self._moving, False
        if refused and self._manoeuvre is not None and not self._manoeuvre.over:
            self._manoeuvre.over = True
            events.append(Failed(now_us, self._manoeuvre.token, refused[0].slug))
        elif moving and not refused and self._unsent is not None:
            events.append(Sent(now_us, self._unsent))
            self._unsent = None
        return frames
