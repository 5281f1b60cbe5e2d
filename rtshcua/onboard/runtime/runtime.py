"""The runtime: events in, actions out; no clock, no I/O, one thread, and the same actions for the same events."""

from collections.abc import Sequence

from rtshcua.decision.links import look_ahead
from rtshcua.evidence.chain import Recorder
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Dispatch, Ending, Event, Readings
from rtshcua.onboard.runtime.conduct import Conduct
from rtshcua.onboard.runtime.flight import Limits, Stage
from rtshcua.onboard.runtime.happenings import Happenings, last_words_first
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.snapshot import view_of
from rtshcua.onboard.runtime.turns import Turns
from rtshcua.onboard.runtime.view import View

_RUNNING, _ENDED = Stage.RUNNING, Stage.ENDED  # an enumeration's attributes are slow to find


class Runtime:
    """Flies one loaded bundle once.

    The caller has made the log's genesis with `recorder` before, and makes its close after `End`. `resumed` says that
    an earlier run of this bundle broke off: in the air the contingency brings the vehicle down, on the ground nothing
    flies.
    """

    def __init__(
        self, loaded: Loaded, recorder: Recorder, *, limits: Limits | None = None, resumed: bool = False
    ) -> None:
        self._journal = Journal(recorder)
        self._conduct = Conduct(loaded, self._journal, limits or Limits(), resumed=resumed)
        self._turns = Turns(self._conduct)
        self._happenings = Happenings(self._conduct, self._journal)

    @property
    def ending(self) -> Ending | None:
        """How the run ended; None while it goes on."""
        return self._conduct.ending

    def step(self, now: Now, events: Sequence[Event]) -> list[Action]:
        """What to do at `now`, which never goes back, after `events` in the order in which they happened.

        To be called whenever something happens, and every few tens of ms: times run out without an event. Each call is
        one observation of the policy's temporal monitors, after what was received and before what is decided. Once the
        run ended, nothing is done any more.
        """
        self.react(now, events)
        return self.actions(now)

    def react(self, now: Now, events: Sequence[Event]) -> Dispatch | None:
        """The first half of a step: a command that is held for no record, and comes first of all that is to be done, so
        that it may be sent before the records are made. `actions` has it once more, in its place.
        """
        conduct, monitor, turns = self._conduct, self._conduct.monitor, self._turns
        for event in last_words_first(events):
            if isinstance(event, Readings) and conduct.stage is _RUNNING and monitor.hides(event):
                turns.turn(now)  # no state goes by unwatched, however many came at once
                monitor.seen()
            if conduct.stage is not _ENDED:
                self._happenings.take(now, event)
        monitor.observe(now)
        while turns.turn(now):
            pass
        return self._journal.reflex

    def actions(self, now: Now) -> list[Action]:
        """The second half of a step, at the same moment: all that is to be done, in its order."""
        return self._journal.take(now, ended=self._conduct.stage is _ENDED)

    def prepare(self, now: Now) -> None:
        """To be called after `step` when nothing else is to be done: what the running step's fallback would need where
        the vehicle is now is looked at ahead. Nothing that is decided, recorded or sent depends on it.
        """
        conduct, monitor = self._conduct, self._conduct.monitor
        current = conduct.queue.current
        if monitor.moved and conduct.stage is _RUNNING and current is not None:
            monitor.moved = False
            prepared = conduct.loaded.invocations[current.step]
            look_ahead(prepared, monitor.state(now.monotonic_us), conduct.loaded.policy, now)

    def leave(self) -> None:
        """Nobody will watch any more: the next step sends the last link, unless a return or a landing flies."""
        self._conduct.leave()

    @property
    def aloft(self) -> bool:
        """Whether a motion command may be needed to bring the vehicle down."""
        return self._conduct.aloft

    @property
    def linked(self) -> bool:
        """Whether the vehicle is heard."""
        return not self._conduct.link.down

    @property
    def homeward(self) -> bool:
        """Whether the command that flies brings the vehicle home or down, and its link is not lost."""
        active = self._conduct.dispatcher.active
        return active is not None and active.homeward and self.linked

    def view(self, now: Now) -> View:
        """What a display may show."""
        return view_of(self._conduct, now.monotonic_us)
