"""What each event means: it changes what is known, and sometimes the stage; what follows is `Turns.turn`'s."""

from collections.abc import Sequence

from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import (
    WITHHELD,
    AirState,
    Anchored,
    ClockStepped,
    Crashed,
    Ending,
    Event,
    EvidenceFailed,
    EvidenceKept,
    Failed,
    Interrupted,
    LinkBack,
    LinkLost,
    Noted,
    Presented,
    Readings,
    Ready,
    Said,
    Sent,
    Succeeded,
    TakenOver,
)
from rtshcua.onboard.runtime.conduct import Conduct
from rtshcua.onboard.runtime.flight import Stage
from rtshcua.onboard.runtime.inbox import Inbox
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.wire.request import FALLBACK_LINK

#: how much of what a vehicle says is recorded, in letters
MOST_SAID = 200


#: what is taken over before a crash or a takeover: it changes no stage, and tells how it came to that
_TOLD = (Readings, Sent, ClockStepped, Said, Noted)


def last_words_first(events: Sequence[Event]) -> Sequence[Event]:
    """Events in the order in which they are to be taken over: as they came, unless one of them is a crash or a
    takeover. Nothing that came with it ends the run in another way, then, whichever the vehicle said first.
    """
    for event in events:
        if isinstance(event, (Crashed, TakenOver)):
            return sorted(events, key=_rank)
    return events


def _rank(event: Event) -> int:
    if isinstance(event, _TOLD):
        return 0
    return 1 if isinstance(event, Crashed) else 2 if isinstance(event, TakenOver) else 3


class Happenings:
    """Takes events over into a `Conduct`, and records those that matter."""

    def __init__(self, conduct: Conduct, journal: Journal) -> None:
        self._conduct = conduct
        self._journal = journal
        self._inbox = Inbox(conduct, journal)
        self._gap = False

    def take(self, now: Now, event: Event) -> None:
        """Take one event over. All are total: a late, repeated or senseless one changes nothing."""
        conduct = self._conduct
        match event:
            case Readings():
                conduct.monitor.update(event)
                conduct.fresh = True
            case Ready():
                conduct.craft.ready, conduct.craft.others = True, event.others
            case AirState():
                conduct.link.air_reported()
                self._air(now, event)
            case Sent():
                conduct.dispatcher.sent(event.token, event.at_us)
            case Succeeded():
                self._succeeded(now, event.token)
            case Failed():
                self._failed(now, event)
            case TakenOver() | Crashed():
                self._ended(now, event)
            case LinkLost() | LinkBack():
                self._link(now, event)
            case Interrupted():
                self._journal.effect(now, "interrupted")
                conduct.stop(now)
            case EvidenceFailed() | EvidenceKept():
                self._evidence(now, event)
            case ClockStepped():
                self._journal.effect(now, "clock-stepped", detail=f"{event.by_us:+d} us")
            case Said():
                self._journal.effect(now, "said", detail=f"{event.severity}: {event.text[:MOST_SAID]}")
            case Noted() | Anchored():
                self._noted(now, event)
            case Presented():
                self._inbox.take(now, event)

    def _noted(self, now: Now, event: Noted | Anchored) -> None:
        if isinstance(event, Anchored):
            self._journal.anchor(now, event.note)
        else:
            self._journal.effect(now, "noted", detail=event.text)

    def _air(self, now: Now, event: AirState) -> None:
        conduct, craft = self._conduct, self._conduct.craft
        was_airborne = craft.airborne
        craft.armed, craft.airborne = event.armed, event.airborne
        craft.flown = craft.flown or (event.airborne and conduct.dispatcher.dispatched)
        active = conduct.dispatcher.active
        if conduct.stage is Stage.DECIDING:
            self._between_steps(now)
        elif not (was_airborne and craft.at_rest):
            return
        elif conduct.stage is Stage.FALLING:
            conduct.dispatcher.end(now, "landed")
            conduct.down(now)
        elif conduct.stage is Stage.RUNNING and active is not None and not active.homeward:
            # It came down without being told to: whatever ran is over, and nothing is sent to a vehicle on the ground.
            self._came_down(now)

    def _between_steps(self, now: Now) -> None:
        """While a step waits: a flight that this run did not begin is the pilot's, and one that came down is over."""
        conduct, craft = self._conduct, self._conduct.craft
        if conduct.dispatcher.dispatched:
            if craft.at_rest:
                self._came_down(now)
        elif craft.airborne:
            self._journal.effect(now, "taken-over", detail="took off")
            conduct.stand_down(now, Ending.STOOD_DOWN)

    def _came_down(self, now: Now) -> None:
        conduct = self._conduct
        conduct.dispatcher.end(now, "landed")
        conduct.dispatcher.landed()
        conduct.end(now, Ending.ABORTED)

    def _succeeded(self, now: Now, token: int) -> None:
        conduct = self._conduct
        active = conduct.dispatcher.active
        if active is None or not conduct.dispatcher.flies(token):
            return
        conduct.dispatcher.end(now, "succeeded")
        running = conduct.stage is Stage.RUNNING
        if active.homeward:
            conduct.down(now)
        if running:
            conduct.advance(now)

    def _failed(self, now: Now, event: Failed) -> None:
        conduct = self._conduct
        if not conduct.dispatcher.flies(event.token):
            return
        detail = f"{event.reason}: {event.text}" if event.text else event.reason
        if conduct.link.down:
            detail += "; the link is silent: what the vehicle does is not known"
        conduct.dispatcher.end(now, "failed", detail)
        if conduct.stage is Stage.DECIDING and conduct.aloft:
            # It was a hold: whatever the vehicle does, it does not wait where it should.
            conduct.fall_back(FALLBACK_LINK, holds=False)
        if conduct.stage is not Stage.RUNNING:
            return
        if event.reason == WITHHELD and not conduct.recording:
            conduct.come_down(now, cause=Ending.EVIDENCE_LOST)
        elif conduct.aloft:
            conduct.fall_back(FALLBACK_LINK)
        else:
            conduct.end(now, Ending.ABORTED if conduct.craft.flown else Ending.REFUSED)

    def _ended(self, now: Now, event: TakenOver | Crashed) -> None:
        crashed = isinstance(event, Crashed)
        self._journal.effect(now, "crashed" if crashed else "taken-over", detail=event.how)
        self._conduct.stand_down(now, Ending.CRASHED if crashed else Ending.STOOD_DOWN)

    def _link(self, now: Now, event: LinkLost | LinkBack) -> None:
        conduct, link = self._conduct, self._conduct.link
        if isinstance(event, LinkLost):
            takes_off = conduct.dispatcher.active is not None and conduct.craft.airborne is not True
            if not link.lost(now.monotonic_us, event.heard_us or now.monotonic_us, takes_off=takes_off):
                return
            self._journal.effect(now, "link-lost", detail=event.why)
        elif (down_us := link.back(now.monotonic_us)) is not None:
            self._journal.effect(now, "link-back", detail=f"after {down_us // 1_000} ms")
        conduct.fresh = True

    def _evidence(self, now: Now, event: EvidenceFailed | EvidenceKept) -> None:
        """Recorded once a gap: the record may fail like the others, and be taken up when the sink can write again."""
        if isinstance(event, EvidenceFailed):
            if not self._gap:
                self._gap = True
                self._journal.effect(now, "gap", detail=event.reason)
            self._conduct.unrecorded(now)
            return
        if self._gap:
            self._gap = False
            self._journal.effect(now, "gap-over")
        self._conduct.recording = self._conduct.fresh = True
