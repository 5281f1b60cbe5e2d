"""One command under way: stage after stage, each ended by its observed effect.

Three things are watched all the while: that nobody else flies the vehicle, that it gets somewhere, and that it stops
when it is told to. Waits are in link time (`Observed.up_us`): while the link is down nothing is expected of anybody.
"""

from collections.abc import Sequence
from typing import Final

from rtshcua.adapters.vehicle.commander import NEVER, RESULTS, Commander
from rtshcua.adapters.vehicle.effects import apart, still
from rtshcua.adapters.vehicle.flavour import Flavour, Message, Stage, mode_name
from rtshcua.adapters.vehicle.mode_query import ModeQuery
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.adapters.vehicle.progress import Brakes, Progress, Stop
from rtshcua.adapters.vehicle.targets import Targets
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, Event, Failed, Succeeded, TakenOver

#: Never answered, and no effect seen: it may have been executed, or be executed yet.
UNKNOWN: Final = "unknown/no-answer"
#: The mode that a frame waits for was not told in this time.
MODE_UNKNOWN_US: Final = 5_000_000
#: mm: a vehicle that holds, and is further than this from where it came to stand, does not hold
HOLDS_WITHIN: Final = 15_000
#: so long after it accepted a mode, in us of link time, and so many heartbeats, the mode shows
TAKEN_BACK_US: Final = 1_500_000
TAKEN_BACK_BEATS: Final = 2
#: these stop the vehicle, or bring it home or down: they leave on the last mode report, while it is young
_URGENT: Final = (MotionKind.HOLD, MotionKind.HOME, MotionKind.LAND)
_HOMEWARD: Final = (MotionKind.HOME, MotionKind.LAND)


class Aids:
    """What serves all manoeuvres of a vehicle in turn."""

    def __init__(self, flavour: Flavour, brakes: Brakes, commander: Commander) -> None:
        self.flavour = flavour
        self.brakes = brakes
        self.commander = commander
        self.mode = ModeQuery(flavour.mode_within_us * commander.slack)
        self.targets = Targets()


class Manoeuvre:
    """Runs the stages of `command`; after its last effect, and a HOLD's time, it has succeeded.

    It goes on watching who flies after that, until another manoeuvre takes its place. `before` are the modes that may
    still show at its start, while its own has not come.
    """

    def __init__(
        self, command: Command, aids: Aids, seen: Observed, stages: list[Stage], before: frozenset[int] = frozenset()
    ) -> None:
        self._command = command
        self._aids = aids
        self._flavour = aids.flavour
        self._left = stages
        self._commander = aids.commander
        self._entered_us = 0
        self._waits = False  # the message of the stage was not sent yet
        self._progress: Progress | None = None
        self._stop: Stop | None = None
        self._held_us: int | None = None
        self._stands: tuple[int, int] | None = None
        self._before = before if seen.mode is None else before | {seen.mode}
        self._modes: frozenset[int] = frozenset()
        self._was_landing = seen.landing
        self._taken = False
        self._accepted: tuple[int, int] | None = None  # when the present stage was, and after how many heartbeats
        self.over = False
        #: until then `advance` has nothing to say, unless something is observed or acknowledged
        self.due_us = 0
        seen.hush()
        aids.mode.sent()
        self._enter(seen)

    @property
    def token(self) -> int:
        """Of its command."""
        return self._command.token

    @property
    def waits(self) -> bool:
        """Whether a frame waits until the mode is known."""
        return self._waits and not self.over

    @property
    def modes(self) -> frozenset[int]:
        """The flight modes in which nobody has taken over."""
        return self._modes | self._before

    def advance(self, seen: Observed, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        """Messages to send and events, after something was observed or time went by."""
        out = self._advance(seen, now_us)
        self.due_us = self._due_us(seen, now_us)
        return out

    def _advance(self, seen: Observed, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        how = self._taken_over(seen)
        if how is not None:
            self.over = self._taken = True
            return [], [TakenOver(now_us, how)]
        if self.over:
            return [], ()
        while self._left:
            if self._waits:
                if not self._may_send(seen, now_us):
                    break
                sent = self._send(seen)
                if sent:  # what it does shows later
                    return sent, ()
            if not self._is_done(seen):
                break
            self._left.pop(0)
            self._enter(seen)
        if not self._left:
            return [], self._finish(seen, now_us)
        reason = self._failure(seen)
        if reason is not None:
            self.over = True
            return [], [Failed(now_us, self._command.token, reason, seen.text)]
        return self._again(seen, now_us), ()

    # -------------------------------------------------------- what is sent

    def _enter(self, seen: Observed) -> None:
        self._entered_us, self._progress = seen.up_us, None
        if not self._left:
            self._commander.start(None, seen.up_us)
            return
        stage = self._left[0]
        self._before, self._modes = self.modes, stage.modes
        self._progress = None if stage.progress is None else Progress(stage.progress)
        if stage.stops and self._stop is None:
            self._stop = Stop(self._aids.brakes, seen)
        self._waits = stage.message is not None
        if not self._waits:
            self._commander.start(stage, seen.up_us)

    def _may_send(self, seen: Observed, now_us: int) -> bool:
        """Whether the mode is known well enough for a frame that moves the vehicle (docs/adr/0034)."""
        mode = self._aids.mode
        if self._command.kind in _URGENT and mode.is_young(seen, now_us):
            return True
        return mode.is_newer(seen)

    def _send(self, seen: Observed) -> list[Message]:
        """The message of the stage; none where it would ask for what is so already."""
        self._waits, self._entered_us = False, seen.up_us
        self._aids.mode.sent()
        target = self._left[0].target
        if target is not None or self._command.kind in _URGENT:  # else it is what it was: a mode, a speed, an arming
            self._aids.targets.expect(target, seen)
        if self._left[0].spare and self._is_done(seen):
            return []
        return self._commander.start(self._left[0], seen.up_us)

    def _again(self, seen: Observed, now_us: int) -> list[Message]:
        """The message once more, where it needs to be: never of a target that the autopilot flies to."""
        commander, stage = self._commander, self._left[0]
        goes = self._aids.targets.shown or (self._progress is not None and self._progress.shown)
        if self._waits or (stage.command is None and goes):
            return []
        if seen.up_us < commander.due_us or not self._may_send(seen, now_us):
            return []
        self._aids.mode.sent()
        self._aids.targets.told_again()
        return commander.due(seen.up_us)

    def _due_us(self, seen: Observed, now_us: int) -> int:
        """When to look again, in real time, unless something is seen before."""
        if self.over:
            return NEVER
        if not self._left:
            ends = self._held_us is not None and self._command.hold_us
            at_us = (self._held_us or 0) + self._command.hold_us if ends else NEVER
        elif self._waits:
            at_us = self._entered_us + MODE_UNKNOWN_US
        else:
            stage, commander = self._left[0], self._commander
            at_us = commander.due_us
            if stage.timeout_us:
                at_us = min(at_us, max(self._entered_us, commander.busy_us or 0) + stage.timeout_us * commander.slack)
            watched = [each.due_us for each in (self._progress, self._stop) if each is not None]
            at_us = min([at_us, *[due_us for due_us in watched if due_us is not None]])
        return now_us + max(at_us - seen.up_us, 0)

    # -------------------------------------------------------- what is seen

    def _is_done(self, seen: Observed) -> bool:
        stage = self._left[0]
        return self._commander.accepted if stage.done is None else stage.done(seen)

    def _finish(self, seen: Observed, now_us: int) -> Sequence[Event]:
        if self._command.kind == MotionKind.HOLD:
            reason = self._left_its_place(seen)
            if reason is not None:
                self.over = True
                return (Failed(now_us, self._command.token, reason, seen.text),)
            if self._held_us is None:
                self._held_us = seen.up_us
            if not self._command.hold_us or seen.up_us - self._held_us < self._command.hold_us:
                return ()
        self.over = True
        return (Succeeded(now_us, self._command.token),)

    def _left_its_place(self, seen: Observed) -> str | None:
        """Why a vehicle that came to stand does not hold, as a slug."""
        if seen.down:
            return "disarmed"
        if seen.located and self._stands is None:
            self._stands = seen.latitude, seen.longitude
        if seen.located and self._stands is not None:
            away = apart(seen.latitude, seen.longitude, *self._stands)
            if away > 2 * HOLDS_WITHIN or (away > HOLDS_WITHIN and not still(seen)):
                return "did-not-hold"
        return None

    def _taken_over(self, seen: Observed) -> str | None:
        """What shows that somebody else flies: a mode, a landing or a target that nothing of ours asked for.

        A mode may belong to this stage or, until its own mode showed, to those before.
        """
        if self._taken or seen.mode is None:
            return None
        homeward = self._command.kind in _HOMEWARD
        if seen.down and homeward:  # it is done: no flight is left
            return None
        if seen.mode in self._modes:
            self._before = frozenset()
        elif seen.mode not in self._before or self._was_taken_back(seen):
            return mode_name(self._flavour, seen.mode)
        self._was_landing = self._was_landing and seen.landing
        if seen.landing and not homeward and not self._was_landing:
            return "landing"
        return "another target" if self._aids.targets.is_foreign(seen) else None

    def _was_taken_back(self, seen: Observed) -> bool:
        """Whether our mode was accepted, and another shows in several reports since: somebody chose it again."""
        if not self._commander.accepted or self._commander.refused is not None or self._waits:
            self._accepted = None
            return False
        if self._accepted is None:
            self._accepted = seen.up_us, seen.beats
        accepted_us, beats = self._accepted
        return seen.up_us - accepted_us > TAKEN_BACK_US and seen.beats - beats >= TAKEN_BACK_BEATS

    def _failure(self, seen: Observed) -> str | None:
        """Why the present stage cannot be waited for any longer, as a slug."""
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
        waited_us = seen.up_us - max(self._entered_us, commander.busy_us or 0)
        if stage.timeout_us and waited_us > stage.timeout_us * commander.slack:
            return UNKNOWN if commander.waits else "no-effect"
        if self._progress is not None and self._progress.has_stalled(seen):
            if commander.waits:
                return UNKNOWN
            return "stopped-short" if still(seen) else "no-progress"
        return None
