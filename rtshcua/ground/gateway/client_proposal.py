"""Proposals under way: from a client's command to the flown step, and what the client is told meanwhile.

A command is acknowledged when its step is dispatched, or refused. Until then it is in progress: after `QUICK_US` the
client is told so, and again every `AGAIN_US`, because clients give up after some silence.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from rtshcua.ground.gateway.client_link import NOTICE, ClientLink
from rtshcua.ground.gateway.interface import ProposedStep
from rtshcua.ground.gateway.plan_transfer import MISSION_ACCEPTED, MISSION_DENIED
from rtshcua.mavlink import layouts
from rtshcua.mavlink.command_results import ACCEPTED, CANCELLED, DENIED, IN_PROGRESS, TEMPORARILY_REJECTED
from rtshcua.wire.request import STEP

#: from when on a waiting command is in progress, and how often that is repeated, us
QUICK_US: Final = 250_000
AGAIN_US: Final = 4_000_000
#: how long the worker may take to answer a proposal, us
PATIENCE_US: Final = 30_000_000
#: the events that end a step that was dispatched
_ENDS: Final = frozenset({"succeeded", "failed", "time-over", "superseded"})


#: the most who are answered for one proposal
_MOST_ASKING: Final = 16


class AskedBy(NamedTuple):
    """Who asked for a step: a connection and the sender behind it. `command` is the command to acknowledge, -1 for a
    message that is not acknowledged, and `guided` whether it came as a mission item, which MISSION_ACK answers.
    """

    link: ClientLink
    sender: tuple[int, int]
    command: int
    guided: bool = False

    def tell(self, result: int) -> None:
        """Answer with a MAV_RESULT."""
        if not self.guided and self.command >= 0:
            self.link.ack(self.sender, self.command, result)
        elif self.guided and result != IN_PROGRESS:
            accepted = MISSION_ACCEPTED if result == ACCEPTED else MISSION_DENIED
            system, component = self.sender
            self.link.send(layouts.MISSION_ACK, type=accepted, target_system=system, target_component=component)


@dataclass(slots=True)
class ClientProposal:
    """A proposal of one client. `link` is the connection that asked last, and all `asked_by` are answered."""

    number: int
    link: ClientLink
    asked_by: list[AskedBy]
    steps: tuple[ProposedStep, ...]
    began_us: int
    #: for the mission of a client: the item of each step
    item_of: tuple[int, ...] = ()
    #: the first step in the mission of the flight; -1 until the proposal is signed
    first: int = -1
    #: whether the flight took the document
    taken: bool = False
    #: the index among its steps of the one that was dispatched last; -1 before
    flies: int = -1
    #: whether the client was answered for good
    answered: bool = False
    ended: bool = False
    #: how many of its steps succeeded
    done: int = 0
    #: whether it was taken only because it makes the flight safer: that gives no control
    borrows: bool = False
    #: why it is not wanted any more, while the flight may still fly it; else empty
    withdrawn: str = ""
    told_us: int = 0
    #: notes of decisions that wait, each told once
    waits: set[str] = field(default_factory=set)

    def answer(self, result: int) -> None:
        """Answer the client for good, once."""
        if self.answered:
            return
        self.answered = True
        for each in self.asked_by:
            each.tell(result)

    @property
    def command(self) -> int:
        """The first command that is acknowledged; -1 if there is none."""
        return next((each.command for each in self.asked_by if each.command >= 0), -1)

    def refuse(self, result: int, text: str, now_us: int) -> None:
        """End it with a reason. A step that was acknowledged before is only told about; what was withdrawn before it
        began is cancelled, however it ends.
        """
        if not self.ended:
            self.ended = True
            self.link.text(text, now_us, "" if self.command >= 0 else "setpoint refused")
            self.link.record("refused", now_us, command=self.command, skill=self.steps[0].skill, reason=text)
            self.answer(CANCELLED if self.withdrawn else result)

    def supersede(self) -> None:
        """Another proposal takes its place."""
        self.ended = True
        self.answer(CANCELLED)

    def again(self, asked: AskedBy) -> None:
        """The same was asked for again, perhaps by another command or connection: each one is answered."""
        if self.answered:
            return
        self.link = asked.link
        if asked not in self.asked_by:
            if len(self.asked_by) >= _MOST_ASKING:
                asked.tell(TEMPORARILY_REJECTED)
                return
            self.asked_by.append(asked)
        if self.told_us:
            asked.tell(IN_PROGRESS)

    def move(self, gone: set[int], link: ClientLink) -> None:
        """Another connection of the client is there: it gets the answers to those that are gone."""
        self.link = link if self.link.client in gone else self.link
        moved = (each._replace(link=link) if each.link.client in gone else each for each in self.asked_by)
        self.asked_by = list(dict.fromkeys(moved))

    def tick(self, now_us: int) -> None:
        """Tell the client that it is in progress."""
        if self.ended or self.answered:
            return
        if now_us - (self.told_us or self.began_us - AGAIN_US + QUICK_US) >= AGAIN_US:
            self.told_us = now_us
            for each in self.asked_by:
                each.tell(IN_PROGRESS)

    def keep_before(self, first: int) -> None:
        """Another proposal replaced the mission of the flight from this step on."""
        if self.ended or self.first < 0 or self.first + len(self.steps) <= first:
            return
        if first <= self.first:
            self.supersede()
        else:
            self.steps = self.steps[: first - self.first]
            self.ended = self.done == len(self.steps)

    # ---------------------------------------------------------------- lines of the flight

    def line(self, line: Mapping[str, Any], now_us: int) -> bool:
        """A decision or effect of the flight; return whether it concerns one of its steps."""
        step = line.get("step", -1)
        at = step - self.first if isinstance(step, int) and self.first >= 0 else -1
        if self.ended or not 0 <= at < len(self.steps) or line.get("kind", STEP) != STEP:
            return False
        if line.get("type") == "decision":
            self._decided(line, at, now_us)
        else:
            self._happened(str(line.get("event")), at, now_us)
        return True

    def _decided(self, line: Mapping[str, Any], at: int, now_us: int) -> None:
        outcome, reason = str(line.get("outcome")), str(line.get("reason"))
        clause = line.get("clause")
        text = f"{self.steps[at].skill} {outcome}: {reason}" + (f" ({clause})" if isinstance(clause, str) else "")
        if outcome == "deny":
            self.refuse(DENIED, text, now_us)
        elif outcome == "fallback":
            self.refuse(TEMPORARILY_REJECTED, text, now_us)
        elif outcome == "defer":
            self._wait(reason, text, now_us)

    def wait_for(self, unready: str, now_us: int) -> None:
        """The vehicle is not ready for it: tell the client why, once."""
        if not (self.answered or self.ended):
            self._wait(unready, f"{self.steps[0].skill} waits: {unready}", now_us)

    def _wait(self, reason: str, text: str, now_us: int) -> None:
        if reason not in self.waits:
            self.waits.add(reason)
            self.link.text(text, now_us, severity=NOTICE)

    def _happened(self, event: str, at: int, now_us: int) -> None:
        if event == "dispatched":
            self.flies = at
            skill, arguments, _ = self.steps[at]
            self.link.record("permitted", now_us, skill=skill, step=self.first + at, arguments=dict(arguments))
            self.answer(ACCEPTED)
        elif event in _ENDS and at == self.flies:
            self.done = at + 1 if event == "succeeded" else self.done
            self.ended = event != "succeeded" or at + 1 == len(self.steps)
        elif event in ("refused", "declined", "skipped") and at > self.flies:
            self.refuse(TEMPORARILY_REJECTED, f"{self.steps[at].skill} rejected: the flight goes on without it", now_us)
