"""Translate evidence lines into messages for the live view, and count decisions for the summary. Never waits."""

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
from rtshcua.evidence.image_records import IMAGE, IMAGES_MISSING, PAYLOAD_FAILED, read_image, read_missing
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

#: the event of an effect that puts another mission into force
REPLACED = "replacement"
#: shown in place of the fallback of a step that is refused before take-off
NOTHING_FLIES = "no command is sent, because the vehicle is on the ground"
#: effects that repeat other records, and those of each picture
_NOT_SHOWN = frozenset({BOUNDARY, PERMITTED, IMAGE, "payload.sent", "payload.done"})
_SNAPSHOT_S = 0.1
_WAITING_NOTE_S = 5.0
_OUTCOMES = ("allow", "deny", "defer", "fallback")


#: the corners of a drawn circle, and the most corners of a drawn zone
_CORNERS: Final = 48
_MOST_CORNERS: Final = 400
#: the validity of an answer for a flight whose clock runs ahead, in seconds
_AHEAD_S: Final = 3_600


class Answering(NamedTuple):
    """What an approval of a step of this flight needs: the bundle, a socket, and whether the flight's clock runs
    `ahead` of this machine's.
    """

    bundle: str
    socket: str
    ahead: bool = False


class _Released(msgspec.Struct):
    """The release time in the context of a decision."""

    released_us: int = 0


class _Line(msgspec.Struct):
    """The fields of an evidence line that are read; others are ignored."""

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
    """The plan of a loaded bundle, for the view."""
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
    """The zones to draw."""
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


class ImageCounts:
    """The images of a flight in numbers: taken, failed, and missing by the last lists; and the commands to payload that
    failed.
    """

    def __init__(self) -> None:
        self.taken = self.failed = self.commands_failed = 0
        self._missing: dict[tuple[int, int], int] = {}

    @property
    def missing(self) -> int:
        """The number of missing images."""
        return sum(self._missing.values())

    def add(self, event: str, detail: str) -> None:
        """Count an effect, if it is about images."""
        if event == IMAGE and (image := read_image(detail)) is not None:
            self.taken += image.result
            self.failed += 1 - image.result
        elif event == IMAGES_MISSING and (told := read_missing(detail)) is not None:
            self._missing[told.camera, told.series] = told.missing
        elif event == PAYLOAD_FAILED:
            self.commands_failed += 1


class Teller:
    """Translates each evidence line into a `Happening`, and counts.

    `outcomes` counts all decisions of the log, as `rtshcua verify-log` does. `unconfirmed` are the fallbacks whose
    landing was not observed. `answering` is given if people can answer. `detail_of` formats the detail of an effect by
    its event.
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
        self._flown = False  # a command was sent that may have lifted the vehicle off
        self.outcomes = dict.fromkeys(_OUTCOMES, 0)
        self.done: set[int] = set()
        self.unconfirmed: list[str] = []
        self.images = ImageCounts()

    def replace(self, mission: Mission) -> None:
        """Use `mission` from now on."""
        self._mission = mission
        self._replaced += 1

    def tell(self, line: bytes) -> Happening | None:
        """The happening in an evidence line; None if the line is not shown."""
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
        if record.type == "effect":
            self.images.add(record.event, record.detail)
        if record.type != "effect" or record.event in _NOT_SHOWN:
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
        """The people for whom a step waits; None if it waits for none."""
        if record.reason != Reason.AWAITING_APPROVAL.value or record.context is None:
            return None
        released_us = record.context.released_us
        return asks(
            self._policy, record.clause, record.step, record.at_us, released_us, self._answering, self._replaced
        )

    def _waits(self, text: str, t_us: int) -> str:
        """A note if the clause with this text looks back further than the run has observed; else empty."""
        window_us = max((self._looks_back(code) for code in self._codes(text)), default=0)
        if window_us <= t_us:
            return ""
        return f"the clause looks back {display(window_us, Dimension.DURATION)}, but observation began with the run"

    def _codes(self, text: str) -> Iterator[tuple[int, ...]]:
        """The codes of all rules and clauses of policy and mission with this text."""
        contracts = (*self._policy.contracts, *(each.contract for each in self._mission.invocations))
        clauses = (each for one in contracts for each in (*one.require, *one.assume, *one.maintain))
        yield from (each.code for each in clauses if each.text == text)
        yield from (each.when.code for each in self._policy.rules if each.when is not None and each.text == text)

    def _looks_back(self, code: tuple[int, ...]) -> int:
        """How far a code looks back, in us, including nested monitors."""
        monitors = [self._policy.monitors[a] for op, a in zip(code[::3], code[1::3], strict=True) if op == Op.MONITOR]
        return max((each.window_us + self._looks_back(each.when.code) for each in monitors), default=0)

    def _subject(self, record: _Line) -> str:
        """The source text of the step or fallback of a record."""
        if record.kind == CONTINGENCY_LINK:
            return f"contingency: {self._policy.contingency[record.link].text}"
        if record.kind < 0 or record.step < 0:
            return ""
        if record.step >= len(self._mission.invocations):
            return ""  # a step of a mission that has just come into force
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
    """The people for whom a step released at `released_us` waits, by the `confirm` rule with the text `clause`; None if
    there is no such rule. `replaced` is the number of earlier replacements.
    """
    rule = next((each for each in policy.rules if each.kind == RuleKind.CONFIRM and each.text == clause), None)
    if rule is None:
        return None
    roles = tuple(policy.roles[number] for number in (rule.approver, rule.second) if number >= 0)
    commands = () if answering is None else tuple(_commands(answering, step, roles, replaced))
    return Asks(roles, at_us, released_us + rule.within_us, commands)


def _commands(answering: Answering, step: int, roles: tuple[str, ...], replaced: int) -> Iterator[tuple[str, ...]]:
    """The command for an approval in each of the roles."""
    bundle, socket, ahead = answering
    for role in dict.fromkeys(roles):
        yield (
            "rtshcua", "approve", bundle, *("--replacement", "FILE") * replaced,
            "--step", str(number_of(step)), "--role", role, *(("--for", str(_AHEAD_S)) if ahead else ()),
            "--to", socket,
        )  # fmt: skip


def _agreed(detail: str) -> str:
    """The role in a logged approval; empty if the document is not an approval or was denied."""
    try:
        document = b64decode(detail, validate=True)
        if kind_of(document) is not names.APPROVAL:
            return ""
        body = parse_unverified(names.APPROVAL, cose.unverified(document).payload, ApprovalDocument)
    except (ValueError, Untrusted):
        return ""
    return body.role if body.granted else ""


class Watching:
    """The loop's `watch`: posts happenings and snapshots to the view, and all actions to `agents`. `view` makes a
    snapshot, `unready` returns why the vehicle is not ready, `replan` the plan after a replacement. `live`: snapshots
    are drawn.
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
        """Report one turn of the loop."""
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
