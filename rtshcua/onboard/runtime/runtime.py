"""The runtime: events in, actions out; no clock, no I/O, one thread, and the same actions for the same events.

`EventHandler` takes in what happened, `MissionController` does what follows, `Journal` collects that as actions.
"""

from base64 import b64encode
from collections.abc import Sequence
from typing import Final

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.image_records import IMAGE, IMAGES_MISSING, ImageLedger, MissingDetail, encoded
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.model.flat.situation import Now
from rtshcua.onboard import ports
from rtshcua.onboard.enforcement.boundary import SoftwareBoundary
from rtshcua.onboard.enforcement.isolated import IsolatedBoundary
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Command, Crashed, Ending, Event, Readings, Reply, TakenOver
from rtshcua.onboard.runtime.controller import MissionController
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import RunStage, RuntimeView
from rtshcua.wire import names
from rtshcua.wire.document import kind_of
from rtshcua.wire.receipt import APPROVAL, CANCELLATION, RECALL, UNKNOWN, Receipt, decode
from rtshcua.wire.request import STEP, Ref
from rtshcua.wire.untrusted import Untrusted

#: how much of a vehicle's text is recorded, in letters
MOST_SAID: Final = 200
#: the effect that records what a gateway says of one of its clients
CLIENT: Final = "client"
#: the least interval between records of refused documents, in us: a flood must not fill the disk
REFUSED_EVERY_US: Final = 1_000_000

#: events that are processed before a crash or a takeover: they change no stage, and explain its cause
_TOLD: Final = (
    Readings, ports.Sent, ports.Obeyed, ports.ClockStepped, ports.StatusText, ports.Noted, ports.Hindered,
    ports.ImageReported, ports.ImagesExpected,
)  # fmt: skip


class Runtime:
    """Flies one loaded bundle once.

    The caller has made the log's genesis with `recorder` before, and makes its close after `End`. `resumed` says
    that an earlier run of this bundle was interrupted: in the air the contingency brings the vehicle down; armed
    on the ground it is told to land, because it may have been commanded to take off; at rest nothing flies.
    `idle_us`: the mission is live, and waits so long in the air for its next step; None: it ends with its last one.
    """

    def __init__(
        self, loaded: Loaded, recorder: Recorder, *, limits: Limits | None = None, resumed: bool = False,
        idle_us: int | None = None,
    ) -> None:  # fmt: skip
        recorder.lost = lambda: loaded.boundary.lost
        self._journal = Journal(recorder)
        limits = limits or Limits()
        self._controller = MissionController(loaded, self._journal, limits, resumed=resumed, idle_us=idle_us)
        self._handler = EventHandler(self._controller, self._journal, loaded.boundary)
        self._stalled_us = limits.stalled_us
        self._stepped_us: int | None = None  # time of the last step

    @property
    def ending(self) -> Ending | None:
        """How the run ended; None while it goes on."""
        return self._controller.ending

    def step(self, now: Now, events: Sequence[Event]) -> list[Action]:
        """The actions at `now`, which never goes back, after `events` in order.

        Call it on every event, and every few tens of ms, because time limits end without an event. Each call is
        one observation of the policy's temporal monitors, after the events and before the decisions. After the end
        of the run it does nothing.
        """
        self.react(now, events)
        return self.actions(now)

    def react(self, now: Now, events: Sequence[Event]) -> Command | None:
        """The first half of a step: a command that needs no record and is the first action, so that it may be sent
        before the records are made. `actions` contains it once more, in its place.
        """
        controller, monitor = self._controller, self._controller.monitor
        before_us, self._stepped_us = self._stepped_us, now.monotonic_us
        if before_us is not None and now.monotonic_us - before_us > self._stalled_us and not controller.ended:
            controller.stalled(now, before_us)
        for event in last_words_first(events):
            if isinstance(event, Readings) and controller.stage is RunStage.RUNNING and monitor.hides(event):
                controller.turn(now)  # no state goes unobserved, however many came at once
                monitor.seen()
            if not controller.ended:
                self._handler.take(now, event)
        monitor.observe(now)
        while controller.turn(now):
            pass
        return self._journal.reflex

    def actions(self, now: Now) -> list[Action]:
        """The second half of a step, at the same moment: all actions, in order."""
        ended = self._controller.ended
        if not ended:
            self._journal.tell_counted(now)
        return self._journal.take(now, ended=ended)

    def prepare(self, now: Now) -> None:
        """Call after `step` when there is nothing else to do: evaluates in advance the running step's fallback at the
        vehicle's present place. No decision, record or frame depends on it.
        """
        self._controller.prepare(now)

    def leave(self) -> None:
        """Nobody will watch any more: the next step sends the last link, unless a return or a landing flies."""
        self._controller.leave()

    @property
    def aloft(self) -> bool:
        """Whether a motion command may be needed to bring the vehicle down."""
        return self._controller.aloft

    @property
    def used_up(self) -> bool:
        """Whether the bundle may not fly any more: a command of it was dispatched, or it was recalled or cancelled. A
        bundle that was refused, deferred or interrupted on the ground may fly.
        """
        return self._controller.dispatcher.used or self.ending in (Ending.RECALLED, Ending.CANCELLED)

    @property
    def may_fly(self) -> str:
        """The warning that the vehicle may be flying after the end of the run, its last known state, and why nothing
        watches it; empty if a landing was observed, or nothing was sent.
        """
        return self._controller.may_fly

    @property
    def linked(self) -> bool:
        """Whether the vehicle is heard."""
        return not self._controller.link.down

    @property
    def homeward(self) -> bool:
        """Whether the flying command brings the vehicle home or down, and its link is not lost."""
        return self._controller.dispatcher.homeward and self.linked

    def view(self, now: Now) -> RuntimeView:
        """The state of the run for display."""
        return self._controller.view(now.monotonic_us)


def last_words_first(events: Sequence[Event]) -> Sequence[Event]:
    """The events in the order of processing: as they came, unless one of them is a crash or a takeover. Then no other
    event that came with it determines how the run ends, in any order.
    """
    for event in events:
        if isinstance(event, (Crashed, TakenOver)):
            return sorted(events, key=_rank)
    return events


def _rank(event: Event) -> int:
    if isinstance(event, _TOLD):
        return 0
    return 1 if isinstance(event, Crashed) else 2 if isinstance(event, TakenOver) else 3


class EventHandler:
    """Processes events one by one: records those that matter, and passes each to the part that owns the affected
    state.

    Documents go to the boundary, which alone decides whether they are trusted. An accepted document is recorded
    completely, so that an audit can verify it again; a refused one by its slug, at most once every
    `REFUSED_EVERY_US`.
    """

    def __init__(
        self, controller: MissionController, journal: Journal, boundary: SoftwareBoundary | IsolatedBoundary
    ) -> None:
        self._controller = controller
        self._journal = journal
        self._boundary = boundary
        self._images = ImageLedger()
        self._told_missing: dict[tuple[int, int], MissingDetail] = {}  # by camera and series
        self._gap = False  # records cannot be stored, and that was recorded
        self._refused_us: int | None = None  # when a refused document was last recorded,
        self._unrecorded = 0  # and how many were refused since

    def take(self, now: Now, event: Event) -> None:
        """Process one event. A late, repeated or meaningless event changes nothing."""
        controller = self._controller
        match event:
            case Readings():
                controller.monitor.update(event)
                controller.retry.news()
            case ports.Ready():
                controller.vehicle.is_ready(event.others)
            case ports.AirState():
                controller.air_reported(now, event)
            case ports.Sent():
                controller.dispatcher.sent(event.token, event.at_us)
            case ports.Succeeded():
                controller.succeeded(now, event.token)
            case ports.CommandFailed():
                controller.failed(now, event)
            case TakenOver() | Crashed():
                self._ended(now, event)
            case ports.LinkLost():
                controller.link_lost(now, event)
            case ports.LinkBack():
                controller.link_back(now)
            case ports.VehicleAnswers():
                controller.link.answering(now.monotonic_us, answers=event.answers)
            case ports.Interrupted():
                self._journal.effect(now, "interrupted")
                controller.stop(now)
            case ports.EvidenceFailed():
                self._evidence_failed(now, event.reason)
            case ports.EvidenceKept():
                self._evidence_kept(now)
            case ports.Presented():
                self._presented(now, event)
            case _:
                self._record(now, event)

    def _record(self, now: Now, event: Event) -> None:
        """Record an event without an immediate effect."""
        match event:
            case ports.VehicleUnfit():
                self._controller.unfit(event.why)
            case ports.ClockStepped():
                self._journal.effect(now, "clock-stepped", detail=f"{event.by_us:+d} us")
            case ports.StatusText():
                self._journal.effect(now, "said", detail=f"{event.severity}: {event.text[:MOST_SAID]}")
            case ports.Noted():
                self._journal.note(now, event.text)
            case ports.ClientRecord():
                self._journal.effect(now, CLIENT, detail=event.text)
            case ports.Obeyed():
                self._controller.dispatcher.obeyed(now, event)
            case ports.Hindered():
                self._controller.dispatcher.hindered(now, event)
            case ports.PayloadOutcome():
                self._controller.dispatcher.told_of_payload(now, event)
            case ports.Anchored():
                self._journal.effect(now, ANCHORED, detail=event.note)
            case ports.ImageReported():
                if self._images.add(event.detail) is None:
                    self._journal.effect(now, IMAGE, detail=event.detail)
            case ports.ImagesExpected():
                self._images_expected(now, event)

    def _images_expected(self, now: Now, event: ports.ImagesExpected) -> None:
        """Record which images are missing, where that is not recorded already."""
        told = self._images.missing(event.camera, event.series, event.first, event.last)
        key = told.camera, told.series
        if (told.taken or told.missing or told.failed) and self._told_missing.get(key) != told:
            self._told_missing[key] = told
            self._journal.effect(now, IMAGES_MISSING, detail=encoded(told))

    def _ended(self, now: Now, event: TakenOver | Crashed) -> None:
        crashed = isinstance(event, Crashed)
        failsafe = isinstance(event, TakenOver) and event.failsafe
        how = f"by its own failsafe: {event.how}" if failsafe else event.how
        self._journal.effect(now, "crashed" if crashed else "taken-over", detail=how)
        ending, paused = Ending.CRASHED if crashed else Ending.STOOD_DOWN, event.how == ports.PAUSED
        self._controller.stand_down(now, ending, failsafe=failsafe, paused=paused)

    def _evidence_failed(self, now: Now, reason: str) -> None:
        """Recorded once for each failure: the record may fail too, and is stored when the sink works again."""
        if not self._gap:
            self._gap = True
            self._journal.effect(now, "gap", detail=reason)
        self._controller.evidence_failed(now)

    def _evidence_kept(self, now: Now) -> None:
        if self._gap:
            self._gap = False
            self._journal.effect(now, "gap-over")
        self._controller.evidence_kept()

    # -------------------------------------------------------- documents

    def _presented(self, now: Now, event: ports.Presented) -> None:
        """Present one document, apply its result, and answer."""
        receipt = self._receipt(now, event)
        if receipt.accepted:
            self._accepted(now, receipt, event.envelope or b64encode(event.document).decode())
        else:
            self._refused(now, receipt)
        self._journal.add(Reply(event.sender, receipt.slug, receipt.text))

    def _receipt(self, now: Now, event: ports.Presented) -> Receipt:
        document = event.document
        if event.refused is not None:
            return Receipt(UNKNOWN, *event.refused)
        if self._controller.stage is RunStage.FALLING and not _recalls(document):
            return Receipt(UNKNOWN, "falling-back", "the mission is over: the vehicle falls back")
        receipt = decode(self._boundary.present(document, now, self._controller.released))
        return Receipt(UNKNOWN, "unanswered", receipt.text) if isinstance(receipt, Refusal) else receipt

    def _accepted(self, now: Now, receipt: Receipt, envelope: str) -> None:
        controller, journal = self._controller, self._journal
        controller.retry.news()
        if receipt.kind == APPROVAL:
            journal.effect(now, "approval", Ref(STEP, receipt.step, -1), detail=envelope)
        elif receipt.kind == RECALL:
            journal.effect(now, "recall", detail=envelope)
            controller.recall(now)
        elif receipt.kind == CANCELLATION:
            journal.effect(now, "cancellation", detail=envelope)
            controller.cancel(now)
        else:
            journal.effect(now, "replacement", Ref(STEP, receipt.step, -1), detail=envelope)
            controller.replaced(now, receipt.step)

    def _refused(self, now: Now, receipt: Receipt) -> None:
        at_us = now.monotonic_us
        if self._refused_us is not None and at_us - self._refused_us < REFUSED_EVERY_US:
            self._unrecorded += 1
            return
        more = f" ({self._unrecorded} before it were refused too)" if self._unrecorded else ""
        self._refused_us, self._unrecorded = at_us, 0
        self._journal.effect(now, "document-refused", detail=f"{receipt.slug}: {receipt.text}{more}")


def _recalls(document: bytes) -> bool:
    try:
        return kind_of(document) is names.RECALL
    except Untrusted:
        return False
