"""The sorties of a qualification, and the driver that flies and observes one: the real driver, the only way of our
frames to the vehicle, with two changes. A motion that is to be stopped on its way ends early: the manoeuvre counts as
done once the vehicle is under way, so that the mission's next step, a hover, stops it. And in a silence nothing passes
for a while, in either direction. Every frame that moves the vehicle still belongs to a permitted command, and passes
the gate.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import hypot
from typing import Any, Final

from rtshcua.adapters.doctor.identity import IdentityQuestions
from rtshcua.adapters.qualification.observed import (
    MotionSample,
    ObservedAnswer,
    ObservedCommand,
    ObservedSilence,
    ObservedSortie,
    ObservedTakeover,
    TakeoverKind,
)
from rtshcua.adapters.qualification.station import GroundStation
from rtshcua.adapters.vehicle import effects, messages
from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.effects import Effect, apart
from rtshcua.adapters.vehicle.flavour import Stage, Stages
from rtshcua.adapters.vehicle.link import DatagramContents
from rtshcua.adapters.vehicle.manoeuvre import AGAIN_US, LATE_US
from rtshcua.adapters.vehicle.messages import REPOSITION, Message
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.adapters.vehicle.streams import IN_THE_AIR
from rtshcua.codec.frames import ReceivedFrame, is_addressed
from rtshcua.mavlink import enums
from rtshcua.mavlink.enums import MAV_COMP_ID_AUTOPILOT1 as AUTOPILOT
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard import ports
from rtshcua.onboard.enforcement.frames import OURS, Gate
from rtshcua.onboard.ports import Command, Event


@dataclass(frozen=True, slots=True)
class Sortie:
    """One sortie. `steps` names the kinds of its motions; those of `shortened` end on their way. `silences` are applied
    while it holds, in us. `takeover`: how it is taken over, on its way to a place.
    """

    name: str
    about: str
    steps: tuple[MotionKind, ...]
    shortened: frozenset[MotionKind] = frozenset()
    silences: tuple[int, ...] = ()
    takeover: TakeoverKind | None = None


_CLIMB, _FLY, _HOLD, _HOME, _LAND = (
    MotionKind.CLIMB, MotionKind.FLY, MotionKind.HOLD, MotionKind.HOME, MotionKind.LAND,
)  # fmt: skip
SILENCES_US: Final = (1_000_000, 3_000_000, 5_000_000)

SORTIES: Final = (
    Sortie("climb", "stops in a climb, and lands", (_CLIMB, _HOLD, _LAND), frozenset({_CLIMB})),
    Sortie(
        "leg", "stops on a leg, holds through silences, and returns", (_CLIMB, _FLY, _HOLD, _HOME), frozenset({_FLY}),
        SILENCES_US,
    ),
    Sortie("mode", "is taken over by a mode", (_CLIMB, _FLY, _HOME), takeover=TakeoverKind.MODE),
    Sortie("pause", "is taken over by a pause", (_CLIMB, _FLY, _HOME), takeover=TakeoverKind.PAUSE),
    Sortie("target", "is taken over by another target", (_CLIMB, _FLY, _HOME), takeover=TakeoverKind.TARGET),
)  # fmt: skip
#: by the pilot of a real vehicle, who is asked while it holds
BY_PILOT: Final = Sortie("mode", "is taken over by its pilot", (_CLIMB, _HOLD, _HOME), takeover=TakeoverKind.MODE)


# ---------------------------------------------------------------- motions that are stopped on their way

#: mm: a climb ends early at this height, and a leg after this distance: at most so much of it is left for braking
_ROSE: Final = 3_000
_FLOWN: Final = 10_000
#: 1/100 of the commanded speed at which it counts as under way
_FAST: Final = 80
#: 1/100 of a leg; the rest is left for braking
_MOST: Final = 50


def shortened(stages: Stages, kinds: frozenset[MotionKind]) -> Stages:
    """A flavour's stages, with motions of these kinds ending on their way."""

    def fly(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
        made = stages(command, seen, system)
        if command.kind not in kinds or not made:
            return made
        last = made[-1]
        return [*made[:-1], last._replace(done=_early(command, seen, last.done))]

    return fly


def _early(command: Command, seen: ObservedVehicle, done: Effect | None) -> Effect:
    under_way: Effect
    if command.kind == MotionKind.CLIMB:
        height = min(seen.height + _ROSE, seen.height + (command.altitude - seen.height) // 2)
        under_way = partial(_rose, height)
    else:
        under_way = partial(_is_under_way, (seen.latitude, seen.longitude), command)
    return lambda now: under_way(now) or (done is not None and done(now))


def _rose(height: int, seen: ObservedVehicle) -> bool:
    return seen.airborne and seen.levelled and seen.height >= height


def _is_under_way(start: tuple[int, int], command: Command, seen: ObservedVehicle) -> bool:
    """At the commanded speed, or half-way."""
    if not seen.located or seen.speed is None:
        return False
    flown = apart(seen.latitude, seen.longitude, *start)
    whole = apart(command.geo[-2], command.geo[-1], *start)
    fast = bool(command.speed) and 100 * seen.speed >= _FAST * command.speed
    return (fast and flown >= min(_FLOWN, whole * _MOST / 100)) or flown >= whole * _MOST / 100


# ---------------------------------------------------------------- flying and observing

#: us from standing still to the first silence, and between two of them
_SETTLES_US: Final = 1_500_000
_BETWEEN_US: Final = 3_000_000
#: us after which an undetected takeover is given up, and a landing command is repeated
_SHOWS_US: Final = 15_000_000
_AGAIN_US: Final = 2_000_000
#: mm flown before the takeover
_FAR: Final = 4_000
#: us without a check of the link that have an internal reason: a run that stood down closes its log before it watches
#: the landing
_HELD_UP_US: Final = 100_000
_IN_PROGRESS: Final = 5
#: requests, which are not commands
_QUESTIONS: Final = frozenset({messages.SET_INTERVAL, messages.RUN_PREARM_CHECKS, enums.MAV_CMD_REQUEST_MESSAGE})
_MOVING: Final = ("COMMAND_LONG", "COMMAND_INT", "SET_POSITION_TARGET_GLOBAL_INT")


class QualifyingDriver(Driver):
    """Flies one sortie and records its observations. `sends`: a second ground station takes the vehicle over, in a
    simulation; otherwise `ask` asks a pilot to.
    """

    def __init__(
        self, policy: Policy, frames: Gate, slack: int = 1, *, sortie: Sortie, sends: bool, fence: bool = True,
        manoeuvres: Mapping[str, Stages] | None = None, ask: Callable[[str], None] = lambda _: None, **more: Any,
    ) -> None:  # fmt: skip
        ways = {each.name: shortened(each.stages, sortie.shortened) for each in (PX4, ARDUPILOT)}
        super().__init__(policy, frames, slack, fence=fence, manoeuvres={**(manoeuvres or {}), **ways}, **more)
        self.sortie = sortie
        self.found = ObservedSortie(sortie.name)
        self.questions: IdentityQuestions | None = None
        self._ask_pilot = ask
        self._sends = sends
        self._slack = slack
        self._fenced = fence
        self._station: GroundStation | None = None
        self._home: tuple[int, int] | None = None
        self._tokens: dict[int, ObservedCommand] = {}
        self._current: ObservedCommand | None = None
        self._command: Command | None = None
        self._began: tuple[int, int] | None = None  # where the command began
        self._left = list(sortie.silences)
        self._silent: ObservedSilence | None = None  # the present silence, or the last one until everything is fresh
        self._awaited: set[str] = set()
        self._mode_before: int | None = None
        self._due_us: int | None = None  # when the next silence begins
        self._landed_us: int | None = None  # when the second ground station commanded the landing
        self._up_us: int | None = None
        self._air_asked = False
        self._mode_asked_us: int | None = None
        self._looked_us = 0

    # -------------------------------------------------------- receiving and sending

    def receive(self, datagram: bytes, now_us: int) -> DatagramContents:
        """Like any driver, but nothing is received in a silence."""
        if self._is_silent(now_us):
            return DatagramContents([], [], [])
        self._look_again(now_us)
        heard = super().receive(datagram, now_us)
        for frame in heard.frames:
            if frame.system == self.system and frame.component == AUTOPILOT:
                self._observe(frame, now_us)
        self._note(heard.events, now_us)
        return heard

    def tick(self, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Like any driver, and do what is due in the sortie."""
        self._look_again(now_us)
        events, frames = super().tick(now_us)
        if self.flavour is None:
            return events, frames
        self._note(events, now_us)
        self._time_in_air(now_us)
        self._go_on(now_us)
        if self._is_silent(now_us):
            return events, []
        send = self._questions(now_us)
        if send:
            frames = frames + self._pack(send, now_us, events)
        return events, [*frames, *self._others_act(now_us)]

    def begin(self, command: Command, now_us: int) -> tuple[list[Event], list[bytes]]:
        """Like any driver, and record the command."""
        current = self._current
        if current is not None and current.ended_us is None:
            current.ended_us, current.how = now_us, "replaced"
        cut = command.kind in self.sortie.shortened
        self._current = ObservedCommand(command.kind, command.skill, now_us, command.speed, cut)
        self._tokens[command.token] = self._current
        self.found.commands.append(self._current)
        self._command, self._began = command, (self.seen.latitude, self.seen.longitude)
        if self._home is None and self.seen.located:
            self._home = self.seen.latitude, self.seen.longitude
        if self._silent is not None and self._is_silent(now_us):
            self._silent.for_us = now_us - self._silent.began_us  # this command is not part of the test: it must leave
        events, frames = super().begin(command, now_us)
        self._note(events, now_us)
        return events, frames

    def finish(self, ending: str) -> ObservedSortie:
        """End the sortie; return the observations."""
        found, seen = self.found, self.seen
        found.ending, found.down = ending, seen.down
        if self.flavour is None:
            return found
        requests = self.stream_requests
        came = {} if requests.measured is None else requests.measured[1]
        found.streams = {name: (us, came.get(name)) for name, us in requests.plan.intervals.items()}
        fencing = self.preflight.fencing
        found.fence, found.fence_read = None, fencing.read_back
        if self._fenced:
            found.fence = fencing.unready or fencing.note
        values = None if self.questions is None else self.questions.values.values
        found.switches = {
            name: (bits, None if values is None else values.get(name)) for name, bits in self.flavour.fence.switches
        }
        return found

    def _pack(self, send: Sequence[Message], now_us: int, events: list[Event]) -> list[bytes]:
        frames = super()._pack(send, now_us, events)
        if len(frames) < len(send) or self._is_silent(now_us):
            return frames
        for message in send:
            number = getattr(message, "command", None)
            if number in _QUESTIONS or message.get_type() not in _MOVING:
                continue
            if number is not None:
                asks_no_mode = number == REPOSITION and not message.param2
                self.found.answers.append(ObservedAnswer(number, now_us, asks_no_mode=asks_no_mode))
            if self.found.takeover is not None:
                self.found.takeover.moved_us = now_us
        return frames

    def _questions(self, now_us: int) -> list[Message]:
        """The questions about its identity on the ground and, in the air, whether its fence is on."""
        assert self.flavour is not None
        if self.questions is None:
            self.asks = self.questions = IdentityQuestions(self.flavour, self._slack)
        if self.seen.airborne and not self._air_asked:
            self._air_asked = True
            for name, _ in self.flavour.fence.switches:
                self.questions.values.forget(name)
                self.questions.values.read(name)
        out = self._asks_mode(now_us)
        return out + self.questions.due(self.system, now_us) if self.seen.airborne else out

    def _asks_mode(self, now_us: int) -> list[Message]:
        """The question for the mode after a takeover showed, when a driver asks no more: the delay of the mode is
        measured.
        """
        takeover = self.found.takeover
        if takeover is None or takeover.kind is not TakeoverKind.MODE or takeover.sent_us is None:
            return []
        asked_us = self._mode_asked_us or takeover.sent_us
        if takeover.mode_us is not None or takeover.shown_us is None or now_us - asked_us < AGAIN_US * self._slack:
            return []
        self._mode_asked_us = now_us
        return [messages.request(self.system, "HEARTBEAT")] if now_us - takeover.sent_us < _SHOWS_US else []

    def _look_again(self, now_us: int) -> None:
        """Note a check of the link, and the time since the last one."""
        takeover, looked_us, self._looked_us = self.found.takeover, self._looked_us, now_us
        if takeover is not None and takeover.mode_us is None and now_us - looked_us > _HELD_UP_US * self._slack:
            takeover.unwatched_us += now_us - looked_us

    # -------------------------------------------------------- observing

    def _observe(self, frame: ReceivedFrame, now_us: int) -> None:
        name, message, found = frame.name, frame.message, self.found
        match name:
            case "GLOBAL_POSITION_INT" if self.seen.located:
                speed = round(10 * hypot(message.vx, message.vy))
                found.samples.append(
                    MotionSample(now_us, message.lat, message.lon, message.relative_alt, speed, -10 * message.vz)
                )
            case "HEARTBEAT" if self.speaks(message):
                flies = self._current is not None and self._current.ended_us is None and found.takeover is None
                if self.seen.airborne and flies:
                    found.beats.append(now_us)
                takeover = found.takeover
                if takeover is not None and takeover.mode_us is None and message.custom_mode != self._mode_before:
                    takeover.mode_us = now_us
            case "COMMAND_ACK" if is_addressed(message, self.system, OURS):
                self._answered(message.command, message.result, now_us)
            case "COMMAND_ACK" if found.takeover is not None and found.takeover.obeyed_us is None:
                found.takeover.obeyed_us = now_us
        if self._silent is not None and self._silent.ended_us is not None and self._silent.fresh_us is None:
            self._awaited.discard(name)
            if not self._awaited:
                self._silent.fresh_us = now_us

    def _answered(self, command: int, result: int, now_us: int) -> None:
        waiting = [
            each
            for each in self.found.answers
            if each.command == command and each.answered_us is None and now_us - each.sent_us <= LATE_US
        ]
        if waiting and result != _IN_PROGRESS:
            waiting[0].answered_us, waiting[0].result = now_us, result

    def _note(self, events: Sequence[Event], now_us: int) -> None:
        for event in events:
            match event:
                case ports.Sent(_, token):
                    self._of(token).sent_us = now_us
                case ports.Succeeded(_, token):
                    self._ends(self._of(token), now_us, "succeeded")
                case ports.CommandFailed(_, token, reason):
                    self._ends(self._of(token), now_us, reason)
                    self._shown(reason, now_us)
                case ports.TakenOver(_, how):
                    if self._current is not None:
                        self._ends(self._current, now_us, "taken-over")
                    self._shown(how, now_us)
                case ports.LinkLost() if self._silent is not None and self._silent.lost_us is None:
                    self._silent.lost_us = now_us
                case ports.LinkBack() if self._silent is not None and self._silent.back_us is None:
                    self._silent.back_us = now_us
                case _:
                    pass

    def _of(self, token: int) -> ObservedCommand:
        return self._tokens[token]

    def _ends(self, command: ObservedCommand, now_us: int, how: str) -> None:
        if command.ended_us is None:
            command.ended_us, command.how = now_us, how

    def _shown(self, how: str, now_us: int) -> None:
        takeover = self.found.takeover
        if takeover is not None and takeover.shown_us is None:
            takeover.shown_us, takeover.how = now_us, how

    def _time_in_air(self, now_us: int) -> None:
        if not self.seen.airborne:
            self._up_us = None
        elif self._up_us is not None:
            self.found.airborne_us += now_us - self._up_us
            self._up_us = now_us
        else:
            self._up_us = now_us

    # -------------------------------------------------------- silences

    def _is_silent(self, now_us: int) -> bool:
        silent = self._silent
        return silent is not None and now_us - silent.began_us < silent.for_us

    def _go_on(self, now_us: int) -> None:
        """Begin and end silences while it holds."""
        current, silent = self._current, self._silent
        if silent is not None and silent.ended_us is None and not self._is_silent(now_us):
            silent.ended_us = now_us
        if silent is not None and silent.ended_us is not None and not silent.kept:
            same = self.seen.mode == self._mode_before and current is not None and current.ended_us is None
            silent.kept = same and silent.fresh_us is not None
        holds = current is not None and current.kind == MotionKind.HOLD and current.ended_us is None
        if not holds or not self._left:
            self._due_us = None
            return
        if self._due_us is None:
            stands = current is not None and current.sent_us is not None and effects.still(self.seen)
            self._due_us = now_us + _SETTLES_US if stands else None
        elif now_us >= self._due_us and not self._is_silent(now_us):
            self._silent = ObservedSilence(self._left.pop(0), now_us)
            self.found.silences.append(self._silent)
            self._mode_before = self.seen.mode
            self._awaited = self._come()
            self._due_us = now_us + self._silent.for_us + _BETWEEN_US

    def _come(self) -> set[str]:
        """The streams that came in the last measurement."""
        measured = self.stream_requests.measured
        came = set(self.stream_requests.plan.intervals) if measured is None else set(measured[1])
        return came - IN_THE_AIR - {"POSITION_TARGET_GLOBAL_INT"}

    # -------------------------------------------------------- taking over

    def _others_act(self, now_us: int) -> list[bytes]:
        """The frames of the second ground station now; without one, ask the pilot."""
        kind, takeover, flavour = self.sortie.takeover, self.found.takeover, self.flavour
        if kind is None or flavour is None or self._home is None:
            return []
        if takeover is None:
            if not self._is_due():
                return []
            self._mode_before = self.seen.mode
            self.found.takeover = ObservedTakeover(kind, now_us if self._sends else None)
            if not self._sends:
                self._ask_pilot("PILOT: take over now, with the mode switch, and land")
                return []
            self._station = GroundStation(flavour.autopilot, self.system)
            return self._station.takes_over(kind, self._home, self.seen)
        if self._station is None or not self.seen.airborne:
            return []
        mode = kind is not TakeoverKind.MODE or takeover.mode_us is not None
        waits = (takeover.shown_us is None or not mode) and now_us - (takeover.sent_us or 0) < _SHOWS_US
        again = self._landed_us is None or now_us - self._landed_us >= _AGAIN_US
        if waits or not again or self.seen.landing:
            return []
        self._landed_us = now_us
        return self._station.lands()

    def _is_due(self) -> bool:
        """Whether the takeover is due: on its way or, by a pilot, while it holds."""
        command, current, began = self._command, self._current, self._began
        if command is None or current is None or current.sent_us is None or current.ended_us is not None:
            return False
        if not self._sends:
            return command.kind == MotionKind.HOLD and effects.still(self.seen)
        if command.kind != MotionKind.FLY or not self.seen.located or began is None:
            return False
        return apart(self.seen.latitude, self.seen.longitude, *began) >= _FAR
