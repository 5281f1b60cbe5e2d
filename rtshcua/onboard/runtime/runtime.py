"""The runtime: events in, actions out; no clock, no I/O, one thread, and the same actions for the same events."""

from collections.abc import Sequence

from rtshcua.evidence.chain import Recorder
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Action, Dispatch, Ending, Event, Readings
from rtshcua.onboard.runtime.controller import MissionController
from rtshcua.onboard.runtime.events import EventHandler, last_words_first
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import Stage, View

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
        self._controller = MissionController(loaded, self._journal, limits or Limits(), resumed=resumed)
        self._handler = EventHandler(self._controller, self._journal, loaded.boundary)

    @property
    def ending(self) -> Ending | None:
        """How the run ended; None while it goes on."""
        return self._controller.ending

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
        controller, monitor = self._controller, self._controller.monitor
        for event in last_words_first(events):
            if isinstance(event, Readings) and controller.stage is _RUNNING and monitor.hides(event):
                controller.turn(now)  # no state goes by unwatched, however many came at once
                monitor.seen()
            if controller.stage is not _ENDED:
                self._handler.take(now, event)
        monitor.observe(now)
        while controller.turn(now):
            pass
        return self._journal.reflex

    def actions(self, now: Now) -> list[Action]:
        """The second half of a step, at the same moment: all that is to be done, in its order."""
        return self._journal.take(now, ended=self._controller.stage is _ENDED)

    def prepare(self, now: Now) -> None:
        """To be called after `step` when nothing else is to be done: what the running step's fallback would need where
        the vehicle is now is looked at ahead. Nothing that is decided, recorded or sent depends on it.
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
    def linked(self) -> bool:
        """Whether the vehicle is heard."""
        return not self._controller.link.down

    @property
    def homeward(self) -> bool:
        """Whether the command that flies brings the vehicle home or down, and its link is not lost."""
        return self._controller.dispatcher.homeward and self.linked

    def view(self, now: Now) -> View:
        """What a display may show."""
        return self._controller.view(now.monotonic_us)
