"""The journal: turns the runtime's results into actions, each preceded by its evidence line."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Final

from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.records import is_signed
from rtshcua.model.durability import SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Action, Append, Command
from rtshcua.wire.request import NOTHING, Ref

#: the least interval between records of notes with the same text, in us: those between are counted
REPEATED_EVERY_US: Final = 30_000_000
#: the most texts that are counted; with more, each note is recorded
_MOST_TEXTS = 64

#: makes the line of a report, and its announcement
Telling = Callable[[], Iterable[Action]]
#: the text of a report, or a function that makes it when it is recorded
Detail = str | Callable[[], str]


def said(detail: Detail) -> str:
    """The text of a report."""
    return detail if isinstance(detail, str) else detail()


class Journal:
    """Collects the actions of one `Runtime.step`, in order. All lines have the time of that step.

    Reports are made when the actions are taken, because a fallback is sent before them (`reflex`). An epoch that
    is long overdue is sealed before anything else is recorded, unless the boundary is found lost: then the records
    of its entries come first.
    """

    def __init__(self, recorder: Recorder) -> None:
        self.recorder = recorder
        self._alone = False  # the boundary is lost, which is recorded, or will be before anything else
        self._entries: list[Action | Telling] = []
        self._first: Action | None = None  # actions other than reports
        self._noted: dict[str, int] = {}  # when a text was last recorded as a note,
        self._again: dict[str, int] = {}  # how often it was noted since,
        self._last: dict[str, int] = {}  # and when last

    @property
    def reflex(self) -> Command | None:
        """The command that needs no record, if it is the first action of this step: no report could prevent it, so it
        may be sent before they are made.
        """
        first = self._first
        return first if isinstance(first, Command) and not first.needs_record else None

    def add(self, action: Action) -> None:
        """Add an action."""
        if self._first is None:
            self._first = action
        self._entries.append(action)

    def tell(self, telling: Telling) -> None:
        """Add a report by the function that makes it, which is called once, in order."""
        self._entries.append(telling)

    def record(self, line: Callable[[], bytes], now: Now, durability: int, *, awaited: bool) -> Iterable[Action]:
        """Make one record within a report; `line` requests it from the recorder."""
        if self.recorder.overdue(now):
            yield from self._seal(now, tells_loss=False)
        yield Append(line(), durability, awaited)

    def effect(self, now: Now, event: str, ref: Ref = NOTHING, *, token: int = -1, detail: Detail = "") -> None:
        """Record an event. `detail` may be text from outside."""
        self.look_at_boundary(now)
        line = partial(self._effect, now, event, ref, token, detail)
        self._entries.append(partial(self.record, line, now, WRITTEN, awaited=False))

    def look_at_boundary(self, now: Now) -> bool:
        """Record the loss of the boundary, once, before its consequences; returns whether it is lost."""
        if not self._alone and self.recorder.lost() is not None:
            self._alone = True
            self._entries.append(partial(self._told_loss, now))
        return self._alone

    def _told_loss(self, now: Now) -> Iterable[Action]:
        if self.recorder.overdue(now):
            yield from self._seal(now)
        for line in self.recorder.loss(now):  # unless a seal recorded it
            yield Append(line, WRITTEN, awaited=False)

    def _effect(self, now: Now, event: str, ref: Ref, token: int, detail: Detail) -> bytes:
        return self.recorder.effect(now, event, ref, token=token, detail=said(detail))

    def note(self, now: Now, text: str) -> None:
        """Record a note; if the same text was recorded recently, count it instead."""
        before_us = self._noted.get(text)
        if text in self._again or (before_us is not None and now.monotonic_us - before_us < REPEATED_EVERY_US):
            self._again[text] = self._again.get(text, 0) + 1
            self._last[text] = now.monotonic_us
            return
        if len(self._noted) < _MOST_TEXTS:
            self._noted[text] = now.monotonic_us
        self.effect(now, "noted", detail=text)

    def tell_counted(self, now: Now, *, ended: bool = False) -> None:
        """Record how often notes were repeated, after their interval or at the end of the run."""
        due = [text for text in self._again if ended or now.monotonic_us - self._noted[text] >= REPEATED_EVERY_US]
        for text in due:
            count = self._again.pop(text)
            self._noted[text] = now.monotonic_us
            more = f"{count} more {'time' if count == 1 else 'times'}"
            last_us = self._last.pop(text)
            since = (*self._noted.items(), *self._last.items())
            if any(other != text and last_us < at_us for other, at_us in since):  # it may be the opposite
                more += f", the last {(now.monotonic_us - last_us) // 1_000_000} s ago"
            self.effect(now, "noted", detail=f"{text} ({more})")

    def take(self, now: Now, *, ended: bool) -> list[Action]:
        """Take the actions since the last call. An epoch that is over is sealed, unless a command is sent; after the
        end of the run the close is the seal.
        """
        entries, self._entries, self._first = self._entries, [], None
        actions: list[Action] = []
        for entry in entries:
            if callable(entry):
                actions += entry()
            else:
                actions.append(entry)
        if not ended and self.recorder.due(now) and not any(isinstance(action, Command) for action in actions):
            actions += self._seal(now)
        return actions

    def _seal(self, now: Now, *, tells_loss: bool = True) -> Iterable[Append]:
        """End an epoch. Nothing waits for a seal, but it is stored soon, because its checkpoint may be published."""
        for line in self.recorder.sealing(now, tells_loss=tells_loss):
            yield Append(line, SYNCED_FIRST if is_signed(line) else WRITTEN, awaited=False)
