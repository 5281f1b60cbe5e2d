"""The conduct of a mission: where a run stands, and what ends it or turns it homeward (design section 4.4)."""

from rtshcua.model.flat.policy import WithoutEvidence
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import End, Ending
from rtshcua.onboard.runtime.admission import Admission
from rtshcua.onboard.runtime.craft import Craft
from rtshcua.onboard.runtime.dispatcher import Dispatcher
from rtshcua.onboard.runtime.fallback import Fallback
from rtshcua.onboard.runtime.flight import Limits, Stage
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.link import Link
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.onboard.runtime.patience import Patience
from rtshcua.onboard.runtime.queue import InvocationQueue
from rtshcua.onboard.runtime.remaining import RemainingLatency
from rtshcua.onboard.runtime.supervisor import Supervisor
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK

#: what ends a run matters more the further down it stands
_GRAVITY = (Ending.ABORTED, Ending.RECALLED, Ending.INTERRUPTED, Ending.EVIDENCE_LOST)


class Conduct:
    """The state of a run. `ending` is None until it ended, `cause` until the mission was given up."""

    def __init__(self, loaded: Loaded, journal: Journal, limits: Limits, *, resumed: bool) -> None:
        self.loaded = loaded
        self.journal = journal
        self.limits = limits
        self.resumed = resumed
        self.stage = Stage.WAITING
        self.ending: Ending | None = None
        self.cause: Ending | None = None
        self.craft = Craft()
        self.queue = InvocationQueue(loaded.bundle.mission)
        self.monitor = StateMonitor(loaded.policy)
        self.link = Link(loaded.bundle.policy, self.monitor, limits)
        remaining = RemainingLatency()
        self.admission = Admission(loaded, journal, self.queue, remaining)
        self.dispatcher = Dispatcher(loaded.executor, journal, remaining)
        self.fallback = Fallback(loaded, self.admission, self.dispatcher, limits)
        self.supervisor: Supervisor | None = None
        self.patience = Patience(loaded)
        self.fresh = True  # something was received, or began, since the current step was last asked for
        self.asked_us = 0  # when that was
        self.held = False  # a hold for the current step was tried
        self.recording = True  # records are kept, or the policy does not ask
        self.stopping = False  # somebody asked this program to stop

    @property
    def aloft(self) -> bool:
        """Whether a motion command may be needed: a command is under way, or a flight of this bundle is not at rest.

        A flight that somebody else began is none of ours, whatever happens. After a restart of ours the vehicle counts
        as in the air until it says that it is not.
        """
        if self.dispatcher.active is not None:
            return True
        if self.dispatcher.dispatched:
            return not self.craft.at_rest
        return self.resumed and self.craft.airborne is not False

    # -------------------------------------------------------- what ends a run, or turns it homeward

    def break_off(self, now: Now, cause: Ending) -> None:
        """Give the mission up: what runs falls back, in the air the contingency flies, on the ground the run ends.

        What already brings the vehicle home or down goes on.
        """
        self._blame(cause)
        if not self.aloft:
            self.end(now, cause)
        elif self.stage is Stage.RUNNING and not self.dispatcher.homeward:
            self.fall_back(FALLBACK_LINK, cause)
        elif self.stage in (Stage.WAITING, Stage.DECIDING):
            self.fall_back(CONTINGENCY_LINK, cause)

    def stop(self, now: Now) -> None:
        """Somebody asked this program to stop, and waits for it."""
        if not self.stopping:
            self.stopping = True
            self.link.hurry(now.monotonic_us)
        self.break_off(now, Ending.INTERRUPTED)

    def unrecorded(self, now: Now) -> None:
        """Records are not kept: as the policy says, the mission is given up, or no further step begins."""
        if self.loaded.bundle.policy.without_evidence == WithoutEvidence.REFUSE:
            self.recording = False
        else:
            self.break_off(now, Ending.EVIDENCE_LOST)

    def call_back(self, now: Now, cause: Ending) -> None:
        """The vehicle is called back: in the air the contingency flies, on the ground the run ends.

        What already brings the vehicle home or down goes on.
        """
        self._blame(cause)
        homeward = self.stage is Stage.RUNNING and self.dispatcher.homeward
        if not self.aloft:
            self.end(now, cause)
        elif self.stage is not Stage.FALLING and not homeward:
            self.fall_back(CONTINGENCY_LINK, cause)

    def replaced(self, first: int) -> None:
        """A replacement is in force: the steps from `first` on, none of which was released, are others now."""
        self.queue.replace(self.loaded.bundle.mission)
        self.admission.replaced(first)

    def fall_back(self, kind: int, cause: Ending = Ending.ABORTED, *, holds: bool = True) -> None:
        """Fly the current step's chain, or the contingency, down to the ground. Without `holds`, links that hold are
        passed over: a hold has just failed.

        A vehicle that has not left the ground is told to land and nothing else: a return or a hold makes no sense
        there, and a take-off that is under way, not yet seen to have armed it, must not go on by itself.
        """
        self._blame(cause)
        current = self.queue.current
        if self.craft.airborne is False:
            self.fallback.land()
        else:
            self.fallback.begin(kind, current.step if current is not None and kind == FALLBACK_LINK else -1, holds)
        self.stage = Stage.FALLING

    def leave(self) -> None:
        """Nobody will watch any more: unless it is on its way home or down already, the last link flies."""
        if self.stage is not Stage.ENDED and self.aloft and not self.dispatcher.homeward:
            self._blame(Ending.INTERRUPTED)
            self.fallback.land()
            self.stage = Stage.FALLING

    def stand_down(self, now: Now, ending: Ending) -> None:
        """Send nothing more, whatever flies, and end."""
        self.dispatcher.release(now)
        self.journal.effect(now, "stood-down", detail=self.craft.last_seen)
        self.end(now, ending)

    def end(self, now: Now, ending: Ending) -> None:
        """End the run."""
        self.admission.flush(now)
        self.stage = Stage.ENDED
        self.ending = ending
        self.loaded.executor.release()
        self.journal.add(End(ending))

    def down(self, now: Now) -> None:
        """The vehicle is on the ground again: the flight is over, and with it a fallback."""
        self.dispatcher.landed()
        self.craft.armed = self.craft.airborne = False
        if self.stage is Stage.FALLING:
            self.end(now, self.cause or Ending.ABORTED)

    def advance(self, now: Now) -> None:
        """The current step is done, or skipped."""
        self.queue.advance(now.monotonic_us)
        self.supervisor = None
        self.patience.renew()
        self.held = False
        # Where no step begins without records, the disk first gets a moment to say what became of those so far.
        self.fresh = self.loaded.bundle.policy.without_evidence != WithoutEvidence.REFUSE
        self.asked_us = now.monotonic_us
        self.stage = Stage.DECIDING

    def _blame(self, cause: Ending) -> None:
        if self.cause is None or _GRAVITY.index(cause) > _GRAVITY.index(self.cause):
            self.cause = cause

    def come_down(self, now: Now, kind: int = CONTINGENCY_LINK, cause: Ending = Ending.ABORTED) -> bool:
        """The mission is over: in the air a chain flies, on the ground the run ends."""
        if cause is not Ending.ABORTED:
            self._blame(cause)
        if not self.aloft:
            return self.give_up(now)
        self.fall_back(kind)
        return True

    def give_up(self, now: Now) -> bool:
        """End on the ground; refused if nothing ever flew."""
        self.end(now, self.cause or (Ending.ABORTED if self.craft.flown else Ending.REFUSED))
        return False
