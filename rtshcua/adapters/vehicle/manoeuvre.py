"""One command under way: stage after stage, each ended by its observed effect."""

from collections.abc import Sequence

from rtshcua.adapters.vehicle.commander import NEVER, RESULTS, Commander
from rtshcua.adapters.vehicle.effects import still
from rtshcua.adapters.vehicle.flavour import Flavour, Message, Stage, mode_name
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, Event, Failed, Succeeded, TakenOver

#: A vehicle that should travel and stands still for this long has stopped short of its target.
STOPPED_US = 10_000_000
#: Never answered, and no effect seen: it may have been executed, or be executed yet.
UNKNOWN = "unknown/no-answer"


class Manoeuvre:
    """Runs the stages of `command`; after its last effect, and a HOLD's time, it has succeeded.

    It goes on watching the flight mode after that, until another manoeuvre takes its place: whoever else changes it,
    the pilot or the autopilot's own failsafe, has taken over. `before` are the modes that may still show at its start,
    while its own has not come.
    """

    def __init__(
        self, command: Command, flavour: Flavour, seen: Observed, stages: list[Stage], commander: Commander,
        before: frozenset[int] = frozenset(),
    ) -> None:  # fmt: skip
        self._command = command
        self._flavour = flavour
        self._left = stages
        self._commander = commander
        self._entered_us = 0
        self._stopped_us: int | None = None
        self._held_us: int | None = None
        self._before = before if seen.mode is None else before | {seen.mode}
        self._modes: frozenset[int] = frozenset()
        self._taken = False
        self.over = False
        #: until then `advance` has nothing to say, unless something is observed or acknowledged
        self.due_us = 0

    @property
    def token(self) -> int:
        """Of its command."""
        return self._command.token

    @property
    def modes(self) -> frozenset[int]:
        """The flight modes in which nobody has taken over."""
        return self._modes | self._before

    def start(self, seen: Observed, now_us: int) -> list[Message]:
        """The first messages to send."""
        seen.hush()
        return self._enter(now_us)

    def advance(self, seen: Observed, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        """Messages to send and events, after something was observed or time went by."""
        out = self._advance(seen, now_us)
        self.due_us = self._due_us()
        return out

    def _advance(self, seen: Observed, now_us: int) -> tuple[list[Message], Sequence[Event]]:
        if self._taken_over(seen):
            self.over = self._taken = True
            return [], [TakenOver(now_us, mode_name(self._flavour, seen.mode or 0))]
        if self.over:
            return [], ()
        send: list[Message] = []
        while self._left and self._is_done(seen):
            self._left.pop(0)
            send += self._enter(now_us)
        if not self._left:
            return send, self._finish(seen, now_us)
        reason = self._failure(seen, now_us)
        if reason is not None:
            self.over = True
            return send, [Failed(now_us, self._command.token, reason, seen.text)]
        return send + self._commander.due(now_us), ()

    def _due_us(self) -> int:
        if self.over:
            return NEVER
        if not self._left:
            ends = self._held_us is not None and self._command.hold_us
            return (self._held_us or 0) + self._command.hold_us if ends else NEVER
        stage, commander = self._left[0], self._commander
        due_us = commander.due_us
        if stage.timeout_us:
            due_us = min(due_us, max(self._entered_us, commander.busy_us or 0) + stage.timeout_us * commander.slack)
        return due_us if self._stopped_us is None else min(due_us, self._stopped_us + STOPPED_US)

    def _enter(self, now_us: int) -> list[Message]:
        self._entered_us, self._stopped_us = now_us, None
        if not self._left:
            return self._commander.start(None, now_us)
        self._before, self._modes = self.modes, self._left[0].modes
        return self._commander.start(self._left[0], now_us)

    def _is_done(self, seen: Observed) -> bool:
        done = self._left[0].done
        return self._commander.accepted if done is None else done(seen)

    def _finish(self, seen: Observed, now_us: int) -> Sequence[Event]:
        if self._command.kind == MotionKind.HOLD:
            if seen.down:
                self.over = True
                return (Failed(now_us, self._command.token, "disarmed", seen.text),)
            if self._held_us is None:
                self._held_us = now_us
            if not self._command.hold_us or now_us - self._held_us < self._command.hold_us:
                return ()
        self.over = True
        return (Succeeded(now_us, self._command.token),)

    def _taken_over(self, seen: Observed) -> bool:
        """A mode that belongs neither to this stage nor, until its own mode showed, to those before."""
        if self._taken or seen.mode is None:
            return False
        if seen.down and self._command.kind in (MotionKind.HOME, MotionKind.LAND):  # it is done: no flight is left
            return False
        if seen.mode in self._modes:
            self._before = frozenset()
            return False
        return seen.mode not in self._before

    def _failure(self, seen: Observed, now_us: int) -> str | None:
        """Why the present stage cannot be waited for any longer, as a slug."""
        stage, commander = self._left[0], self._commander
        if commander.refused is not None:
            return f"refused/{RESULTS.get(commander.refused, str(commander.refused))}"
        if stage.powered and seen.down:
            return "disarmed"
        waited_us = now_us - max(self._entered_us, commander.busy_us or 0)
        if stage.timeout_us and waited_us > stage.timeout_us * commander.slack:
            return UNKNOWN if commander.waits else "no-effect"
        if not (stage.travels and still(seen)):
            self._stopped_us = None
        elif self._stopped_us is None:
            self._stopped_us = now_us
        elif now_us - self._stopped_us > STOPPED_US:
            return UNKNOWN if commander.waits else "stopped-short"
        return None
