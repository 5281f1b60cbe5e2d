"""Properties checked from outside during a run. This module does not know how a run works.

`Gate` wraps the executor and opens every permit itself; `Ear` receives the records; `Watch` compares both, and
the sent commands, with the bundle.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from model.small import GRACE, LIMITS, UNIT
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import (
    Action,
    AirState,
    Command,
    CommandFailed,
    Crashed,
    End,
    Ending,
    Event,
    LinkBack,
    LinkLost,
    Release,
    Reply,
    Succeeded,
    TakenOver,
)
from rtshcua.wire.permit import LINK_VALID_US, WITHDRAWN, open_permit
from rtshcua.wire.request import NOTHING, STEP, Ref

_OVER = ("succeeded", "failed", "violated", "time-over", "replaced", "landed", "released")
_HOMEWARD = (MotionKind.HOME, MotionKind.LAND)


class Ear(Recorder):
    """A recorder that keeps the records of one step instead of writing lines."""

    def __init__(self, of: Recorder) -> None:
        super().__init__(lambda text: b"", of._public, lambda: bytes(32))
        self.heard: list[tuple[str, Ref, dict[str, Any]]] = []
        self.passed: list[Command] = []

    def due(self, now: object) -> bool:
        return False  # seals do not change the state of a search

    overdue = due

    def effect(self, now: object, event: str, ref: Ref = NOTHING, **fields: Any) -> bytes:  # type: ignore[override]
        self.heard.append((event, ref, fields))
        return b""

    def decision(self, now: object, ref: Ref, *inputs: Any) -> bytes:  # type: ignore[override]
        answer = next(each for each in inputs if isinstance(each, Decision))
        self.heard.append(("decision", ref, {"outcome": answer.outcome.name.lower()}))
        return b""


class Gate:
    """The executor, with its permits opened independently."""

    def __init__(self, executor: Any, key: bytes, ear: Ear) -> None:
        self._of = executor
        self._key = key
        self._ear = ear

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._of, name)

    def dispatch(self, sealed: bytes, now_us: int) -> Command | Refusal:
        result = self._of.dispatch(sealed, now_us)
        if isinstance(result, Command):
            permit = open_permit(sealed, self._key)
            assert permit is not None, "forged"
            assert permit.serial == result.token
            assert now_us <= permit.not_after_us, "late"
            assert result.not_after_us <= permit.not_after_us, "longer than permitted"
            self._ear.passed.append(result)
        return result

    def stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        result = self._of.stand_in(sealed, kind, link, now_us)
        if isinstance(result, Command):
            permit = open_permit(sealed, self._key)
            assert permit is not None, "forged"
            assert permit.kind == STEP
            assert kind != STEP, "only links stand behind a permit"
            assert permit.serial < result.token
            self._ear.passed.append(result)
        return result


#: records that show a judgement of the state
_JUDGED = ("fresh", "decision", "dispatched", "violated", "time-over", "long-silence")
_STALE_US = UNIT + UNIT // 2
_UNKNOWN = "unknown for longer"


@dataclass
class Watch:
    """The observations so far."""

    resumed: bool = False  # an earlier run of this bundle was interrupted
    down: bool = False  # the link
    silent: bool = False  # a silence: until state is judged again
    lost_us: int = 0  # the time of the last link loss,
    back_us: int | None = None  # and of the first return in this silence
    awaited: bool = False  # the known state was current when the link was lost
    heard_us: int = 0  # the time of the vehicle's last report
    unknown_us: int | None = None  # how long a value has been unknown with the link up; None: all known
    unstopped: bool = False  # a hold failed, and nothing was sent since
    now_us: int = 0

    flying: int | None = None  # the token of the running command
    command: object | None = None
    step: int = -1  # the last step that was sent
    unsent: tuple[int, bool] = (-1, False)  # the earlier `step` and `ours`
    tokens: set[int] = field(default_factory=set)
    allowed: set[int] = field(default_factory=set)  # steps
    homeward: bool = False  # a link began a return or a landing
    recalled: bool = False
    released: bool = False
    ours: bool = False  # a flight of this run has not landed
    airborne: bool | None = None
    armed: bool | None = None
    ending: Ending | None = None

    def before(self, event: Event | None, now_us: int, heard_us: int, *, known: bool) -> None:
        """Observe the vehicle's events. `known`: all of its last values are known."""
        passed_us = now_us - self.now_us if self.now_us else 0
        self.now_us, self.heard_us = now_us, heard_us
        stale = now_us - heard_us > _STALE_US
        if known and not stale:
            self.unknown_us = None
        else:
            before_us = self.unknown_us
            self.unknown_us = 0 if before_us is None else min(before_us + (0 if self.down else passed_us), 2 * UNIT)
        if isinstance(event, AirState):
            self.airborne, self.armed = event.airborne, event.armed
        elif isinstance(event, LinkLost) and not self.down:
            self.down, self.lost_us = True, now_us
            self.back_us = self.back_us if self.silent else None
            self.awaited, self.silent = self.awaited or not stale, True
        elif isinstance(event, LinkBack) and self.down:
            self.down = False
            self.back_us = now_us if self.back_us is None else self.back_us
        elif isinstance(event, CommandFailed) and event.token == self.flying and self.ending is None:
            self.unstopped = self.command == MotionKind.HOLD

    def after(self, of: Loaded, ear: Ear, event: Event | None, actions: Sequence[Action], now_us: int) -> None:
        """Check one step of the runtime."""
        sent = [action for action in actions if isinstance(action, Command)]
        assert [id(each) for each in sent] == [id(each) for each in ear.passed], "sent past the executor"
        assert not (self.ending and actions), f"after the end: {list(map(type, actions))}"
        was_over = self.ending is not None
        self._judged(ear, ended=any(isinstance(action, End) for action in actions))
        order = iter(sent)
        if isinstance(event, Succeeded) and event.token == self.flying and self.command in _HOMEWARD:
            self.ours = False  # that is what its success means; who flies it next is somebody else
        fresh: set[Ref] = set()
        for what, ref, said in ear.heard:
            if what == "decision":
                if said["outcome"] == "allow":
                    fresh.add(ref)
                    if ref.kind == STEP:
                        self.allowed.add(ref.step)
            elif what == "dispatched":
                self._dispatched(of, next(order), ref, said, fresh, now_us)
            elif what in _OVER and said.get("token", -1) >= 0:
                assert said["token"] == self.flying, "what ended did not fly"
                self.flying = None
                self.ours = self.ours and what != "landed"
            elif what == "refused" and said["detail"] == WITHDRAWN:
                assert self.flying is None, "under way, and withdrawn"
                assert ref.step == self.step, "another was sent since"
                self.step, self.ours = self.unsent
                self.allowed.discard(ref.step)
            elif what == "recall":
                self.recalled = True
        assert next(order, None) is None, "sent, and not recorded"
        self._ended(actions)
        if isinstance(event, (TakenOver, Crashed)) and not was_over:
            grave = Ending.CRASHED if isinstance(event, Crashed) else Ending.STOOD_DOWN
            assert self.released, "it went on after a takeover or a crash"
            assert self.ending is grave, "it went on after a takeover or a crash"
        self._stopped()
        if self.flying is None:
            self.command = None

    def _judged(self, ear: Ear, *, ended: bool) -> None:
        """Nothing is judged while the link is down, nor on what was known before it was, while it may still come."""
        stale = self.now_us - self.heard_us > _STALE_US and self.heard_us <= self.lost_us
        waits = self.back_us is not None and self.now_us < self.back_us + LIMITS.flapping_us
        for what, _, said in ear.heard:
            if what in ("fresh", "not-fresh"):
                self.silent = False
            if what in _JUDGED:
                assert not self.down, "judged while the link was down"
                assert not (self.awaited and stale and waits), "judged what was known before a silence"
            if what == "violated" and _UNKNOWN in said.get("detail", ""):
                assert (self.unknown_us or 0) > GRACE, "its grace ran while the link was down"
        if not self.down:
            assert waits or not self.silent or self.ending or ended, "judging was put off for too long"
            self.awaited = self.awaited and stale and waits
            self.back_us = self.back_us if waits else None
            self.lost_us = self.lost_us if waits else 0

    def _stopped(self) -> None:
        """A hold that failed is followed by something else, as soon as state may be judged."""
        if self.flying is not None or self.ending is not None:
            self.unstopped = False
        waits = self.down or self.silent or self.back_us is not None
        assert not self.unstopped or waits, "left flying after a stop that failed"

    def _dispatched(
        self, of: Loaded, command: Command, ref: Ref, said: dict[str, Any], fresh: set[Ref], now_us: int
    ) -> None:
        kind, step, link = ref
        assert not self.released, "sent after standing down"
        assert self.flying is None, "two commands at once"
        assert command.token == said["token"]
        assert command.token not in self.tokens, "one permit, sent twice"
        policy = of.bundle.policy
        if kind == STEP:
            assert not self.resumed, "a step of a run that broke off before"
            assert not self.unstopped, "a step after a hold that failed"
            assert ref in fresh, "a step without its decision"
            assert not self.homeward, "a step after a return or a landing began"
            assert not self.recalled, "a step after a recall"
            assert step > self.step, "a step again, or behind one that was sent"
            assert command.needs_record
            invocation = of.bundle.mission.invocations[step]
            plan, contract = invocation.plan, invocation.contract
            bounds = (plan.kind, plan.path, plan.altitude, plan.speed)
            assert (command.kind, command.path, command.altitude, command.speed) == bounds, "not what was permitted"
            assert command.not_after_us <= now_us + contract.deadline_us
            self.unsent = self.step, self.ours
            self.step = step
        else:
            assert ref in fresh or self.allowed, "a link that nothing stands for"
            assert kind == 2 or step in self.allowed or ref in fresh
            chain = policy.contingency if kind == 2 else of.bundle.mission.invocations[step].contract.fallback
            targets = [rule.target.skill for rule in policy.rules if rule.target is not None]  # no policy here has two
            contract = policy.contracts[chain[link].skill if link >= 0 else targets[0]]
            assert command.not_after_us <= now_us + LINK_VALID_US or ref not in fresh
            self.homeward = self.homeward or contract.motion.kind in _HOMEWARD
        assert (command.skill, command.kind) == (contract.name, contract.motion.kind), "another skill"
        self.ours = True
        self.flying, self.command = command.token, command.kind
        self.tokens.add(command.token)

    def _ended(self, actions: Sequence[Action]) -> None:
        for number, action in enumerate(actions):
            if isinstance(action, Release):
                self.released = True
            if isinstance(action, End):
                after = [each for each in actions[number + 1 :] if not isinstance(each, Reply)]
                assert not after, f"after the end: {after}"
                self.ending = action.ending
                at_rest = self.airborne is False and self.armed is False
                assert self.released or at_rest or not self.ours, "it ended in the air"
                assert self.flying is None, "it ended under way"
