"""The conduct of a mission: what is to be done now, by stage (design section 4.4).

What a step that is not admitted does: denied in the air, the contingency flies, and nothing that the step itself says
is listened to. Deferred, it is asked for again until its deadline, in the air under a hold. Else `on inadmissible`
counts: `skip` goes on with the next step, `hold` waits like a deferral, `abort` flies the step's fallback and, when
that is used up, the contingency. On the ground nothing is sent, and the run ends.
"""

from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.policy import WithoutEvidence
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import End, Ending
from rtshcua.onboard.runtime.admission import Admission
from rtshcua.onboard.runtime.craft import Craft
from rtshcua.onboard.runtime.dispatcher import Dispatcher
from rtshcua.onboard.runtime.fallback import Fallback, Progress
from rtshcua.onboard.runtime.flight import Limits, Stage
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.onboard.runtime.monitor import StateMonitor
from rtshcua.onboard.runtime.patience import Patience
from rtshcua.onboard.runtime.queue import InvocationQueue
from rtshcua.onboard.runtime.remaining import RemainingLatency
from rtshcua.onboard.runtime.supervisor import Supervisor
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.response import Answer

#: what ends a run matters more the further down it stands
_GRAVITY = (Ending.ABORTED, Ending.RECALLED, Ending.INTERRUPTED, Ending.EVIDENCE_LOST)


class Conduct:
    """The state of a run, and its turns. `ending` is None until it ended."""

    def __init__(self, loaded: Loaded, journal: Journal, limits: Limits, *, resumed: bool) -> None:
        self.loaded = loaded
        self.stage = Stage.WAITING
        self.ending: Ending | None = None
        self.craft = Craft()
        self.queue = InvocationQueue(loaded.bundle.mission)
        self.monitor = StateMonitor(loaded.policy)
        remaining = RemainingLatency()
        self.admission = Admission(loaded, journal, self.queue, remaining)
        self.dispatcher = Dispatcher(loaded.executor, journal, remaining)
        self.fresh = True  # something was received, or began, since the current step was last asked for
        self.recording = True  # records are kept, or the policy does not ask
        self._journal = journal
        self._limits = limits
        self._resumed = resumed
        self._fallback = Fallback(loaded, self.admission, self.dispatcher, limits)
        self._supervisor: Supervisor | None = None
        self._patience = Patience(loaded)
        self._cause: Ending | None = None
        self._began_us: int | None = None
        self._asked_us = 0
        self._held = False  # a hold for the current step was tried

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
        return self._resumed and self.craft.airborne is not False

    def turn(self, now: Now) -> bool:
        """Do one thing that can be done now; False when there is none left."""
        self._began_us = now.monotonic_us if self._began_us is None else self._began_us
        lost_since_us = self.craft.lost_since_us
        if lost_since_us is not None and self.stage is not Stage.ENDED:
            if now.monotonic_us - lost_since_us > self._limits.silent_us:
                self.stand_down(now, Ending.LINK_LOST)
            return False  # nothing that is sent would arrive
        match self.stage:
            case Stage.WAITING:
                return self._wait(now, self._began_us)
            case Stage.DECIDING:
                return self._decide(now)
            case Stage.RUNNING:
                return self._supervise(now)
            case Stage.FALLING:
                return self._fall(now)
            case Stage.ENDED:
                return False

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

    def unrecorded(self, now: Now) -> None:
        """Records are not kept: as the policy says, the mission is given up, or no further step begins."""
        if self.loaded.bundle.policy.without_evidence == WithoutEvidence.REFUSE:
            self.recording = False
        else:
            self.break_off(now, Ending.EVIDENCE_LOST)

    def recall(self, now: Now) -> None:
        """An operator calls the vehicle back: in the air the contingency flies, on the ground the run ends.

        What already brings the vehicle home or down goes on.
        """
        self._blame(Ending.RECALLED)
        homeward = self.stage is Stage.RUNNING and self.dispatcher.homeward
        if not self.aloft:
            self.end(now, Ending.RECALLED)
        elif self.stage is not Stage.FALLING and not homeward:
            self.fall_back(CONTINGENCY_LINK, Ending.RECALLED)

    def replaced(self, first: int) -> None:
        """A replacement is in force: the steps from `first` on, none of which was released, are others now."""
        self.queue.replace(self.loaded.bundle.mission)
        self.admission.replaced(first)

    def fall_back(self, kind: int, cause: Ending = Ending.ABORTED) -> None:
        """Fly the current step's chain, or the contingency, down to the ground.

        A vehicle that has not left the ground is told to land and nothing else: a return or a hold makes no sense
        there, and a take-off that is under way, not yet seen to have armed it, must not go on by itself.
        """
        self._blame(cause)
        current = self.queue.current
        if self.craft.airborne is False:
            self._fallback.land()
        else:
            self._fallback.begin(kind, current.step if current is not None and kind == FALLBACK_LINK else -1)
        self.stage = Stage.FALLING

    def leave(self) -> None:
        """Nobody will watch any more: unless it is on its way home or down already, the last link flies."""
        if self.stage is not Stage.ENDED and self.aloft and not self.dispatcher.homeward:
            self._blame(Ending.INTERRUPTED)
            self._fallback.land()
            self.stage = Stage.FALLING

    def stand_down(self, now: Now, ending: Ending) -> None:
        """Send nothing more, whatever flies, and end."""
        self.dispatcher.release(now)
        self._journal.effect(now, "stood-down", detail=self.craft.last_seen)
        self.end(now, ending)

    def end(self, now: Now, ending: Ending) -> None:
        """End the run."""
        self.admission.flush(now)
        self.stage = Stage.ENDED
        self.ending = ending
        self.loaded.executor.release()
        self._journal.add(End(ending))

    def down(self, now: Now) -> None:
        """The vehicle is on the ground again: the flight is over, and with it a fallback."""
        self.dispatcher.landed()
        self.craft.armed = self.craft.airborne = False
        if self.stage is Stage.FALLING:
            self.end(now, self._cause or Ending.ABORTED)

    def advance(self, now: Now) -> None:
        """The current step is done, or skipped."""
        self.queue.advance(now.monotonic_us)
        self._supervisor = None
        self._patience.renew()
        self._held = False
        # Where no step begins without records, the disk first gets a moment to say what became of those so far.
        self.fresh = self.loaded.bundle.policy.without_evidence != WithoutEvidence.REFUSE
        self._asked_us = now.monotonic_us
        self.stage = Stage.DECIDING

    def _blame(self, cause: Ending) -> None:
        if self._cause is None or _GRAVITY.index(cause) > _GRAVITY.index(self._cause):
            self._cause = cause

    def come_down(self, now: Now, kind: int = CONTINGENCY_LINK, cause: Ending = Ending.ABORTED) -> bool:
        """The mission is over: in the air a chain flies, on the ground the run ends."""
        if cause is not Ending.ABORTED:
            self._blame(cause)
        if not self.aloft:
            return self._give_up(now)
        self.fall_back(kind)
        return True

    def _give_up(self, now: Now) -> bool:
        """End on the ground; refused if nothing ever flew."""
        self.end(now, self._cause or (Ending.ABORTED if self.craft.flown else Ending.REFUSED))
        return False

    # -------------------------------------------------------- turns

    def _wait(self, now: Now, began_us: int) -> bool:
        craft = self.craft
        if not craft.ready or craft.airborne is None:
            if now.monotonic_us - began_us > self._limits.ready_us:
                self._journal.effect(now, "never-ready")
                return self.come_down(now)
            return False
        self._journal.effect(now, "ready")
        if self._resumed and craft.airborne:
            self._journal.effect(now, "resumed")
            self.fall_back(CONTINGENCY_LINK)
            return True
        if self._resumed or craft.airborne:
            # A flight that this run did not begin is someone else's, and a bundle flies once.
            self._journal.effect(now, "resumed" if self._resumed else "already-airborne")
            return self._give_up(now)
        self.queue.release(now.monotonic_us)
        self.stage = Stage.DECIDING
        return True

    def _decide(self, now: Now) -> bool:
        if self._cause is not None:  # given up while a step of the mission brought the vehicle down
            self.break_off(now, self._cause)
            return True
        invocation = self.queue.current
        if invocation is None:
            return self._finish(now)
        if not self.fresh and now.monotonic_us - self._asked_us < self._limits.again_us:
            return False
        self.fresh, self._asked_us = False, now.monotonic_us
        state = self.monitor.state(now.monotonic_us)
        if not self.recording:
            if now.monotonic_us < (self.queue.released_us or 0) + invocation.contract.deadline_us:
                return self._bide(now, invocation, state)
            return self.come_down(now, cause=Ending.EVIDENCE_LOST)
        answer = self.admission.ask(now, state, (STEP, invocation.step, -1))
        if answer is None or (answer.outcome is Outcome.DENY and not answer.permit):
            return self.come_down(now)
        if answer.permit:
            return self._start(now, invocation, answer)
        if self._patience.may_wait(invocation, answer, self.queue.released_us or 0, now.monotonic_us):
            return self._bide(now, invocation, state)
        return self._inadmissible(now, invocation)

    def _bide(self, now: Now, invocation: Invocation, state: State) -> bool:
        """The step is not begun yet: in the air it is waited for under a hold, as long as what must hold does."""
        unkept = self._patience.unkept(invocation, state, now) if self.aloft else None
        if unkept is not None:
            self.dispatcher.end(now, "violated", unkept)
            self.fall_back(FALLBACK_LINK)
            return True
        if not self._held and self.aloft and self.dispatcher.active is None:
            self._held = True  # once, for a hold goes on
            self._fallback.hold(now, state)
        return False

    def _finish(self, now: Now) -> bool:
        if not self.aloft:
            self.end(now, Ending.COMPLETED)
            return False
        self._journal.effect(now, "not-landed")
        self.fall_back(CONTINGENCY_LINK)
        return True

    def _start(self, now: Now, invocation: Invocation, answer: Answer) -> bool:
        if not self.dispatcher.fly(now, answer.permit, (STEP, invocation.step, -1), None):
            return self._inadmissible(now, invocation)
        loaded = self.loaded
        self._supervisor = Supervisor(loaded.invocations[invocation.step], loaded.policy, now.monotonic_us)
        self.stage = Stage.RUNNING
        return False

    def _inadmissible(self, now: Now, invocation: Invocation) -> bool:
        if invocation.on_inadmissible == OnInadmissible.SKIP:
            self._journal.effect(now, "skipped", kind=STEP, step=invocation.step)
            self.advance(now)
            return True
        return self.come_down(now, FALLBACK_LINK)

    def _supervise(self, now: Now) -> bool:
        watch = self._supervisor
        violated = None if watch is None else watch.violated(self.monitor.state(now.monotonic_us), now)
        if violated is None:
            return False
        self.dispatcher.end(now, "violated", violated)
        self.fall_back(FALLBACK_LINK)
        return True

    def _fall(self, now: Now) -> bool:
        if self.dispatcher.active is None and self.craft.at_rest:
            self.down(now)
            return False
        if self._fallback.turn(now, self.monitor.state(now.monotonic_us)) is Progress.STRANDED:
            self._journal.effect(now, "stranded")
            self.stand_down(now, self._cause or Ending.ABORTED)
        return False
