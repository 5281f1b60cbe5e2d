"""From evidence lines and the loaded bundle to what the view is told, after each step, and to the counts of the
summary. It never waits.
"""

import time
from base64 import b64decode
from collections.abc import Callable, Iterator, Sequence
from math import cos, isqrt, pi, sin
from typing import Final, NamedTuple

import msgspec

from rtshcua.adapters.preparation import PERMITTED
from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.story import (
    Area,
    Asks,
    FlightPlanView,
    Happened,
    Happening,
    LiveStep,
    Note,
    SignalFormat,
    Snapshot,
)
from rtshcua.app.fly.view_ports import LiveView
from rtshcua.decision.outline import rings
from rtshcua.evidence.log_writer import BOUNDARY
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.model.flat.signal import POSITION
from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.zone import CIRCLE, Zone
from rtshcua.model.outcome import Reason
from rtshcua.model.quantity import Dimension, display
from rtshcua.model.step_number import number_of, step_words
from rtshcua.onboard.calls import call
from rtshcua.onboard.ports import Action, Append, Event
from rtshcua.onboard.runtime.dispatcher import UNCONFIRMED
from rtshcua.onboard.runtime.view import RunStage, RuntimeView
from rtshcua.wire import cose, names
from rtshcua.wire.approval import ApprovalDocument
from rtshcua.wire.bundle import parse_unverified
from rtshcua.wire.document import kind_of
from rtshcua.wire.request import CONTINGENCY_LINK, STEP
from rtshcua.wire.untrusted import Untrusted

#: the effect that puts another mission into force
REPLACED = "replacement"
#: what flies instead of a step that is not admitted before anything flew
NOTHING_FLIES = "no command is sent, because the vehicle is on the ground"
#: what the boundary makes of what was told anyway
_UNTOLD = frozenset({BOUNDARY, PERMITTED})
_SNAPSHOT_S = 0.1
_WAITING_NOTE_S = 5.0
_OUTCOMES = ("allow", "deny", "defer", "fallback")


#: corners of a circle on the map, and of a zone at most
_CORNERS: Final = 48
_MOST_CORNERS: Final = 400
#: how long an answer is good that a clock ahead of ours is to take, s
_AHEAD_S: Final = 3_600


class Answering(NamedTuple):
    """How a person answers a step of this flight: the bundle, a socket of the flight, and whether the flight's clock
    runs ahead of ours.
    """

    bundle: str
    socket: str
    ahead: bool = False


class _Released(msgspec.Struct):
    """When what was decided on was released."""

    released_us: int = 0


class _Line(msgspec.Struct):
    """What is read of an evidence line; the rest of it is not looked at."""

    type: str
    at_us: int
    kind: int = -1
    step: int = -1
    link: int = -1
    event: str = ""
    outcome: str = ""
    reason: str = ""
    clause: str | None = None
    target: str | None = None
    detail: str = ""
    context: _Released | None = None


_read = msgspec.json.Decoder(_Line).decode


def plan_of(policy: Policy, mission: Mission, *, mode: str, speed: float) -> FlightPlanView:
    """The plan of a loaded bundle."""
    paths = [invocation.plan.path for invocation in mission.invocations if invocation.plan.kind != MotionKind.HOME]
    return FlightPlanView(
        mission=mission.name,
        intent=mission.intent,
        policy=f"{policy.name}@{policy.version}",
        vehicle=policy.vehicle.identity,
        mode=mode,
        speed=speed,
        phases=mission.phases,
        steps=tuple(LiveStep(call(policy, invocation), invocation.phase) for invocation in mission.invocations),
        signals=tuple(SignalFormat(signal.name, signal.dimension, dict(signal.labels)) for signal in policy.signals),
        position=next((signal.name for signal in policy.signals if signal.kind == POSITION), ""),
        path=tuple(point for path in paths for point in zip(path[::2], path[1::2], strict=True)),
        areas=tuple(_areas(policy)),
    )


def _areas(policy: Policy) -> Iterator[Area]:
    """The zones as they are drawn."""
    airspace = policy.airspace
    inside, outside = ((), ()) if airspace is None else (airspace.inside, airspace.outside)
    for number, zone in enumerate(policy.zones):
        kind = "inside" if number in inside else "outside" if number in outside else ""
        if kind or number < policy.declared:
            yield Area(zone.name, kind, tuple(_outline(zone)))


def _outline(zone: Zone) -> Iterator[tuple[int, ...]]:
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        radius, turns = isqrt(squared), [2 * pi * number / _CORNERS for number in range(_CORNERS)]
        yield tuple(round(each) for turn in turns for each in (x + radius * cos(turn), y + radius * sin(turn)))
        return
    for ring in rings(zone):
        yield tuple(each for corner in ring[:: 1 + len(ring) // _MOST_CORNERS] for each in corner)


class Teller:
    """Reads each evidence line once, counts, and says what happened.

    `outcomes` counts every decision of the log, on steps and on links alike: as `rtshcua verify-log` does.
    `unconfirmed` names the fallbacks of which no landing was seen. `answering`: how a person answers, where one can.
    `detail_of` gives an effect's detail in words, by its event.
    """

    def __init__(
        self, policy: Policy, mission: Mission, start_us: int, answering: Answering | None = None,
        detail_of: Callable[[str, str], str] = lambda event, detail: detail,
    ) -> None:  # fmt: skip
        self._detail_of = detail_of
        self._policy = policy
        self._mission = mission
        self._start_us = start_us
        self._answering = answering
        self._replaced = 0
        self._flown = False  # something was sent that may have lifted it off
        self.outcomes = dict.fromkeys(_OUTCOMES, 0)
        self.done: set[int] = set()
        self.unconfirmed: list[str] = []

    def replace(self, mission: Mission) -> None:
        """From now on this is the mission."""
        self._mission = mission
        self._replaced += 1

    def tell(self, line: bytes) -> Happening | None:
        """What a line says, if it is a decision or an effect."""
        record = _read(line)
        t_us = record.at_us - self._start_us
        subject = self._subject(record)
        if record.type == "decision":
            if record.outcome in self.outcomes:
                self.outcomes[record.outcome] += 1
            clause, target = record.clause or "", record.target or ""
            if target and not self._flown:
                target = NOTHING_FLIES
            waits = self._waits(clause, t_us) if record.outcome == "defer" else ""
            return Happening(
                "decision", t_us, record.step, subject, record.outcome, record.reason, clause, target, record.detail,
                waits, asks=self._asks(record),
            )  # fmt: skip
        if record.type != "effect" or record.event in _UNTOLD:
            return None
        self._flown = (self._flown or record.event == "dispatched") and record.event != "landed"
        if record.event == "succeeded" and record.kind == STEP:
            self.done.add(record.step)
        if record.kind > STEP and record.detail == UNCONFIRMED:
            self.unconfirmed.append(subject)
        if record.event == REPLACED:
            return Happening(record.event, t_us, record.step, detail=f"from {step_words(record.step)} on")
        detail = self._detail_of(record.event, record.detail)
        role = _agreed(record.detail) if record.event == "approval" else ""
        return Happening(record.event, t_us, record.step, subject, detail=detail, role=role)

    def _asks(self, record: _Line) -> Asks | None:
        """Whom a step waits for, where it waits for people."""
        if record.reason != Reason.AWAITING_APPROVAL.value or record.context is None:
            return None
        released_us = record.context.released_us
        return asks(
            self._policy, record.clause, record.step, record.at_us, released_us, self._answering, self._replaced
        )

    def _waits(self, text: str, t_us: int) -> str:
        """What is said of a clause over time, by its text, that was not observed for as long as it looks back."""
        window_us = max((self._looks_back(code) for code in self._codes(text)), default=0)
        if window_us <= t_us:
            return ""
        return f"it looks back {display(window_us, Dimension.DURATION)}, and observation began with the run"

    def _codes(self, text: str) -> Iterator[tuple[int, ...]]:
        """The codes of the rules and clauses of the policy and the mission that are written so."""
        contracts = (*self._policy.contracts, *(each.contract for each in self._mission.invocations))
        clauses = (each for one in contracts for each in (*one.require, *one.assume, *one.maintain))
        yield from (each.code for each in clauses if each.text == text)
        yield from (each.when.code for each in self._policy.rules if each.when is not None and each.text == text)

    def _looks_back(self, code: tuple[int, ...]) -> int:
        """How far, in us, with what it looks at in turn."""
        monitors = [self._policy.monitors[a] for op, a in zip(code[::3], code[1::3], strict=True) if op == Op.MONITOR]
        return max((each.window_us + self._looks_back(each.when.code) for each in monitors), default=0)

    def _subject(self, record: _Line) -> str:
        """The step or link that a record is about, as it was written."""
        if record.kind == CONTINGENCY_LINK:
            return f"contingency: {self._policy.contingency[record.link].text}"
        if record.kind < 0 or record.step < 0:
            return ""
        if record.step >= len(self._mission.invocations):
            return ""  # of a mission that is only just put into force
        invocation = self._mission.invocations[record.step]
        if record.kind == STEP:
            return call(self._policy, invocation)
        if record.link >= 0:
            return f"fallback: {invocation.contract.fallback[record.link].text}"
        targets = {rule.target.text for rule in self._policy.rules if rule.target is not None}
        return f"fallback: {targets.pop()}" if len(targets) == 1 else "fallback: what the policy degrades to"


def asks(
    policy: Policy, clause: str | None, step: int, at_us: int, released_us: int, answering: Answering | None,
    replaced: int = 0,
) -> Asks | None:  # fmt: skip
    """Whom a step waits for that was released then, by the `confirm` of this text; None where the policy has none such.

    `replaced` is how many replacements came before.
    """
    rule = next((each for each in policy.rules if each.kind == RuleKind.CONFIRM and each.text == clause), None)
    if rule is None:
        return None
    roles = tuple(policy.roles[number] for number in (rule.approver, rule.second) if number >= 0)
    commands = () if answering is None else tuple(_commands(answering, step, roles, replaced))
    return Asks(roles, at_us, released_us + rule.within_us, commands)


def _commands(answering: Answering, step: int, roles: tuple[str, ...], replaced: int) -> Iterator[tuple[str, ...]]:
    """What to type as each of these roles."""
    bundle, socket, ahead = answering
    for role in dict.fromkeys(roles):
        yield (
            "rtshcua", "approve", bundle, *("--replacement", "FILE") * replaced,
            "--step", str(number_of(step)), "--role", role, *(("--for", str(_AHEAD_S)) if ahead else ()),
            "--to", socket,
        )  # fmt: skip


def _agreed(detail: str) -> str:
    """The role of whoever agreed by the document that a log holds; empty where it is no yes."""
    try:
        document = b64decode(detail, validate=True)
        if kind_of(document) is not names.APPROVAL:
            return ""
        body = parse_unverified(names.APPROVAL, cose.unverified(document).payload, ApprovalDocument)
    except (ValueError, Untrusted):
        return ""
    return body.role if body.granted else ""


class Watching:
    """The loop's `watch`. `view` makes a snapshot, `unready` says what it waits for; `live`: one that is drawn.

    `replan` is asked for the plan after the mission was replaced; `agents` are told of everything too.
    """

    def __init__(
        self, feed: LiveView, teller: Teller, view: Callable[[Now], RuntimeView], unready: Callable[[], str | None], *,
        live: bool, replan: Callable[[], FlightPlanView] | None = None, agents: Agents | None = None,
    ) -> None:  # fmt: skip
        self._feed = feed
        self._teller = teller
        self._view = view
        self._unready = unready
        self._live = live
        self._replan = replan
        self._agents = agents
        self._waited_for = ""
        self._shown_s = self._waited_s = time.monotonic()

    def __call__(self, now: Now, events: Sequence[Event], actions: Sequence[Action]) -> None:
        """One step was made."""
        for action in actions:
            if isinstance(action, Append):
                what = self._teller.tell(action.line)
                if what is not None:
                    if what.event == REPLACED and self._replan is not None:
                        self._feed.post(self._replan())
                    self._feed.post(Happened(what))
        if self._agents is not None:
            self._agents.watch(actions)
        moment_s = time.monotonic()
        if moment_s - self._shown_s >= _SNAPSHOT_S:
            self._shown_s = moment_s
            self._show(now, moment_s)

    def _show(self, now: Now, moment_s: float) -> None:
        self._feed.flush()
        if not self._live and moment_s - self._waited_s < _WAITING_NOTE_S:
            return
        view = self._view(now)
        if self._live:
            self._feed.post(Snapshot(view), keep=False)
        if moment_s - self._waited_s >= _WAITING_NOTE_S:
            self._waited_s = moment_s
            unready = self._unready()
            if view.stage is RunStage.WAITING and unready is not None and unready != self._waited_for:
                self._waited_for = unready
                self._feed.post(Note(f"waiting for the vehicle: {unready}"))
