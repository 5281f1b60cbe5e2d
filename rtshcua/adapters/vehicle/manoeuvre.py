"""Execute one command stage by stage; each stage ends with its observed effect.

Meanwhile three things are watched: whether somebody else flies the vehicle, whether it makes progress, and whether it
stops on command. Timeouts count link time (`ObservedVehicle.up_us`): they stand still while the link is down. The
flight mode is known before any frame that moves the vehicle.
"""

from collections.abc import Sequence
from copy import copy
from typing import Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.effects import apart, still
from rtshcua.adapters.vehicle.flavour import AutopilotFlavour, ExpectedTarget, Stage
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.source_time import VehicleClock
from rtshcua.adapters.vehicle.supervision import (
    MODE_BEATS,
    NEVER,
    Brakes,
    BrakingWatch,
    NamedTargetWatch,
    PauseWatch,
    SpeedWatch,
    StageProgress,
    TargetWatch,
    stands_idly,
)
from rtshcua.adapters.vehicle.suspicion import CROSSED_US, Contradictions, Suspicion
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import PAUSED, Command, CommandFailed, Event, Hindered, Obeyed, Succeeded, TakenOver

RETRY_US = 1_000_000
RETRIES = 5
#: how often a message that names no mode is repeated before one that names a mode is sent
SETTLED_TRIES: Final = 1
#: An answer may come this late; until then a refusal may belong to an earlier transmission of the same command.
LATE_US = 5_000_000

_ACCEPTED, _UNSUPPORTED, _IN_PROGRESS = 0, 3, 5
#: MAV_RESULT as slugs
RESULTS = {
    1: "temporarily", 2: "denied", 3: "unsupported", 4: "failed", 6: "cancelled", 7: "only-as-command-long",
    8: "only-as-command-int", 9: "unsupported-frame",
}  # fmt: skip


def sendings(stage: Stage) -> list[Message]:
    """The messages of a stage in the order of sending, with all retries."""
    settled = [] if stage.settled is None else [stage.settled] * (1 + SETTLED_TRIES)
    return settled + ([] if stage.message is None else _retried(stage.message))


def _retried(message: Message) -> list[Message]:
    """A message and its retries, with increasing `confirmation`."""
    made = [copy(message) for _ in range(1 + RETRIES)]
    for tries, each in enumerate(made):
        if hasattr(each, "confirmation"):
            each.confirmation = tries
    return made


class Commander:
    """Sends the message of one stage and follows its acknowledgement. It serves all manoeuvres of a vehicle in turn.

    Without an acknowledgement it is unknown whether the command was executed; only the effect shows it.

    `accepted` and `refused` (the result) hold the vehicle's answer. A refusal counts only if it can only belong to the
    one transmission of this stage: after a retry the first transmission may have been obeyed and the retry refused.
    `slack` multiplies each timeout: see `Driver`.
    """

    def __init__(self, slack: int = 1) -> None:
        self.slack = slack
        self._stage: Stage | None = None
        self._sent_us = 0
        self._tries = 0
        self._doubtful = False
        self._last_us: dict[int, int] = {}
        self._moded_us: int | None = None  # when a frame last left that requests or may change a mode
        self.accepted = False
        self.refused: int | None = None
        self.busy_us: int | None = None
        #: the message sent last names no mode (`Stage.settled`)
        self.settled = False

    def start(self, stage: Stage | None, now_us: int, *, settled: bool = False) -> list[Message]:
        """Begin a stage (None: none) and return its message. `settled`: the vehicle is in the stage's mode already; a
        mode that was requested shortly before may still take effect.
        """
        self._stage, self._sent_us, self._tries = stage, now_us, 0
        self.accepted, self.refused, self.busy_us = False, None, None
        self.settled = False
        if stage is None or stage.message is None:
            return []
        pends = self._moded_us is not None and now_us - self._moded_us < LATE_US
        self.settled = settled and stage.settled is not None and not pends
        if not self.settled:
            self._moded_us = now_us
        self._doubtful = False
        if stage.command is not None:
            self._doubtful = now_us - self._last_us.get(stage.command, -LATE_US) < LATE_US
            self._last_us[stage.command] = now_us
        return [stage.settled if self.settled else stage.message]

    @property
    def waits(self) -> bool:
        """Whether a command of the present stage is unanswered."""
        stage = self._stage
        return stage is not None and stage.command is not None and not self.accepted and self.refused is None

    @property
    def due_us(self) -> int:
        """When `due` may next have something to send, unless an acknowledgement arrives first."""
        stage = self._stage
        if stage is None or stage.message is None:
            return NEVER
        if stage.command is None:
            return self._sent_us + stage.repeat_us if stage.repeat_us else NEVER
        is_over = self.accepted and not (self.settled and stage.target is not None)  # it may not have been obeyed
        return NEVER if is_over or self._tries >= RETRIES else self._sent_us + RETRY_US * self.slack

    def acknowledge(self, command: int, result: int, now_us: int) -> bool:
        """Take in one COMMAND_ACK of the vehicle; return whether it belongs to the present stage. PX4 answers some
        commands twice: accepted, and later the result.
        """
        if self._stage is None or command != self._stage.command:
            return False
        if result == _IN_PROGRESS:
            self._sent_us = self.busy_us = now_us  # in progress: extend the wait
        elif result == _ACCEPTED or (self.settled and result == _UNSUPPORTED):
            self.accepted = True
        elif self.settled:
            pass  # it is in another mode now, which its heartbeat shows
        elif not self._doubtful:
            self.refused = result
        return True

    def due(self, now_us: int) -> list[Message]:
        """The message to repeat now: an unanswered command with an increased `confirmation`, or a target."""
        stage = self._stage
        if stage is None or stage.message is None or now_us < self.due_us:
            return []
        message = stage.message
        if stage.command is not None:
            if hasattr(message, "confirmation"):
                message = copy(message)  # the stage may be flown again
                message.confirmation = self._tries + 1
            self._doubtful = True
            self._last_us[stage.command] = now_us
            self.settled = self.settled and self._tries < SETTLED_TRIES
            message = stage.settled if self.settled else message
        if not self.settled:
            self._moded_us = now_us
        self._tries += 1
        self._sent_us = now_us
        return [message]


# ---------------------------------------------------------------- asking who flies

#: An unanswered question is repeated after this long.
AGAIN_US: Final = 100_000
#: How often an idle vehicle is asked, to know that it answers at all;
IDLE_US: Final = 1_000_000
#: how often in flight, where the mode is streamed fast enough;
STREAMED_US: Final = 300_000
#: how often an observation in one report is checked until another report confirms it.
CONFIRM_US: Final = 20_000
#: by how much more than `lag_us` two questions are spaced, so that the answers are spaced by `lag_us`
APART_US: Final = 5_000
#: How long after the mode a requested target may arrive. A vehicle without a target reports none: ArduCopter accepts
#: the request then, PX4 denies it.
TARGET_US: Final = 100_000


class WhoFliesQuery:
    """Requests HEARTBEAT. `within_us`: no frame that moves the vehicle leaves on an older mode report.

    PX4 sends its HEARTBEAT once a second, whatever interval is requested, so a frame of ours could undo a takeover in
    between. Both autopilots answer REQUEST_MESSAGE of HEARTBEAT within milliseconds, so the mode is requested
    repeatedly in flight, and once more right before a frame that begins a motion. Where the vehicle has a target of
    ours, a pilot may have given it another without a change of mode: then POSITION_TARGET_GLOBAL_INT is requested in
    the same round trip (docs/adr/0034).

    An answer shows the state `lag_us` earlier: a frame that begins a motion waits for two answers that far apart, and
    after somebody else's command a frame waits for an answer that much later.
    """

    def __init__(self, within_us: int, lag_us: int = 0, slack: int = 1) -> None:
        self._within_us = within_us * slack
        self._lag_us = lag_us
        self._target_us = TARGET_US * slack
        self._asked_us: int | None = None
        #: `due` returns nothing before this time
        self.due_us = 0
        self._came: tuple[int, int] | None = None  # the counts of mode and target reports when a frame began to wait
        self._target = False  # the frame waits for a target
        self._twice = False  # the frame waits for two answers
        self._first_us: int | None = None  # when the first of two answers came
        self._since_us = 0  # when the frame began to wait
        self._asked = 0  # how many questions were put for the frame
        self._every_us = AGAIN_US  # the interval between unanswered questions
        self._commanded_us: int | None = None  # when somebody else's command was last accepted
        self._doubts = False  # an observation is to be confirmed
        #: the number of messages requested so far
        self.asked = 0
        #: request the target, whatever waits
        self.wants_target = False
        #: until when the frame waits for a target; None while it waits for the mode or for nothing
        self.ends_us: int | None = None

    @property
    def waits(self) -> bool:
        """Whether a frame or another question waits for the answer."""
        return self._came is not None or self.wants_target

    def is_young(self, seen: ObservedVehicle, now_us: int, trip_us: int = 0) -> bool:
        """Whether the last mode report is recent enough for a frame that stops the vehicle or brings it home or down. A
        report that was read late, by more than a round trip, is not.
        """
        if seen.heartbeat_us is None or now_us - seen.heartbeat_us > self._within_us:
            return False
        if seen.waited(now_us - self._within_us - trip_us):
            return False
        return self._tells_of_commanded(seen.heartbeat_us)

    def is_newer(
        self, seen: ObservedVehicle, now_us: int, *, target: bool, twice: bool = False, again_us: int = AGAIN_US
    ) -> bool:
        """Whether a mode report came after the first call for this frame: it is recent enough for any frame. `target`:
        a target report is needed too, unless none comes in time. `twice`: two mode reports are needed, as far apart as
        a mode may lag. An unanswered question is repeated after `again_us`.
        """
        if self._came is None:
            self._came, self._first_us, self._asked = (seen.beats, seen.targets), None, 0
            self._asked_us, self.due_us, self._since_us = None, 0, now_us  # ask at once
        self._target, self._twice = target, twice and self._lag_us > 0
        self._every_us = min(again_us, AGAIN_US)
        beats, targets = self._came
        if seen.beats == beats or seen.heartbeat_us is None or not self._tells_of_commanded(seen.heartbeat_us):
            return False
        if seen.waited(self._since_us):
            return False
        if self._twice:
            if self._first_us is None:
                self._first_us = seen.heartbeat_us
            if seen.heartbeat_us - self._first_us < self._lag_us:
                return False
        if not target or (seen.targets > targets and now_us - seen.target_us <= self._within_us):
            return True
        if self.ends_us is None:
            self.ends_us = now_us + self._target_us
        return now_us >= self.ends_us

    def doubt(self, doubts: bool) -> None:
        """Set whether an observation is to be confirmed: then the question is put at once and repeated."""
        if doubts and not self._doubts:
            self.due_us = 0
        self._doubts = doubts

    def commanded(self, now_us: int) -> None:
        """Note that somebody else's command was accepted: earlier reports do not show its effect. Repeated commands
        hold frames up for at most one second at a time.
        """
        if self._commanded_us is None or now_us - self._commanded_us > IDLE_US:
            self._commanded_us = now_us

    def _tells_of_commanded(self, told_us: int) -> bool:
        return self._commanded_us is None or told_us >= self._commanded_us + self._lag_us

    def sent(self) -> None:
        """Note that the frame left or is no longer wanted: the next one asks anew."""
        self._came, self._target, self.ends_us = None, False, None

    def due(self, system: int, seen: ObservedVehicle, now_us: int, *, flies: bool) -> list[Message]:
        """The question to put now, if due. `flies`: a manoeuvre of ours is under way, or the vehicle is in the air."""
        half_us = self._within_us // 2
        wants, self.wants_target = self.wants_target, False
        every_us = 0 if wants else self._interval_us(seen, now_us, flies=flies)
        if self._asked_us is not None and now_us - self._asked_us < every_us:
            if every_us == STREAMED_US:  # until the last heartbeat is too old for that interval
                self.due_us = min(self._asked_us + every_us, (seen.heartbeat_us or 0) + half_us)
            elif flies or self._doubts:
                self.due_us = self._asked_us + every_us
            return []
        self._asked_us = now_us
        self.due_us = now_us + min(half_us, CONFIRM_US if self._doubts else AGAIN_US)
        if self._came is not None:
            self._asked += 1
            self.due_us = min(self.due_us, now_us + self._again_us(now_us))
        with_target = self._target or self._doubts or wants
        names = ("HEARTBEAT", "POSITION_TARGET_GLOBAL_INT") if with_target else ("HEARTBEAT",)
        self.asked += len(names)
        return [messages.request(system, name) for name in names]

    def _interval_us(self, seen: ObservedVehicle, now_us: int, *, flies: bool) -> int:
        half_us = self._within_us // 2
        if self._doubts:
            return CONFIRM_US
        if self._came is not None:
            return self._again_us(now_us)
        if not flies:
            return IDLE_US
        streamed = seen.heartbeat_us is not None and now_us - seen.heartbeat_us < half_us
        return STREAMED_US if streamed else half_us

    def _again_us(self, now_us: int) -> int:
        """How long after the last question for a frame the next one is put."""
        commanded_us = self._commanded_us
        hurries = commanded_us is not None and now_us - commanded_us <= 2 * (self._lag_us + APART_US)
        return self._lag_us + APART_US if hurries or (self._twice and self._asked == 1) else self._every_us


# ---------------------------------------------------------------- a manoeuvre

#: No answer and no effect: the command may have been executed, or may still be.
UNKNOWN: Final = "unknown/no-answer"
#: The vehicle stands still, short of its destination.
STOPPED_SHORT: Final = "stopped-short"
_GETS_NOWHERE: Final = (STOPPED_SHORT, "no-progress")
#: failures that also occur where a pilot flies and another sender keeps reporting our mode
_AS_IF_OTHERS_FLEW: Final = frozenset(
    (
        UNKNOWN,
        STOPPED_SHORT,
        "no-mode-report",
        "no-progress",
        "no-effect",
        "wrong-heading",
        "did-not-stop",
        "did-not-hold",
    )
)
#: The mode that a frame waits for was not reported within this time.
MODE_UNKNOWN_US: Final = 5_000_000
#: mm: a holding vehicle that is farther than this from where it stopped does not hold
HOLDS_WITHIN: Final = 15_000
#: us of link time; a mode shows this long after it was accepted, and after `MODE_BEATS` heartbeats
TAKEN_BACK_US: Final = 1_500_000
#: us of link time: a landing that an earlier manoeuvre began shows at most this late
LANDS_US: Final = 1_000_000
#: these stop the vehicle or bring it home or down: a recent mode report suffices for them
_URGENT: Final = (MotionKind.HOLD, MotionKind.HOME, MotionKind.LAND)
_HOMEWARD: Final = (MotionKind.HOME, MotionKind.LAND)
_LEGS: Final = (MotionKind.FLY, MotionKind.COVER)
#: us: how long a frame that stops the vehicle or brings it home or down waits to know whether the target is ours; with
#: all other waits less than the permit lasts
UNNAMED_MOST_US: Final = 600_000
#: us: how long, in addition to a round trip, a frame that brings the vehicle home or down waits for a new mode report;
#: then a recent one suffices
ANSWER_MOST_US: Final = 50_000


class Aids:
    """State and helpers that all manoeuvres of a vehicle share."""

    def __init__(
        self, flavour: AutopilotFlavour, brakes: Brakes, commander: Commander, *, clock: VehicleClock,
        signed: bool = False,
    ) -> None:  # fmt: skip
        self.flavour = flavour
        self.brakes = brakes
        self.commander = commander
        self.query = WhoFliesQuery(flavour.mode_within_us, flavour.lag_us, commander.slack)
        self.targets = TargetWatch()
        self.named = NamedTargetWatch(commander.slack)
        self.suspicion = Suspicion()
        #: about its mode and its motors
        self.contradictions = Contradictions()
        self.sent_us: int | None = None
        """When a frame that moves the vehicle last left, in link time."""
        self.requested: tuple[frozenset[int], int] | None = None
        """The modes that the last frame of ours requests and that have not shown since, and when it left, in link time.
        """
        self.homeward = False
        """Whether the present manoeuvre brings the vehicle home or down."""
        self.granted_us: int | None = None
        """When somebody else was last told that the vehicle does what makes it fly otherwise, in link time."""
        self._clock = clock
        self._signed = signed

    def is_near_ours(self, up_us: int) -> bool:
        """Whether a frame of ours may already have undone what a report shows. The round trip is limited to a plausible
        value, because on a link without a key an attacker can make it seem long.
        """
        within_us = CROSSED_US * self.commander.slack + min(self.trip_us, self.flavour.mode_within_us)
        return self.sent_us is not None and up_us - self.sent_us <= within_us

    def due_modes(self, up_us: int) -> frozenset[int]:
        """The modes that our last frame requests, as long as they may still show for the first time."""
        if self.requested is None:
            return frozenset()
        modes, sent_us = self.requested
        within_us = self.flavour.mode_within_us
        patience_us = within_us * self.commander.slack + self.flavour.lag_us + min(self.trip_us, within_us)
        return modes if up_us - sent_us <= patience_us else frozenset()

    @property
    def trip_us(self) -> int:
        """The round trip, as far as it is known."""
        return self._clock.round_trip_us or 0

    @property
    def answer_us(self) -> int:
        """How long a frame that would undo a pilot's mode waits at most for the answer to its question: a round trip of
        plausible length and `ANSWER_MOST_US`.
        """
        trip_us = min(self.trip_us, self.flavour.mode_within_us)
        return ANSWER_MOST_US * self.commander.slack + trip_us

    def sure(self, found: tuple[str, str, int] | None, seen: ObservedVehicle) -> str | None:
        """The confirmed evidence that somebody else flies or that the motors stopped. With a key one report is enough,
        because no frame can be forged.
        """
        suspicion = self.suspicion
        if found is None and not suspicion.stands:
            return None
        at_once = self._signed or self.is_near_ours(seen.up_us)
        return suspicion.judge(found, seen.up_us, disputed=self.contradictions.stand(seen.now_us), at_once=at_once)


class Manoeuvre:
    """Runs the stages of `command`. It has succeeded after its last effect and, for HOLD, its duration. It watches who
    flies until another manoeuvre takes its place.

    `before` holds the modes that may still show at the start, until the manoeuvre's own mode shows. A mode that was
    requested just before the start (`Aids.due_modes`) may show for the first time later; until it does, or had the time
    to, no frame leaves, except one that stops the vehicle or brings it home or down. `doubted` is an
    observation in one report at the start that is neither confirmed nor contradicted yet (`Suspicion.kind`). Until its
    first frame leaves, this manoeuvre cannot be the cause of it.
    """

    def __init__(
        self, command: Command, aids: Aids, seen: ObservedVehicle, stages: list[Stage], before: frozenset[int],
        doubted: str | None = None,
    ) -> None:  # fmt: skip
        self.command = command
        self.token = command.token
        self._aids = aids
        self._flavour = aids.flavour
        self._left = stages
        self._commander = aids.commander
        self._entered_us = 0
        self._waits = False  # the message of the stage was not sent yet
        self._progress: StageProgress | None = None
        self._stop: BrakingWatch | None = None
        self._held_us: int | None = None
        self._unnamed_us: int | None = None  # since when a frame waits to know whether the target is ours
        self._asked_us: int | None = None  # since when a frame that brings it home or down waits for an answer
        self._stands: tuple[int, int] | None = None
        self._doubted = doubted
        self._suspected = seen.mode if doubted == "mode" else None  # the pilot's mode, if the next report confirms it
        if seen.mode is not None:
            before = before - {seen.mode} if self._suspected is not None else before | {seen.mode}
        self._before = before
        self._awaits = aids.requested  # another manoeuvre's request whose mode has not shown
        self._began_in, self._began_us = seen.mode, seen.up_us
        self._modes: frozenset[int] = frozenset()
        self._was_landing = seen.landing and doubted != "landing"
        self._may_land = aids.homeward  # as the manoeuvre before commanded, which may show late
        aids.homeward = command.kind in _HOMEWARD
        self._taken = False
        self._aimed = False  # the frame that sets the destination, or none, has left
        self._named: ExpectedTarget | None = None  # the target of ours that the vehicle named after it
        self._shown = False  # the mode has shown that the frame was obeyed
        self._pause: PauseWatch | None = None  # for a leg
        self._pace: SpeedWatch | None = None
        # when the present stage was accepted, and after how many heartbeats
        self._accepted: tuple[int, int] | None = None
        self._changed = False  # something was sent or a stage began whose effect is still to be checked
        self.over = False
        #: `advance` does nothing before this time unless something is observed or acknowledged
        self.due_us = 0
        seen.hush()
        aids.query.sent()
        self._enter(seen)

    @property
    def waits(self) -> bool:
        """Whether a frame waits to know who flies, or the target is to be requested."""
        named = self._aids.named
        if named.asks and not self._taken:
            named.asks, self._aids.query.wants_target = False, True
            return True
        return self._waits and not self.over

    @property
    def awaits_frame(self) -> bool:
        """Whether the frame of the present stage was not sent yet."""
        return self._waits

    @property
    def modes(self) -> frozenset[int]:
        """The flight modes that do not indicate a takeover."""
        return self._modes | self._before

    def advance(self, seen: ObservedVehicle, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        """Return the messages to send and the events, after an observation or with time."""
        self._changed = False
        send, events = self._advance(seen, now_us)
        if self._is_newly_obeyed(seen):
            events = [Obeyed(now_us, self.token, seen.target if self._aids.targets.compares else None), *events]
        looks = self._changed or self._aids.suspicion.stands  # then even a report without news confirms
        self.due_us = now_us if looks else self._due_us(seen, now_us)
        return send, events

    def _advance(self, seen: ObservedVehicle, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        how = self._aids.sure(self._taken_over(seen), seen) or self._flown_otherwise(seen, now_us)
        if how is None and self.over:
            return [], ()
        reason = None
        if how is None:
            sent = self._go_through_stages(seen, now_us)
            if sent:  # its effect shows later
                return sent, ()
            reason = self._failure(seen) if self._left else self._left_its_place(seen)
            how = self._takeover_behind(reason, seen, now_us)
        if how is not None:
            self.over = self._taken = True
            return [], [TakenOver(now_us, how)]
        if reason is None and self._left:
            slowed = self._hindered(seen, now_us)
            return self._again(seen, now_us), slowed
        if reason is None and not self._has_held(seen):
            return [], ()
        self.over = True
        failed = None if reason is None else CommandFailed(now_us, self.token, reason, seen.text)
        return [], [failed or Succeeded(now_us, self.token)]

    def _go_through_stages(self, seen: ObservedVehicle, now_us: int) -> list[Message]:
        """Leave the stages that are done, up to the first frame that may be sent; return it."""
        while self._left:
            if self._waits:
                if not self._may_send(seen, now_us):
                    break
                sent = self._send(seen)
                if sent:
                    return sent
            if not self._is_done(seen):
                break
            self._left.pop(0)
            self._enter(seen)
        return []

    def _takeover_behind(self, reason: str | None, seen: ObservedVehicle, now_us: int) -> str | None:
        """How a failure shows that somebody else flies the vehicle; None where it does not."""
        if reason in _GETS_NOWHERE and self._is_kept(seen, now_us):
            return PAUSED
        crossed = reason in _AS_IF_OTHERS_FLEW and self._aids.contradictions.stand(now_us)
        return (self._aids.suspicion.how or "two speak") if crossed else None

    def _hindered(self, seen: ObservedVehicle, now_us: int) -> Sequence[Event]:
        """That the leg is flown slower than commanded, reported once."""
        pace = self._pace
        if pace is None or not self._aids.targets.shown or not pace.look(seen, self._way_left(seen)):
            return ()
        told = f"it flies at {(pace.slow or 0) / 1_000:.1f} m/s instead of {self.command.speed / 1_000:.1f} m/s"
        return [Hindered(now_us, self.token, f"{told}: somebody else may have changed its speed")]

    # -------------------------------------------------------- what is sent

    def _enter(self, seen: ObservedVehicle) -> None:
        self._entered_us, self._progress = seen.up_us, None
        self._accepted, self._changed = None, True
        if not self._left:
            self._commander.start(None, seen.up_us)
            return
        stage = self._left[0]
        self._before, self._modes = self.modes, stage.modes
        self._progress = None if stage.progress is None else StageProgress(stage.progress)
        leg = self.command.kind in _LEGS and stage.progress is not None
        climb = self.command.kind == MotionKind.CLIMB and stage.progress is not None
        watches = (leg or climb) and self._flavour.names_targets
        self._pause = PauseWatch(climb=climb) if watches else None
        self._pace = SpeedWatch(self.command.speed) if leg else None
        if stage.stops and self._stop is None:
            self._stop = BrakingWatch(self._aids.brakes, seen)
        self._waits = stage.message is not None
        if not self._waits:
            self._commander.start(stage, seen.up_us)

    def _may_send(self, seen: ObservedVehicle, now_us: int) -> bool:
        """Whether it is known well enough who flies to send a frame that moves the vehicle (docs/adr/0034)."""
        query, urgent = self._aids.query, self.command.kind in _URGENT
        if not urgent and self._due_mode(seen):
            query.is_newer(seen, now_us, target=False)  # this requests the mode
            return False
        if self._aids.suspicion.stands or self._aids.contradictions.stand(now_us):
            return False
        if self._is_unnamed(seen, now_us):
            self._unnamed_us = now_us if self._unnamed_us is None else self._unnamed_us
            if now_us - self._unnamed_us <= UNNAMED_MOST_US:
                query.is_newer(seen, now_us, target=True)  # this requests the target
                return False
        if urgent and self._answers_late(seen, now_us) and query.is_young(seen, now_us, self._aids.trip_us):
            return True
        again_us = AGAIN_US if self._asked_us is None else self._aids.answer_us // 2  # a question may be lost
        targets = self._aids.targets.compares and not urgent
        return query.is_newer(seen, now_us, target=targets, twice=not urgent, again_us=again_us)

    def _answers_late(self, seen: ObservedVehicle, now_us: int) -> bool:
        """Whether a frame that names a mode, and so would undo another, no longer waits for its answer."""
        if self.command.kind not in _HOMEWARD:
            return True
        if self._asked_us is None:
            self._asked_us = now_us
        return now_us - self._asked_us >= self._aids.answer_us

    def _is_unnamed(self, seen: ObservedVehicle, now_us: int) -> bool:
        """Whether the vehicle, which usually reports our target, has not done so for as long as a mode report may be
        old.
        """
        if not self._names_target(seen):
            return False
        return now_us - seen.target_us > self._flavour.mode_within_us * self._commander.slack

    def _names_target(self, seen: ObservedVehicle) -> bool:
        flavour, targets = self._flavour, self._aids.targets
        return flavour.names_targets and targets.compares and targets.shown and seen.mode in flavour.aims

    def _send(self, seen: ObservedVehicle) -> list[Message]:
        """The message of the stage; none where its effect already holds."""
        self._waits, self._entered_us, self._changed, self._asked_us = False, seen.up_us, True, None
        self._doubted = self._suspected = None
        target = self._left[0].target
        if target is not None or self.command.kind in _URGENT:  # otherwise it was a mode, a speed or an arming
            self._aids.targets.expect(target, seen)
            self._aimed = True
        if self._left[0].spare and self._is_done(seen):
            return []  # the next one may leave at once
        self._aids.query.sent()
        self._aids.sent_us = seen.up_us
        stage = self._left[0]
        shows = seen.mode in stage.modes and not self._due_mode(seen)
        self._aids.requested = None if shows else (stage.modes, seen.up_us)
        return self._commander.start(stage, seen.up_us, settled=seen.mode in stage.modes)

    def _again(self, seen: ObservedVehicle, now_us: int) -> list[Message]:
        """The message to repeat, if any: never a target that the autopilot flies to."""
        commander = self._commander
        if self._waits:
            return []
        if self._is_followed or seen.up_us < commander.due_us:
            self._aids.query.sent()
            self._asked_us = None
            return []
        if not self._may_send(seen, now_us):
            return []
        self._aids.query.sent()
        self._asked_us = None
        self._aids.targets.told_again()
        self._aids.sent_us = seen.up_us
        return commander.due(seen.up_us)

    @property
    def _is_followed(self) -> bool:
        """Whether the present message is one that is repeated until the autopilot flies to its target, and it does."""
        if self._left[0].command is not None:
            return self._commander.settled and self._aids.targets.shown
        return self._aids.targets.shown or (self._progress is not None and self._progress.shown)

    def _due_us(self, seen: ObservedVehicle, now_us: int) -> int:
        """When to check again, in real time, unless something is observed first."""
        at_us = NEVER if self._taken else self._aids.targets.due_us(seen.up_us)
        if self._accepted is not None:
            at_us = min(at_us, self._accepted[0] + TAKEN_BACK_US)
        if not self.over:
            at_us = min(at_us, self._ends_us)
        due_us, answer_us = now_us + max(at_us - seen.up_us, 0), self._aids.query.ends_us
        if self._asked_us is not None:
            due_us = min(due_us, max(self._asked_us + self._aids.answer_us, now_us))
        return due_us if answer_us is None else min(due_us, answer_us)

    @property
    def _ends_us(self) -> int:
        """When, in link time, the present stage may end or fail without a further observation."""
        if not self._left:
            ends = self._held_us is not None and self.command.hold_us
            return (self._held_us or 0) + self.command.hold_us if ends else NEVER
        if self._waits:
            return self._entered_us + MODE_UNKNOWN_US
        at_us = self._shows_us if self._is_followed else min(self._commander.due_us, self._shows_us)
        if self._progress is not None:
            at_us = min(at_us, self._progress.due_us)
        if self._pause is not None:
            at_us = min(at_us, self._pause.due_us)
        return at_us if self._stop is None else min(at_us, self._stop.due_us)

    @property
    def _shows_us(self) -> int:
        """The latest time, in link time, for the effect of the present stage to show."""
        timeout_us, commander = self._left[0].timeout_us, self._commander
        if not timeout_us:
            return NEVER
        return max(self._entered_us, commander.busy_us or 0) + timeout_us * commander.slack

    # -------------------------------------------------------- observing

    def _is_done(self, seen: ObservedVehicle) -> bool:
        stage = self._left[0]
        return self._commander.accepted if stage.done is None else stage.done(seen)

    def _has_held(self, seen: ObservedVehicle) -> bool:
        """Whether a vehicle that stopped has stood for the duration of a HOLD, and stands now."""
        if self.command.kind != MotionKind.HOLD:
            return True
        if self._held_us is None:
            self._held_us = seen.up_us
        over = bool(self.command.hold_us) and seen.up_us - self._held_us >= self.command.hold_us
        return over and still(seen)

    def _left_its_place(self, seen: ObservedVehicle) -> str | None:
        """Why a vehicle that stopped for a HOLD does not hold, as a slug."""
        if self.command.kind != MotionKind.HOLD:
            return None
        if seen.down:
            return "disarmed"
        if not seen.located:
            return None
        here = seen.latitude, seen.longitude
        self._stands = self._stands or here
        away = apart(*here, *self._stands)
        return "did-not-hold" if away > 2 * HOLDS_WITHIN or (away > HOLDS_WITHIN and not still(seen)) else None

    def _taken_over(self, seen: ObservedVehicle) -> tuple[str, str, int] | None:
        """Evidence that somebody else flies: a mode, a landing, a failsafe or a target that is not ours. Returns its
        kind, its name and the number of reports of that kind. A mode may belong to this stage or, until the stage's own
        mode showed, to those before. A doubt from before the start was not caused by this manoeuvre.
        """
        if self._taken or seen.mode is None:
            return None
        found = self._found(seen)
        if found is None:
            self._doubted = self._suspected = None
        return found

    def _found(self, seen: ObservedVehicle) -> tuple[str, str, int] | None:
        homeward = self.command.kind in _HOMEWARD and self._doubted is None
        if homeward and seen.may_rest:  # it is done: no flight is left
            return None
        due = self._due_mode(seen)
        if seen.mode in due and seen.mode not in self._modes:  # it shows now, and is the mode before from here on
            self._before, self._awaits = self._before | due, None
        if seen.mode in self._modes and seen.mode != self._suspected:
            self._before, self._accepted = frozenset(), None
            if not due and self._aids.requested is not None and seen.mode in self._aids.requested[0]:
                self._aids.requested = None
            self._aids.targets.obeyed()
        elif seen.mode not in self._before or self._was_taken_back(seen):
            assert seen.mode is not None
            return "mode", self._flavour.mode_name(seen.mode), seen.beats
        self._may_land = self._may_land and seen.up_us - self._began_us <= LANDS_US * self._commander.slack
        self._was_landing = (self._was_landing or self._may_land) and seen.landing
        if seen.landing and not homeward and not self._was_landing:
            return "landing", "landing", seen.landings
        if seen.critical and seen.airborne and not homeward and self._flavour.critical_acts:
            return "failsafe", "the vehicle's state is critical", seen.beats
        if self._aids.targets.is_foreign(seen):
            return "target", "another target", seen.targets
        return None

    def _due_mode(self, seen: ObservedVehicle) -> frozenset[int]:
        """The modes that an earlier manoeuvre requested, as long as they may still show for the first time."""
        aids = self._aids
        return (
            aids.due_modes(seen.up_us) if self._awaits is not None and self._awaits is aids.requested else frozenset()
        )

    def _flown_otherwise(self, seen: ObservedVehicle, now_us: int) -> str | None:
        """Evidence over time that somebody else flies, although our mode shows and no other target."""
        if self._taken or self._aids.suspicion.stands or seen.mode not in self.modes:
            return None
        if not self._names_target(seen):  # it names no target in a climb
            paused = self.command.kind == MotionKind.CLIMB and self._is_paused(seen, now_us)
            return PAUSED if paused else None
        if self._aids.named.is_gone(seen, now_us, self._aids.query.asked):
            return "no target"
        return PAUSED if self._is_paused(seen, now_us) else None

    def _is_paused(self, seen: ObservedVehicle, now_us: int) -> bool:
        pause = self._pause
        return pause is not None and pause.is_paused(seen, self._way_left(seen), now_us, granted=self._was_granted)

    @property
    def _was_granted(self) -> bool:
        """Whether the vehicle has accepted somebody else's command since this began."""
        granted_us = self._aids.granted_us
        return granted_us is not None and granted_us >= self._began_us

    def _is_kept(self, seen: ObservedVehicle, now_us: int) -> bool:
        """Whether somebody keeps the vehicle in place for longer than the vehicle itself would: it never set off
        although it reports our target, or it rises no further and there is evidence of an intervention. Without such
        evidence its weight, weak motors or a fence may keep it down, and standing down would leave it in the air with
        nobody in control. A vehicle that never rose may lack propellers, and is commanded to land.
        """
        if self.command.kind == MotionKind.CLIMB:
            rose = self._progress is not None and self._progress.shown
            kept = stands_idly(seen, self._way_left(seen), now_us, far=0, climb=True)
            shows = self._was_granted or (self._pause is not None and self._pause.flies_aside(seen))
            return rose and kept and shows and self._flavour.names_targets
        return self._names_target(seen) and stands_idly(seen, self._way_left(seen), now_us)

    def _way_left(self, seen: ObservedVehicle) -> tuple[int, ...] | None:
        progress = self._left[0].progress if self._left else None
        return None if progress is None else progress.measure(seen)

    def _was_taken_back(self, seen: ObservedVehicle) -> bool:
        """Whether our mode was accepted but several later reports show another: somebody chose that one again."""
        if not self._commander.accepted or self._commander.refused is not None or self._waits:
            self._accepted = None
            return False
        if self._accepted is None:
            self._accepted = seen.up_us, seen.beats
        accepted_us, beats = self._accepted
        return seen.up_us - accepted_us > TAKEN_BACK_US and seen.beats - beats >= MODE_BEATS

    def _is_newly_obeyed(self, seen: ObservedVehicle) -> bool:
        """Whether it shows now, for the first time, that the vehicle executes this command.

        The target shows it, each time that the vehicle names another one of ours. Where it names none, the mode shows
        it once: a changed mode, or the same one after it was accepted.
        """
        targets = self._aids.targets
        if not self._aimed or self._waits or self._taken or seen.mode not in self._modes:
            return False
        if targets.compares:
            before, self._named = self._named, targets.named or self._named
            return self._named is not before
        before_it, self._shown = self._shown, self._shown or seen.mode != self._began_in or self._commander.accepted
        return self._shown and not before_it

    def _failure(self, seen: ObservedVehicle) -> str | None:
        """Why the present stage has failed, as a slug."""
        stage, commander = self._left[0], self._commander
        if self._waits:
            late = seen.up_us - self._entered_us > MODE_UNKNOWN_US * commander.slack
            return "no-mode-report" if late else None
        if commander.refused is not None:
            return f"refused/{RESULTS.get(commander.refused, str(commander.refused))}"
        if stage.powered and seen.down:
            return "disarmed"
        obeyed = commander.accepted or stage.command is None
        if self._stop is not None and self._stop.has_failed(seen, obeyed=obeyed):
            return "did-not-stop"
        if seen.up_us > self._shows_us:
            return UNKNOWN if commander.waits else stage.unseen
        if self._progress is not None and self._progress.has_stalled(seen):
            if commander.waits:
                return UNKNOWN
            return STOPPED_SHORT if still(seen) else "no-progress"
        return None
