"""Drive a vehicle without a socket: take in frames, return events and frames. The caller passes the time, so the driver
serves real and virtual time.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from msgspec.structs import replace

from rtshcua.adapters.vehicle import messages, observed, others, preflight
from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.drain import Consumption
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, Stage, Stages
from rtshcua.adapters.vehicle.image_observer import OF_AUTOPILOT, OF_CAMERA, ImageObserver
from rtshcua.adapters.vehicle.link import (
    NO_VEHICLE,
    SILENT,
    UNANSWERED,
    DatagramContents,
    LinkWatch,
    VehicleLink,
    command_of,
    is_radio,
    refusal_of,
    two_speak,
)
from rtshcua.adapters.vehicle.manoeuvre import Aids, Commander, Manoeuvre, sendings
from rtshcua.adapters.vehicle.messages import Announcer, Message, StatusTexts
from rtshcua.adapters.vehicle.observed import STALE_US, Estimator, NoDatum, ObservedVehicle
from rtshcua.adapters.vehicle.parameters import VehicleParameters
from rtshcua.adapters.vehicle.payload_sender import HEEDED as OF_PAYLOAD
from rtshcua.adapters.vehicle.payload_sender import PICTURES, PayloadSender
from rtshcua.adapters.vehicle.preflight import Preflight
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.adapters.vehicle.restart import arrives, flown_by, modes_of
from rtshcua.adapters.vehicle.source_time import EACH_US, SourceTime
from rtshcua.adapters.vehicle.streams import (
    AT_TIMES,
    IN_THE_AIR,
    PATIENCE_REFUSED_US,
    PATIENCE_US,
    StreamPlan,
    StreamRequests,
    plan_streams,
)
from rtshcua.adapters.vehicle.supervision import Brakes, CrashWatch
from rtshcua.adapters.vehicle.telemetry import Batteries, Telemetry
from rtshcua.codec.frames import ReceivedFrame, is_addressed
from rtshcua.decision.rates import AT_LEAST, SUFFICES, Rate
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.mavlink.enums import MAV_MODE_FLAG_SAFETY_ARMED as ARMED
from rtshcua.mavlink.enums import MULTIROTORS
from rtshcua.mavlink.modes import is_another, is_vehicle
from rtshcua.mavlink.parameters import value_of
from rtshcua.mavlink.signing import FrameVerifier
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard import ports
from rtshcua.onboard.enforcement.allow_list import CAMERAS
from rtshcua.onboard.enforcement.frames import OURS, Gate
from rtshcua.onboard.left import Left
from rtshcua.onboard.ports import Command, Event, StatusText

HEARTBEAT_US = 1_000_000
#: how often a heard autopilot is asked for its identity
WHO_US = 200_000
#: how long cameras have to answer how many images they have taken, before a landing
LISTED_US = 2_000_000
#: how long an obstacle that waiting cannot remove must persist before it is reported: somebody may be correcting it
UNFIT_US = 5_000_000
#: why a vehicle that signs does not answer unsigned frames
KEYLESS = "the vehicle signs its frames and answers no unsigned frame: give the link's key with `--signing-key`"

_UNDATED = "the time of day is not known yet, and no step is decided without it: waiting for the vehicle's SYSTEM_TIME"
_YOUNG = "the time of day is not certain enough yet: the mission might have been issued in the future"
_WITHIN_STALE = 8  # reports of the estimator within the time to stale, because a poor link loses some
#: how many other senders under the vehicle's ids are reported: an attacker can make up 65,536
_MOST_STRANGERS = 8
_OF_PREFLIGHT = frozenset(preflight.HEEDED)
_FLAVOURS = {flavour.autopilot: flavour for flavour in (PX4, ARDUPILOT)}


class GroundQuestions(Protocol):
    """Questions to a vehicle before it flies. They are housekeeping: nothing waits for the answers."""

    def due(self, system: int, now_us: int) -> Sequence[Message]:
        """Return the messages to send now."""
        ...

    def take(self, name: str, message: Message) -> None:
        """Take in a message of the autopilot."""
        ...


class Driver:
    """One vehicle: the sender of the first heartbeat of a known autopilot. Frames of other systems are ignored, and so
    are heartbeats under its ids that name another type of vehicle or another autopilot.

    All frames are sent through `frames`; with a `verifier` only frames that it accepts are received. With `system`,
    only the autopilot of this MAVLink system id is chosen; without, the vehicle is not ready while another one sends.
    `slack` multiplies each timeout. It is 1, except for a simulated vehicle that runs faster than real time, where
    delays of this machine would otherwise count as silence. `fence` False leaves the vehicle's own fence unchanged.
    `manoeuvres` holds the stages of packs, by flavour (`px4`) or by flavour and skill (`px4.spray_area`): see
    `adapters.packs`. `steps` are the steps of the mission; their deadlines determine the telemetry rates. `meant` holds
    parameters that a flight would set: the vehicle is judged with these values, but nothing is set.
    """

    #: report what would prevent a flight although nothing is set: for an examination
    judges = False
    #: the parameters of a preparation are being set (`adapters.preparation`): not ready, and no fence is uploaded
    prepares = False
    #: request the vehicle's time of day until it is known
    asks_utc = False
    #: how long to wait for it before anything begins, once nothing else is missing
    utc_patience_us = 0
    #: before this time the mission might have been issued in the future, so nothing begins
    issued_from_us = 0
    #: further questions to a vehicle on the ground; it gets each of the vehicle's messages
    asks: GroundQuestions | None = None
    #: the same in the air too, to identify a vehicle that an earlier run left flying
    asks_first: GroundQuestions | None = None
    #: an earlier run broke off: an armed vehicle may have been commanded to take off, so it counts as flying
    resumes = False
    #: what that run may have left the vehicle doing; None: unknown
    left: Left | None = None
    #: ask any autopilot for its identity at once, without waiting up to a second for its next heartbeat
    hurries = False
    #: the autopilot's flavour; None before its first heartbeat, which also sets the next six
    flavour: AutopilotFlavour | None = None
    stream_requests: StreamRequests  # the requested streams and their measured rates
    preflight: Preflight  # compares the vehicle with the policy
    settings: VehicleParameters  # reads and sets the parameters of a preparation
    _aids: Aids
    _heeded: set[str]  # messages that are used for more than readings
    _kind = (0, 0)  # MAV_TYPE and MAV_AUTOPILOT of the vehicle
    system = 0
    #: that it is not a multirotor, in words
    other_kind: str | None = None

    def __init__(
        self, policy: Policy, frames: Gate, slack: int = 1, *, fence: bool = True,
        verifier: FrameVerifier | None = None, manoeuvres: Mapping[str, Stages] | None = None,
        system: int | None = None, steps: Sequence[Invocation] = (), meant: Mapping[str, int] | None = None,
    ) -> None:  # fmt: skip
        self._policy = policy
        self._signed = verifier is not None
        self._mute = "the vehicle answers no request"
        self._capacity: int | None = None
        self._steps = steps
        #: values that the vehicle is judged with, by parameter, although they are not set
        self.meant = {name: value_of(bits) for name, bits in (meant or {}).items()}
        self._fence = fence
        self._manoeuvres = manoeuvres or {}
        self._telemetry = Telemetry(policy, [each.contract for each in steps])
        self._texts = StatusTexts()
        self._announcer = Announcer()
        self.link = VehicleLink(frames, verifier, system)
        self._gate_may_be_lost = frames.may_be_lost
        self.source = SourceTime()
        self._lists_images_us: int | None = None  # when the expected images are told once more
        #: the images that cameras report
        self.images = ImageObserver(slack)
        self.images.expected = any(sent.command in PICTURES for step in steps for sent in step.contract.emits)
        #: the last observed state of the vehicle
        self.seen = ObservedVehicle()
        self._strangers: set[str] = set()  # notes about other senders under the vehicle's ids
        #: the number that a boundary wants to get back with the vehicle's time of day, 0 for none
        self.asks_back: Callable[[], int] = int
        self._asked_utc_us = 0
        self._lacks_utc_us: int | None = None  # since when only the time of day is missing
        self._who_us: int | None = None
        self._commander = Commander(slack)
        self._manoeuvre: Manoeuvre | None = None
        self._payload = PayloadSender(self._send_payload, lacking=self.images.lacking)
        self._sent: list[bytes] = []  # what the payload was sent, to return with other frames
        self._left_mode: int | None = None  # one report shows a mode change away from this mode that is not ours
        self._others: str | None = None  # how a takeover showed; nothing of ours begins after it
        self._unsent: int | None = None  # the token of a command of which no frame has left yet
        self._steered_us: int | None = None  # when a moving frame last left, until a crossing is reported
        self._moving = False  # a frame that moves the vehicle is among the frames to pack
        self._watch = LinkWatch(slack)
        self._was_mute = False
        self._answers_us: int | None = None  # when it was found to answer in the air, before it was ready
        self._timed = False  # the ages of its reports are known, or no longer waited for
        self._aimless = False  # it was asked for its target and has none
        self._crash = CrashWatch()
        self._spoken: set[str] = set()  # messages that the autopilot itself has sent
        self._beats_us = 0  # when our next heartbeat is due
        self._was_ready = False
        self._unfit_us: int | None = 0  # when it was last fit; None once its unfitness was reported
        self._released = False
        self._was_air: tuple[bool, bool] | None = None

    def carried_by(self, capacity: int | None) -> None:
        """Set the capacity of the link, in octets a second each way. To be called before the first heartbeat."""
        self._capacity = capacity

    def plan(self, flavour: AutopilotFlavour) -> StreamPlan:
        """The streams to request from an autopilot of this flavour on this link."""
        always = {name: Rate(AT_LEAST[name], SUFFICES[name]) for name in AT_LEAST}
        estimator = {flavour.estimator: Rate(STALE_US // _WITHIN_STALE, STALE_US // 4)}
        wanted = {**always, **self._telemetry.rates, **estimator, **AT_TIMES}
        return plan_streams(wanted, self._capacity, signed=self._signed)

    @property
    def batteries(self) -> Batteries:
        """The batteries that the vehicle has reported."""
        return self._telemetry.batteries

    @property
    def consumption(self) -> Consumption:
        """The measured consumption of charge in flight."""
        return self._telemetry.consumption

    def expect(self, steps: Sequence[Invocation]) -> None:
        """Replace the mission's steps, and request the streams that the new ones need more often."""
        self._telemetry.need(self._policy, [each.contract for each in steps])
        if self.flavour is not None:
            self.stream_requests.replan(self.plan(self.flavour))

    @property
    def shortfall(self) -> str | None:
        """That the link carries too little for any flavour, in words."""
        plans = [self.plan(flavour) for flavour in _FLAVOURS.values()]
        return None if any(each.fits for each in plans) else plans[0].shortfall

    @property
    def unready(self) -> str | None:
        """What `Ready` waits for, in words; None once it was reported, or when only streams are outstanding."""
        if self._was_ready:
            return None
        if self.flavour is None:
            return self.link.crowd or self.seen.unready
        # before anything is sent it must have answered: its mode has to be known before each frame that moves it
        mute = None if self._watch.answers else self._mute
        if self._flies:
            return self.link.crowd or mute or self.seen.unready
        if self.prepares:
            return self.other_kind or self.link.crowd or "its parameters are being set"
        return self._unready_on_ground(mute)

    def _unready_on_ground(self, mute: str | None) -> str | None:
        return (
            self.other_kind
            or self.link.crowd
            or self._contradicted
            or (mute if self.keyless else None)  # also why the clock is not known
            or self.source.unready
            or mute
            or self.preflight.astray
            or self.seen.unready
            or self.preflight.unready
            or self._uncounted
            or self._undated
        )

    @property
    def _uncounted(self) -> str | None:
        """That it is not known yet which batteries count, in words. Waiting later would cost the first step its
        deadline.
        """
        number = self.batteries.awaited(self.seen.now_us)
        return None if number is None else f"battery {number} was reported once: waiting for a second report"

    @property
    def _undated(self) -> str | None:
        """That the time of day is missing or not certain enough, in words. Waiting later would cost the first step its
        deadline.
        """
        since_us, now_us = self._lacks_utc_us, self.seen.now_us
        if now_us < self.issued_from_us:
            return _YOUNG
        waits = self.asks_utc and (since_us is None or now_us - since_us < self.utc_patience_us)
        return _UNDATED if waits and self.utc_patience_us else None

    @property
    def _contradicted(self) -> str | None:
        """That reports under the vehicle's ids contradict each other, in words."""
        if not self._aids.contradictions.stand(self.seen.now_us):
            return None
        return f"two senders use the ids {self.system}/{AUTOPILOT}: their reports contradict each other"

    @property
    def keyless(self) -> bool:
        """Whether it signs its frames, we cannot, and it has answered nothing yet: it obeys nothing that we send."""
        return self._mute == KEYLESS and not self._watch.answers

    def overhear(self, datagram: bytes, now_us: int) -> None:
        """Take in a datagram from a sender other than the vehicle."""
        self.link.overhear(datagram, now_us)

    def receive(self, datagram: bytes, now_us: int) -> DatagramContents:
        """Take in a datagram. Never raises, whatever its bytes."""
        events: list[Event] = []
        send: list[Message] = []
        received = self.link.parse(datagram, now_us)
        for frame in received:
            if self.flavour is None:
                self._choose(frame)
            if self.flavour is not None and (frame.system == self.system or is_radio(frame)):
                self._receive_frame(frame, now_us, events, send)
        if self.flavour is None:
            return DatagramContents(events, self._ask_who(received, now_us) if self.hurries else [], received)
        return DatagramContents(events, self._packed(send, now_us, events), received)

    def _receive_frame(self, frame: ReceivedFrame, now_us: int, events: list[Event], send: list[Message]) -> None:
        watch = self._watch
        if frame.component == AUTOPILOT:
            if frame.name == "HEARTBEAT" and self._is_strange(frame, now_us, events):
                return
            if watch.heard_us != now_us or watch.down or self._was_mute:  # once for all frames of one moment
                watch.heard_us = now_us
                self._look(now_us, events)
        if frame.name in OF_PAYLOAD and self._payload_hears(frame):
            self._payload.take(frame.name, frame.message, frame.component, now_us)
        new, manoeuvre = self._take(frame, now_us, events, send), self._manoeuvre
        if new or (manoeuvre is not None and now_us >= manoeuvre.due_us):
            self._advance(now_us, send, events)
        self._serve_payload(now_us, events)

    def _payload_hears(self, frame: ReceivedFrame) -> bool:
        """Whether a message that may tell about payload does: of another component, or for us."""
        if frame.name == "HEARTBEAT":
            return frame.component != AUTOPILOT
        return frame.name != "COMMAND_ACK" or (self._payload.busy and self._is_for_us(frame.message))

    def _serve_payload(self, now_us: int, events: list[Event]) -> None:
        """Send the payload what is due while the link is up, and take in what became of it."""
        sender, of = self._payload, self._manoeuvre
        if not sender.busy or self._watch.down == SILENT:
            return
        assert self.flavour is not None
        sender.datum = (self.seen.home_amsl or 0) if self.flavour is PX4 else 0
        flies = of is not None and (self._unsent != of.token or not of.awaits_frame)
        asked = sender.asked
        awaited = sender.awaits_images
        told = sender.advance(self.seen, now_us, flies=flies)
        if sender.awaits_images:
            self.images.hurry(now_us)
        elif awaited:
            events += self.images.expected_images(now_us)
        for event in told:
            if isinstance(event, ports.CommandFailed) and of is not None:
                of.over = True
            events.append(event)
        self._aids.query.asked += sender.asked - asked

    def _send_payload(self, message: Message, now_us: int) -> Refusal | None:
        frames, refused = self.link.pack([message], now_us)
        self._sent += frames
        return refused[0] if refused else None

    def tick(self, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Do what is due at a time: heartbeat, stream requests, retries, link loss."""
        if self.flavour is None:
            return [], []
        events: list[Event] = []
        seen = self.seen
        aged = seen.pass_time(now_us)
        if not self._watch.strict:
            self._watch.strict = seen.airborne  # what is sent to it there has to arrive
        send = self._housekeeping(now_us)
        if self._texts.parts:
            self._hear(self._texts.due(now_us), events)
        self._look(now_us, events)
        if self._manoeuvre is not None and (aged or now_us >= self._manoeuvre.due_us):
            self._advance(now_us, send, events)
        if now_us >= self._aids.query.due_us:
            send += self._ask(now_us)
        send += self._watch_images(now_us, events)
        if not self._was_ready:
            self._judge_readiness(now_us, events)
        self._tell_notes(now_us, events)
        if self._announcer.waiting:
            send += self._announcer.due(now_us, busy=bool(send) or self._commander.waits)
        self._serve_payload(now_us, events)
        frames = self._packed(send, now_us, events)
        if self._gate_may_be_lost:
            self._renew_all_ahead(now_us, events)
        return events, frames + self._set_parameters(now_us) if self.settings.outstanding else frames

    def _renew_all_ahead(self, now_us: int, events: list[Event]) -> None:
        if self._flies_without_frame:
            self._renew_ahead(now_us, events, begins=True)
        self._renew_ahead(now_us, events, begins=False)

    def _judge_readiness(self, now_us: int, events: list[Event]) -> None:
        if self._is_ready(now_us):
            self._was_ready = True
            events.append(ports.Ready(now_us, self._flown_by_others()))
        elif self._unfit_us is not None:
            self._judge_fitness(now_us, events)

    def _judge_fitness(self, now_us: int, events: list[Event]) -> None:
        """Report, once it has persisted, an obstacle to readiness that waiting cannot remove."""
        why = None if self.prepares or self._flies else self.other_kind or self.preflight.unfit
        if why is None:
            self._unfit_us = now_us
        elif self._unfit_us is not None and now_us - self._unfit_us >= UNFIT_US:
            self._unfit_us = None
            events.append(ports.VehicleUnfit(now_us, why))

    def _housekeeping(self, now_us: int) -> list[Message]:
        """The heartbeat and the questions that are due at any stage."""
        send: list[Message] = []
        if now_us >= self._beats_us:
            self._beats_us = now_us + HEARTBEAT_US
            send.append(messages.heartbeat())
        if now_us >= self.source.clock.due_us:
            send += self._ask_time(now_us)
        if self.asks_utc and now_us - self._asked_utc_us >= EACH_US:
            self._asked_utc_us = now_us
            number = self.asks_back()
            send += [messages.time_sync(number)] if number else []
            send.append(messages.request(self.system, "SYSTEM_TIME"))
        if now_us >= self.stream_requests.due_us:
            send += self.stream_requests.due(self.system, now_us)
        if self._timed and not self._was_ready:
            send += self._ask_once(now_us)
        if self.asks_first is not None:
            send += self.asks_first.due(self.system, now_us)
        if self.asks is not None and self.seen.down:
            send += self.asks.due(self.system, now_us)
        if not self._was_ready and self.seen.down and not self.prepares:
            send += self.preflight.due(self.system, now_us)
        return send

    def _ask_once(self, now_us: int) -> list[Message]:
        """The requests in the air: one report of each kind, and the target where there may be one."""
        query, named = self._aids.query, self._aids.named
        send = self.stream_requests.due_once(self.system, now_us)
        query.asked += len(send)  # their answers are counted as well
        if self._awaits_target(now_us):
            gone = named.is_gone(self.seen, now_us, query.asked)
            # PX4 always has a target, and may only be slow to report it
            self._aimless = gone and self.flavour is ARDUPILOT
            if named.asks:
                named.asks, query.wants_target = False, True
                send += self._ask(now_us)
        return send

    def begin(self, command: Command, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Start a manoeuvre in place of the present one. Raises RuntimeError before a vehicle was heard.

        The returned frames may be questions only: a frame that moves the vehicle waits until its mode is known.
        """
        flavour = self.flavour
        if flavour is None:
            raise RuntimeError("no vehicle has been heard yet, so nothing can be commanded")
        if self._others is not None:  # also for a command that was under way when the takeover showed
            return [ports.CommandFailed(now_us, command.token, "taken-over", self._others)], []
        contradicted = None if self._flies or self._manoeuvre is not None else self._contradicted
        if contradicted is not None:
            return [ports.CommandFailed(now_us, command.token, "two-speak", contradicted)], []
        self.link.begin()
        before = modes_of(self.left, flavour) if self._manoeuvre is None else self._manoeuvre.modes
        doubted = self._aids.suspicion.kind
        if self._manoeuvre is None and self._left_mode is not None:
            before, doubted = before | {self._left_mode}, "mode"
        try:
            stages = self._stages(flavour, command)
        except Exception as error:  # noqa: BLE001  a pack's code: whatever it raises, its skill has failed
            slug = "no-datum" if isinstance(error, NoDatum) else "broken-manoeuvre"
            return [ports.CommandFailed(now_us, command.token, slug, str(error))], []
        self._manoeuvre = Manoeuvre(command, self._aids, self.seen, stages, before, doubted)
        self._payload.system = self.system
        self._payload.begin(command)
        if any(each.command in PICTURES for each in command.payload):  # a step that replaced one of the mission
            self.images.expected = True
        self._left_mode = None  # the new manoeuvre keeps it as a suspicion
        self.consumption.fly(command.speed)
        self._unsent = command.token
        events: list[Event] = []
        send: list[Message] = []
        if command.kind in (MotionKind.HOME, MotionKind.LAND):  # while it can still go back for what is missing
            events += self.images.expected_images(now_us)
            send += self._ask_images(self.images.ask_all(self.system))
            self._lists_images_us = now_us + LISTED_US
        self._advance(now_us, send, events)
        return events, self._pack(send, now_us, events)

    def _stages(self, flavour: AutopilotFlavour, command: Command) -> list[Stage]:
        way, packs = flavour.stages, self._manoeuvres
        if packs:  # stages for the skill or for the flavour, where a pack has some
            way = packs.get(f"{flavour.name}.{command.skill}") or packs.get(flavour.name, way)
        return way(command, self.seen, self.system)

    def _renew_ahead(self, now_us: int, events: list[Event], *, begins: bool) -> None:
        notes = self.link.renew_ahead(self._encoded, now_us, begins=begins)
        events += [ports.Noted(now_us, text) for text in notes]

    @property
    def _flies_without_frame(self) -> bool:
        """Whether a step is under way that has needed no frame so far."""
        of = self._manoeuvre
        if of is None or not of.command.needs_record or self._unsent != of.token:
            return False
        return not (of.over or of.awaits_frame)

    def _encoded(self, command: Command) -> Sequence[Message]:
        """The messages that would fly a command from here, retries included; none where they cannot be known."""
        assert self.flavour is not None
        try:
            stages = self._stages(self.flavour, command)
        except Exception:  # noqa: BLE001  see `begin`
            return ()
        return [each for stage in stages for each in sendings(stage)]

    def release(self) -> None:
        """Stand down: send nothing more that moves the vehicle."""
        self._manoeuvre, self._unsent, self._released = None, None, True
        self._payload.close()

    def _ask_who(self, received: Sequence[ReceivedFrame], now_us: int) -> list[bytes]:
        if self._who_us is not None and now_us - self._who_us < WHO_US:
            return []
        system = next((frame.system for frame in received if frame.component == AUTOPILOT), None)
        if system is None:
            return []
        self._who_us = now_us
        return self.link.ask_who(system, now_us)

    def announce(self, severity: int, text: str) -> None:
        """Send a text to every ground station; it leaves with a later `tick`, when the link is idle."""
        self._announcer.add(severity, text)

    def pass_on(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The request of a gateway's client, as it may leave, or why it must not. The boundary's gate judges it as any
        frame. Its answer comes to us and is not taken for the answer to a question of ours.
        """
        refused = NO_VEHICLE if self.flavour is None else refusal_of(frame, self.stream_requests)
        sealed = self.link.pass_on(frame, now_us) if refused is None else refused
        number = None if isinstance(sealed, Refusal) else command_of(frame)
        if number == messages.REQUEST_MESSAGE:
            self._aids.query.asked += 1
        elif number == messages.SET_INTERVAL:
            self.stream_requests.passed_on(now_us)
        return sealed

    def _choose(self, frame: ReceivedFrame) -> None:
        if frame.name != "HEARTBEAT" or frame.component != AUTOPILOT:
            return
        told = frame.message.type, frame.message.autopilot
        flavour = self.flavour = _FLAVOURS.get(frame.message.autopilot) if is_vehicle(*told) else None
        if flavour is not None:
            self.system, self._kind = frame.system, told
            if frame.signed and not self._signed:
                self._mute = KEYLESS
            if frame.message.type not in MULTIROTORS:
                self.other_kind = f"the vehicle is not a multirotor (MAV_TYPE {frame.message.type})"
            self.link.settle(frame.system)
            self.seen.estimator = Estimator(flavour.estimator)
            needed = [group for group in self._telemetry.sources if not group <= IN_THE_AIR]
            self.stream_requests = StreamRequests(self.plan(flavour), needed, flavour.estimator)
            slack = self._commander.slack
            self._aids = Aids(
                flavour, Brakes.of(self._policy.vehicle), self._commander, clock=self.source.clock, signed=self._signed
            )
            self.settings = VehicleParameters(bytewise=flavour.bytewise, slack=slack)
            self.preflight = Preflight(
                self._policy, flavour, self.seen, self._steps,
                fence=self._fence, slack=slack, judges=self.judges, meant=self.meant,
            )  # fmt: skip
            self._heeded = {*observed.HEEDED, flavour.estimator, *preflight.HEEDED, "STATUSTEXT"}
            # made in advance: there is no time when a fallback has to fly
            for kind in (MotionKind.HOME, MotionKind.LAND):
                flavour.stages(Command(-1, "", kind, (), (), 0, 0), self.seen, frame.system)

    def _hears_both(self, heartbeat: Message, now_us: int) -> bool:
        """Whether heartbeats under the vehicle's ids contradict each other now."""
        contradictions = self._aids.contradictions
        contradictions.report((heartbeat.custom_mode, heartbeat.base_mode & ARMED), now_us)
        return contradictions.stand(now_us)

    def speaks(self, heartbeat: Message) -> bool:
        """Whether a heartbeat under the vehicle's ids has the vehicle's type and autopilot."""
        return (heartbeat.type, heartbeat.autopilot) == self._kind

    def _is_strange(self, frame: ReceivedFrame, now_us: int, events: list[Event]) -> bool:
        """Whether a heartbeat under the vehicle's ids comes from another sender: a gimbal or a companion computer with
        the same ids, or another vehicle. Such a heartbeat is no evidence of how the vehicle flies or that it is heard.
        """
        if self.speaks(frame.message):
            self.seen.disputed = self._hears_both(frame.message, now_us)
            return False
        kind = frame.message.type, frame.message.autopilot
        text = two_speak(self.system, f"a vehicle with MAV_TYPE {kind[0]} and MAV_AUTOPILOT {kind[1]}")
        if is_another(*kind):
            self.link.meets(text)
        if text not in self._strangers and len(self._strangers) < _MOST_STRANGERS:
            self._strangers.add(text)
            events.append(ports.Noted(now_us, text))
        return True

    def _tell(self, name: str, message: Message) -> None:
        """Pass a message of the autopilot to the pending questions."""
        if self.asks_first is not None:
            self.asks_first.take(name, message)
        if self.asks is not None:
            self.asks.take(name, message)

    def _take(self, frame: ReceivedFrame, now_us: int, events: list[Event], send: list[Message]) -> bool:
        """Take in one frame; return whether it may be new to a manoeuvre."""
        message, name, _, component, _, _, octets = frame
        source, seen = self.source, self.seen
        at_us = source.of(frame, now_us)
        if source.stepped:
            seen.made_us.clear()
            self._crash.forget()
        if name in (OF_AUTOPILOT if component == AUTOPILOT else OF_CAMERA if component in CAMERAS else ()):
            self._take_image(frame, now_us, events)
        if component == AUTOPILOT:
            seen.count(source.place)
            self._spoken.add(name)
        elif name in self._spoken:
            return False  # what the autopilot itself reports is not taken from another component
        if name == "COMMAND_ACK":
            return self._acknowledge(frame, now_us, events) or self._asks
        self.stream_requests.heard(name, now_us, len(octets))
        if name in self._telemetry.rates:
            values = self._telemetry.read(
                name, message, component, seen.estimator.doubtful(name, now_us), now_us if at_us is None else at_us
            )
            if values and at_us is not None:
                events.append(ports.Readings(at_us, values))
        if component != AUTOPILOT:
            return False
        self._tell(name, message)
        return name in self._heeded and self._update(name, message, at_us, now_us, events, send)

    def _take_image(self, frame: ReceivedFrame, now_us: int, events: list[Event]) -> None:
        """Take in a message of a camera, or of the autopilot for one."""
        if frame.name != "COMMAND_ACK" or self._is_for_us(frame.message):
            home_amsl = self.seen.home_amsl
            events += self.images.take(frame.name, frame.message, frame.component, now_us, home_amsl)

    def _watch_images(self, now_us: int, events: list[Event]) -> list[Message]:
        """Tell the expected images when they are due; return the requests about images that are."""
        if not self.images.watches:
            return []
        if self._lists_images_us is not None and now_us >= self._lists_images_us:
            self._lists_images_us = None
            events += self.images.expected_images(now_us)
        return self._ask_images(self.images.due(self.system, now_us, triggers=self.flavour is ARDUPILOT))

    def _ask_images(self, questions: Iterable[Message]) -> list[Message]:
        """Requests about images; the autopilot's answers to them are counted."""
        send = list(questions)
        self._aids.query.asked += sum(each.target_component == AUTOPILOT for each in send)
        return send

    def _update(
        self, name: str, message: Message, at_us: int | None, now_us: int, events: list[Event], send: list[Message]
    ) -> bool:
        """Update the observed state with a message of the autopilot; return whether it may be new to a manoeuvre."""
        seen, before = self.seen, self.seen.mode
        new = seen.take(name, message, now_us, at_us, self.source.place)
        crashed = self._crash.look(seen, name, now_us)
        if crashed is not None:
            events.append(ports.Crashed(now_us, crashed))
            self._others = "crashed"
        if name == "HEARTBEAT":
            self.batteries.armed = seen.armed
            self._watch_mode(before, now_us, events)
            self._doubt(now_us, send)
        elif name == "STATUSTEXT":
            self._hear(self._texts.take(message, now_us), events)
        elif name in _OF_PREFLIGHT and self._is_for_us(message):
            if name == "PARAM_VALUE":
                self.settings.take(message)
            send += self.preflight.take(name, message, self.system, now_us)
        if new and seen.landed_state:
            self._tell_air(now_us, events)
        return new or (name != "ATTITUDE" and self._asks)

    def _tell_air(self, now_us: int, events: list[Event]) -> None:
        """Report whether the vehicle is armed and in the air. A vehicle that is disarmed in the air reports at once
        that it is on the ground; it counts as in the air until it is seen at rest.
        """
        seen, was = self.seen, self._was_air
        if was is not None and was[1] and seen.down and not seen.rests:
            return
        air = (seen.armed, seen.airborne)
        if air != was:
            self._was_air = air
            events.append(ports.AirState(now_us, *air))
            if was is not None and was[1] and not seen.airborne:
                events += self.images.expected_images(now_us)

    @property
    def _asks(self) -> bool:
        """Whether a frame waits to know who flies."""
        return self._aids.query.waits

    def _acknowledge(self, frame: ReceivedFrame, now_us: int, events: list[Event]) -> bool:
        """Take in a COMMAND_ACK; return whether it belongs to the present command."""
        message = frame.message
        if frame.component != AUTOPILOT:
            return False
        if not self._is_for_us(message):
            self._overhear_answer(message, now_us, events)
            return False
        self._watch.answered()
        if message.command == messages.REQUEST_MESSAGE:
            self.seen.answers += 1
        if message.command == messages.SET_INTERVAL:
            self.stream_requests.answered(message.result == 0, now_us)
            return False
        return self._commander.acknowledge(message.command, message.result, self.seen.up_us)

    def _overhear_answer(self, message: Message, now_us: int, events: list[Event]) -> None:
        """Note that the vehicle has accepted somebody else's command: later frames wait for reports from after it. If a
        frame of ours left just before, it is unknown which of the two commands takes effect.
        """
        what = others.STEERS.get(message.command)
        if what is None or message.result not in others.GRANTED:
            return
        self._aids.query.commanded(now_us)
        self._aids.granted_us = self.seen.up_us
        self._tell_crossed(f"{message.target_system}/{message.target_component} was granted {what}", now_us, events)

    def _tell_crossed(self, what: str, now_us: int, events: list[Event]) -> None:
        """Report, once for each frame of ours, that it left within W before this observation."""
        steered_us, flavour = self._steered_us, self.flavour
        if steered_us is None or flavour is None or now_us - steered_us > flavour.mode_within_us:
            return
        self._steered_us = None
        events.append(ports.Noted(now_us, others.crossed(what, now_us - steered_us)))
        self._announcer.add(others.WARNING, others.CROSSED)

    def _is_for_us(self, message: Message) -> bool:
        """Whether a message is addressed to us or to everybody. We belong to the vehicle's system."""
        return is_addressed(message, self.system, OURS)

    def _hear(self, said: Sequence[StatusText], events: list[Event]) -> None:
        for each in said:
            self.seen.say(each.severity, each.text)
            events.append(each)

    def _watch_mode(self, before: int | None, now_us: int, events: list[Event]) -> None:
        """Report a mode change in the air outside of our manoeuvres as a takeover. A vehicle that may have landed
        during a silence has changed its mode itself.
        """
        mode, flavour = self.seen.mode, self.flavour
        if self._manoeuvre is not None or self._released or not self.seen.airborne or mode is None or flavour is None:
            return
        left, self._left_mode = self._left_mode, None
        before = before if left is None else left
        if before in (None, mode) or self.seen.may_rest or (before, mode) in flavour.natural:
            return
        if not arrives(self.left, flavour, before, mode):
            if left is None and not self._signed:  # the next report has to confirm it
                self._left_mode = before
                return
            self._others = flavour.mode_name(mode)
            self._tell_crossed(self._others, now_us, events)
            events.append(ports.TakenOver(now_us, self._others, self.seen.critical))

    def _look(self, now_us: int, events: list[Event]) -> None:
        """Update whether the link is up, and for how long it has been. A vehicle that is heard but does not hear us may
        still be sent a stop.
        """
        watch = self._watch
        was = watch.down
        if self._gate_may_be_lost and self.link.is_mute:
            watch.unasked()
        changed = watch.look(now_us)
        self.seen.up_us, self.seen.stood_us = watch.up_us, watch.stood_us
        if watch.mute != self._was_mute:
            self._was_mute = watch.mute
            events.append(ports.VehicleAnswers(now_us, answers=not self._was_mute))
        if not changed:
            return
        down = watch.down
        if SILENT in (was, down):
            self.stream_requests.interrupted()
            events.append(
                ports.LinkBack(now_us) if was == SILENT else ports.LinkLost(now_us, SILENT, self._watch.heard_us or 0)
            )
        if down == UNANSWERED:
            events.append(ports.Noted(now_us, "the vehicle is heard but answers nothing"))
        elif was == UNANSWERED and down is None:
            events.append(ports.Noted(now_us, "the vehicle answers again"))

    def _advance(self, now_us: int, send: list[Message], events: list[Event]) -> None:
        """Advance the manoeuvre; if one of its frames waits to know who flies, ask at once."""
        manoeuvre = self._manoeuvre
        if manoeuvre is None:
            return
        try:
            out, happened = manoeuvre.advance(self.seen, now_us)
        except Exception as error:  # noqa: BLE001  see `begin`
            self._fail("broken-manoeuvre", str(error), now_us, events)
            return
        self._moving = self._moving or bool(out)
        send += out
        for event in happened:
            if isinstance(event, ports.TakenOver):
                self._others = event.how
                self._tell_crossed(event.how, now_us, events)
                event = replace(event, failsafe=self.seen.critical)
            if not (isinstance(event, ports.Succeeded) and self._payload.ends(event)):
                events.append(event)
        self._doubt(now_us, send)
        if manoeuvre.waits:
            send += self._ask(now_us)

    def _doubt(self, now_us: int, send: list[Message]) -> None:
        """Ask at once about an observation that rests on one report; report one that the next report contradicted."""
        aids = self._aids
        suspicion = aids.suspicion
        if suspicion.refuted is not None:
            self.seen.notes.append(
                f"two senders use the ids {self.system}/{AUTOPILOT}: `{suspicion.refuted}` was reported, and then "
                "contradicted; the vehicle's observed behaviour counts"
            )
            suspicion.refuted = None
        doubts = suspicion.stands or self.seen.disarms or self._left_mode is not None
        aids.query.doubt(doubts)
        if doubts and now_us >= aids.query.due_us:
            send += self._ask(now_us)

    def _tell_notes(self, now_us: int, events: list[Event]) -> None:
        images = self.images.notes
        for notes in (self.seen.notes, self.stream_requests.notes, self.preflight.notes, self._telemetry.notes, images):
            if notes:
                events += [ports.Noted(now_us, text) for text in notes]
                notes.clear()

    def _ask_time(self, now_us: int) -> list[Message]:
        """The request for the vehicle's clock, if due."""
        ts1_ns = self.source.clock.due(now_us)
        return [] if ts1_ns is None else [messages.time_sync(ts1_ns)]

    def _set_parameters(self, now_us: int) -> list[bytes]:
        """The frames that read or set a parameter now, as far as the boundary permits them."""
        frames, refused = self.link.pack(self.settings.due(self.system, now_us), now_us)
        self.settings.refused = refused[0] if refused else self.settings.refused
        return frames

    def _ask(self, now_us: int) -> list[Message]:
        """The question who flies, if due."""
        if self._released:
            return []
        flies = (self._manoeuvre is not None and not self._manoeuvre.over) or self.seen.airborne
        asks = self._aids.query.due(self.system, self.seen, now_us, flies=flies)
        if asks:
            self._watch.asked(now_us)
        return asks

    def _fail(self, reason: str, text: str, now_us: int, events: list[Event]) -> None:
        if self._manoeuvre is not None and not self._manoeuvre.over:
            self._manoeuvre.over = True
            events.append(ports.CommandFailed(now_us, self._manoeuvre.token, reason, text))

    @property
    def _flies(self) -> bool:
        return self.seen.airborne or (self.resumes and self.seen.armed)

    def _flown_by_others(self) -> str:
        """How the vehicle flies already if no command of ours explains it; a landing is left to the vehicle."""
        seen, flavour, left = self.seen, self.flavour, self.left
        if not self._flies or flavour is None or seen.mode is None:
            return ""
        if seen.landing:
            return "landing"
        if seen.mode not in flavour.ours:
            return flavour.mode_name(seen.mode)
        if left is None or any(f"{flavour.name}.{each.command.skill}" in self._manoeuvres for each in left.in_force):
            return ""  # the modes of a pack's stages are not known
        return flown_by(left, flavour, seen)

    def _is_ready(self, now_us: int) -> bool:
        """Whether `Ready` can be reported. In the air the vehicle need not be fit to arm, but the way home depends on
        its reports: it must answer, then the ages of its reports are awaited for a while, and then one report of each
        kind.
        """
        if not self._flies:
            lacks = self.unready
            if lacks != _UNDATED:
                self._lacks_utc_us = None
            elif self._lacks_utc_us is None:
                self._lacks_utc_us = now_us
            return lacks is None and self.stream_requests.settled(now_us)
        if self.link.crowd is not None or not self._watch.answers:
            return False
        if self._answers_us is None:
            self._answers_us = now_us
        if not self._timed and (self.source.unready is None or now_us - self._answers_us > PATIENCE_US):
            self._timed = True
            self.stream_requests.renew(now_us)
        return self._timed and self.stream_requests.settled(now_us, aloft=True) and not self._awaits_target(now_us)

    def _awaits_target(self, now_us: int) -> bool:
        """Whether the target that shows whose flight this is may still arrive. ArduCopter has none in a takeoff, and
        shows that by answering everything else.
        """
        if self.left is None or self.flavour is None or self.seen.targets or self._answers_us is None or self._aimless:
            return False
        return self.seen.mode in self.flavour.aims and now_us - self._answers_us <= PATIENCE_REFUSED_US

    def _packed(self, send: Sequence[Message], now_us: int, events: list[Event]) -> list[bytes]:
        """The frames to send, with those to payload."""
        return self._pack(send, now_us, events) if send or self._sent else []

    def _pack(self, send: Sequence[Message], now_us: int, events: list[Event]) -> list[bytes]:
        """The frames that the boundary permits. A manoeuvre whose frame it refuses has failed."""
        of = self._manoeuvre
        begins = self._gate_may_be_lost and self._moving and self._unsent is not None and of is not None
        if begins and of is not None and now_us <= of.command.not_after_us:
            self._renew_ahead(now_us, events, begins=True)  # the frames that bring it down are there before it sets off
        frames, refused = self.link.pack(send, now_us)
        to_payload, self._sent = self._sent, []
        moving, self._moving = self._moving, False
        if moving and frames:
            self._steered_us = now_us
        if refused:
            self._fail(refused[0].slug, "", now_us, events)
        elif moving and self._unsent is not None:
            events.append(ports.Sent(now_us, self._unsent))
            self._unsent = None
        return to_payload + frames  # in the order of their signatures
