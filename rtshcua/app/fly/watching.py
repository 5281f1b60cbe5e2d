"""What the flying process tells the view after each step: what happened, and how things stand. It never waits."""

import time
from collections.abc import Callable, Sequence

from rtshcua.app.fly.agents import Agents
from rtshcua.app.fly.console import LiveView
from rtshcua.app.fly.narrator import REPLACED, Teller
from rtshcua.app.fly.story import Happened, Note, Plan, Snapshot
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Action, Append, Event
from rtshcua.onboard.runtime.view import RunStage, RuntimeView

_SNAPSHOT_S = 0.1
_WAITING_NOTE_S = 5.0


class Watching:
    """The loop's `watch`. `view` makes a snapshot, `unready` says what it waits for; `live`: one that is drawn.

    `replan` is asked for the plan after the mission was replaced; `agents` are told of everything too.
    """

    def __init__(
        self, feed: LiveView, teller: Teller, view: Callable[[Now], RuntimeView], unready: Callable[[], str | None], *,
        live: bool, replan: Callable[[], Plan] | None = None, agents: Agents | None = None,
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
