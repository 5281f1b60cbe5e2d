"""The timeline of a flight: its records as events in lanes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from rtshcua.app.telling.record_prose import Names
from rtshcua.evidence.records import DecisionRecord, Effect
from rtshcua.ground.flight.flight_content import TimelineEvent
from rtshcua.ground.flight.flown import Flight
from rtshcua.model.flat.mission import Mission
from rtshcua.onboard.runtime.dispatcher import OBEYED
from rtshcua.onboard.runtime.link import STOOD_STILL
from rtshcua.wire.request import STEP

_ALARM, _CALM = "violated", "observed"
#: effects that are told in a lane, with the lane and the class of the style
IN_LANE: Final[Mapping[str, tuple[str, str]]] = {
    "replacement": ("proposed", "document"),
    "cancellation": ("proposed", "document"),
    "document-refused": ("proposed", "deny"),
    "declined": ("proposed", "deny"),
    "client": ("proposed", "client"),
    "undecided": ("decided", "deny"),
    "skipped": ("decided", "deny"),
    "approval": ("approvals", "document"),
    "recall": ("approvals", "recall"),
    OBEYED: ("observed", _CALM),
    "landed": ("observed", _CALM),
    "not-landed": ("observed", _ALARM),
    "failed": ("observed", _ALARM),
    "refused": ("observed", _ALARM),
    "violated": ("fallback", _ALARM),
    "time-over": ("fallback", _ALARM),
    "taken-over": ("vehicle", _ALARM),
    "stood-down": ("vehicle", _ALARM),
    "interrupted": ("vehicle", _ALARM),
    "already-airborne": ("vehicle", _ALARM),
    "resumed": ("vehicle", _ALARM),
    "left": ("vehicle", _ALARM),
    "stranded": ("vehicle", _ALARM),
    "crashed": ("vehicle", _ALARM),
    "never-ready": ("vehicle", _ALARM),
    "link-lost": ("vehicle", _ALARM),
    "long-silence": ("vehicle", _ALARM),
    "not-fresh": ("vehicle", _ALARM),
    "link-back": ("vehicle", _CALM),
    "fresh": ("vehicle", _CALM),
    "gap": ("vehicle", _ALARM),
    "gap-over": ("vehicle", _CALM),
    "stalled": ("vehicle", _ALARM),
    STOOD_STILL: ("vehicle", _ALARM),
    "clock-stepped": ("vehicle", _ALARM),
    "frames-lost": ("vehicle", _ALARM),
    "boundary-lost": ("vehicle", _ALARM),
}


def timeline(flight: Flight, first: Mission, names: Names, *, details: bool) -> tuple[TimelineEvent, ...]:
    """The events of a flight whose bundle had the mission `first`, by time; without `details` no texts from outside."""
    return tuple(_merged([*_before(flight, first), *_Events(flight, names, details=details).all()]))


def _before(flight: Flight, first: Mission) -> Iterator[TimelineEvent]:
    genesis = flight.genesis
    issued_us, received_us = first.issued_at_us - genesis.utc_us, genesis.received_us - genesis.at_us
    yield TimelineEvent("proposed", issued_us, None, "document", f"mission `{first.name}` issued")
    yield TimelineEvent("compiled", received_us, None, "document", "the signed bundle received on board", 0)


class _Events:
    def __init__(self, flight: Flight, names: Names, *, details: bool) -> None:
        self._flight, self._names, self._details = flight, names, details
        self._running: dict[int, tuple[int, Effect]] = {}  # by the token of the command

    def all(self) -> Iterator[TimelineEvent]:
        flight = self._flight
        for record in flight.records:
            if isinstance(record, DecisionRecord):
                told = " ".join(self._names.tell(record).split())
                lane = "decided" if record.kind == STEP else "fallback"
                yield TimelineEvent(lane, flight.since_begun(record), None, record.outcome, told, record.seq)
            elif isinstance(record, Effect):
                yield from self._of(record)
        end_us = flight.lasted_us
        for began_us, record in self._running.values():
            yield self._ran(record, began_us, end_us, "its end is not recorded")

    def _of(self, record: Effect) -> Iterator[TimelineEvent]:
        t_us = self._flight.since_begun(record)
        if record.event == "dispatched":
            self._running[record.token] = t_us, record
        elif record.token in self._running and record.event != OBEYED:  # it has the token of what it ends
            began_us, began = self._running.pop(record.token)
            yield self._ran(began, began_us, t_us, record.event)
        if record.event in IN_LANE:
            lane, kind = IN_LANE[record.event]
            told = " ".join(self._names.tell(record).removeprefix("·").split())
            if not self._details:
                told = f"{record.event} {self._names.subject(record.kind, record.step, record.link)}".strip()
            yield TimelineEvent(lane, t_us, None, kind, told, record.seq)

    def _ran(self, record: Effect, from_us: int, to_us: int, how: str) -> TimelineEvent:
        step = record.kind == STEP
        subject = self._names.subject(record.kind, record.step, record.link)
        flies = "" if self._names.text(record.kind, record.step, record.link) else self._names.detail(record)
        told = f"{subject}{f', `{flies}`' if flies else ''}: {how}"
        return TimelineEvent(
            "dispatched" if step else "fallback", from_us, to_us, "step" if step else "link", told, record.seq
        )


def _merged(events: Sequence[TimelineEvent]) -> list[TimelineEvent]:
    """The events by time; equal moments of a lane in a row, such as those of a step that waits, as one."""
    kept: dict[str, TimelineEvent] = {}
    merged: list[TimelineEvent] = []
    for event in sorted(events, key=lambda each: each.t_us):
        last = kept.get(event.lane)
        if last is None or (last.kind, last.told, last.until_us) != (event.kind, event.told, None):
            merged.append(event)
        kept[event.lane] = event
    return merged
