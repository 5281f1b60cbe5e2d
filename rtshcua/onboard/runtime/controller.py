"""The mission controller: the stages of a run and their transitions (design section 4.4).

A step that is denied in the air is followed by the contingency, whatever the step's own options say. A deferred
step is requested again until its deadline, in the air while the vehicle holds. Otherwise `on inadmissible`
applies: `skip` continues with the next step, `hold` waits as for a deferral, `replan` also waits and requests a
replacement of the step, and `abort` flies the step's fallback and, when that is used up, the contingency. On the
ground nothing is sent, and the run ends.

In a live mission (`idle_us`) a replacement that begins directly after the running step is requested at once. If it is
admitted, its first step supersedes the running one; if it is refused, the step is declined, and what flew goes on.
After the last step the vehicle holds and waits for the next replacement, for `idle_us` at most; then the contingency
flies.

While the link is down, or after this computer stood still, no turn is taken until fresh state has arrived or the
time for that is over (`link`).
"""

from collections.abc import Mapping
from typing import Final

from rtshcua.decision.fallbacks import look_ahead
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.policy import AfterSilence, WithoutEvidence
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement import frames
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import WITHHELD, AirState, CommandFailed, End, Ending, Expect, LinkLost
from rtshcua.onboard.runtime.admission import Admission, InvocationQueue
from rtshcua.onboard.runtime.dispatcher import SUPERSEDED, Dispatcher, RemainingLatency
from rtshcua.onboard.runtime.fallback_flight import Fallback
from rtshcua.onboard.runtime.journal import Detail, Journal
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.link import STOOD_STILL, EndedSilence, LinkState, LinkSupervision
from rtshcua.onboard.runtime.monitor import StateMonitor, VehicleStatus
from rtshcua.onboard.runtime.supervisor import IdleTime, RetryPolicy, Supervisor
from rtshcua.onboard.runtime.view import RunStage, RuntimeView
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Ref

#: the effect that records it in the log
MAY_FLY: Final = "may-fly"

#: why this run stops watching
_WHY: Mapping[Ending, str] = {
    Ending.STOOD_DOWN: "somebody else flies the vehicle, so this run sends nothing more and stops watching",
    Ending.LINK_LOST: "the vehicle is not heard or does not answer, so it can be neither watched nor commanded",
}
#: after any abort: no command is left that could be sent
_TRIED: Final = (
    "the last link of the contingency was sent as often as allowed, and no landing was "
    "observed; this run may send nothing else, so it ends and stops watching"
)
OWN_FAILSAFE: Final = (
    "the autopilot's own failsafe flies the vehicle, so this run sends nothing more and stops watching"
)
#: nothing else shows who it was
PAUSED: Final = (
    "the vehicle stands far from its target as if somebody had paused it, who may resume the "
    "flight at any time, so this run sends nothing more and stops watching; if nobody did, "
    "nobody flies it: take it over"
)
RESTS: Final = "the vehicle reports that it rests on the ground, but it obeyed a command and no landing was observed"


def may_fly(
    ending: Ending, last_seen: str, *, failsafe: bool = False, paused: bool = False, rests: bool = False
) -> str:
    """The warning that the vehicle may be flying, its last known state, and why nothing watches it. `failsafe`: its
    own failsafe flies it. `paused`: the only sign of another pilot is that it stands still. `rests`: it reports
    that it is on the ground, disarmed.
    """
    if rests:
        return f"{RESTS}: approach it as if it may start"
    why = _WHY.get(ending, _TRIED)
    if ending is Ending.STOOD_DOWN and (failsafe or paused):
        why = OWN_FAILSAFE if failsafe else PAUSED
    return f"{last_seen}; the vehicle may be flying: {why}"


#: the effect that records the request to replace a step that is not admitted
REPLAN: Final = "replan"
#: the effect that records that a step of a live mission was refused, and that what flew before goes on
DECLINED: Final = "declined"
#: the effects that record the begin and the end of the wait for the next step of a live mission
IDLE: Final = "idle"
IDLE_OVER: Final = "idle-over"
#: why a command was `late`
LATE: Final = (
    "nothing was sent: this computer was too busy, or its disk too slow, to send the command within its permit's time"
)
#: `late`: the permit's time was over when the command was to be sent, or when its first frame was
_LATE: Final = ("late", frames.LATE.slug)
#: reasons for the end of a run, the most important last
_GRAVITY = (Ending.ABORTED, Ending.CANCELLED, Ending.RECALLED, Ending.INTERRUPTED, Ending.EVIDENCE_LOST)


class MissionController:
    """Owns the stage of a run, and the parts that own the rest (the table in docs/runtime.md).

    `stage` and `ending` are for reading; `ending` is None until the run ends.
    """

    def __init__(
        self, loaded: Loaded, journal: Journal, limits: Limits, *, resumed: bool, idle_us: int | None = None
    ) -> None:
        self._loaded = loaded
        self._policy = loaded.bundle.policy
        self._journal = journal
        self._limits = limits
        self._resumed = resumed
        self._unfit = ""  # why the vehicle cannot become ready
        self.stage = RunStage.WAITING
        self.ending: Ending | None = None
        #: the warning that the vehicle may be flying after the end of the run; empty if it does not
        self.may_fly = ""
        self._cause: Ending | None = None  # why the mission was aborted; None: it was not
        self._began_us: int | None = None
        self._recording = True  # records are stored, or the policy does not require it
        self._alone = False  # the boundary is lost
        self._overdue = False  # the current step was admitted, but its permit came too late
        self._stopping = False  # somebody asked this program to stop
        self.vehicle = VehicleStatus()
        self.monitor = StateMonitor(loaded.policy)
        self.link = LinkSupervision(self._policy, self.monitor, limits)
        self.queue = InvocationQueue(loaded.bundle.mission)
        remaining = RemainingLatency()
        self.admission = Admission(loaded, journal, self.queue, remaining)
        self.dispatcher = Dispatcher(loaded.executor, journal, remaining)
        self.retry = RetryPolicy(limits)
        self._idle = IdleTime(idle_us)
        self._live = -1  # the step that was handed in live, and whose refusal leaves what flies as it is
        self._flown = -1  # the last step that was sent
        self._supervisor: Supervisor | None = None  # of the running step
        self._fallback = Fallback(loaded, self.admission, self.dispatcher, limits)

    @property
    def aloft(self) -> bool:
        """Whether a motion command may be needed: a command is under way, or a flight of this bundle is not at rest.

        A flight that somebody else began is not ours in any case. After a restart the vehicle counts as in the air
        until it reports that it rests: an armed vehicle may be about to take off by an earlier command.
        """
        if self.dispatcher.active is not None:
            return True
        if self.dispatcher.dispatched:
            return not self.vehicle.at_rest
        return self._resumed and not self.vehicle.at_rest

    # -------------------------------------------------------- turns: the next action, by stage

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self.stage is RunStage.ENDED

    def turn(self, now: Now) -> bool:
        """Take one action that is possible now; False if there is none."""
        if self._began_us is None:
            self._began_us = now.monotonic_us
        self.look_at_boundary(now)
        if self.ended or (self.link.state is not LinkState.UP and not self._judges(now)):
            return False
        if self.link.mute and self._is_gone(now.monotonic_us):
            self._journal.effect(now, "link-lost", detail="the vehicle is heard, but answers nothing")
            self.stand_down(now, Ending.LINK_LOST)
            return False
        stage = self.stage
        if stage is RunStage.RUNNING:
            return self._supervise(now)
        if stage is RunStage.FALLING:
            return self._fall(now)
        if stage is RunStage.DECIDING:
            return self._decide(now)
        return stage is RunStage.WAITING and self._wait(now, self._began_us)  # the judgement may have ended the run

    def _judges(self, now: Now) -> bool:
        """Whether the vehicle is heard again, and its state may be judged."""
        link = self.link
        if link.down:
            if self._is_gone(now.monotonic_us):
                self.stand_down(now, Ending.LINK_LOST)
            return False  # nothing that is sent would arrive
        if link.awaits(now.monotonic_us):
            return False
        stood_us, silence = link.judged(now.monotonic_us)
        if stood_us:
            self.retry.grace.stood(stood_us)
            self._idle.stood(stood_us)
            if self._supervisor is not None:
                self._supervisor.grace.stood(stood_us)
        if silence is not None:
            self._heard_again(now, silence)
        return True

    def _is_gone(self, now_us: int) -> bool:
        """Whether the wait for a silent or unresponsive vehicle is over. In the air it lasts as long as the vehicle
        can fly, unless somebody waits for this program to stop.
        """
        limit_us = self._limits.silent_us
        if self.aloft and not self._stopping:
            limit_us += self._policy.vehicle.endurance_us
        return self.link.waited_us(now_us) > limit_us

    def _heard_again(self, now: Now, silence: EndedSilence) -> None:
        """Judge the state again after a silence. One that was too long ends the mission, if the policy says so."""
        policy, waited = self._policy, f"after {silence.awaited_us // 1_000} ms"
        if silence.missing:
            self._journal.effect(now, "not-fresh", detail=f"{waited} without {', '.join(silence.missing)}")
        else:
            self._journal.effect(now, "fresh", detail=waited)
        if policy.after_silence != AfterSilence.CONTINGENCY or silence.lasted_us <= policy.silence_us:
            return
        ends = self.dispatcher.homeward and self.queue.at_last  # then nothing is left to abort
        if self.aloft and self.stage in (RunStage.DECIDING, RunStage.RUNNING) and not ends:
            text = f"{silence.lasted_us // 1_000} ms, more than {policy.silence_us // 1_000} ms"
            self._journal.effect(now, "long-silence", detail=text)
            self.break_off(now, Ending.ABORTED, CONTINGENCY_LINK)

    def _wait(self, now: Now, began_us: int) -> bool:
        vehicle = self.vehicle
        if not vehicle.ready or vehicle.airborne is None:
            if self.link.mute and self.aloft:  # nothing that is sent would arrive: that time does not count
                self._began_us = now.monotonic_us
            elif now.monotonic_us - began_us > self._limits.ready_us:
                self._journal.effect(now, "never-ready")
                return self._come_down(now)
            elif self._unfit and not self.aloft:  # no waiting changes that
                self._journal.effect(now, "never-ready", detail=self._unfit)
                return self._come_down(now)
            return False
        self._journal.effect(now, "ready")
        if self._resumed and vehicle.others:  # somebody took over while this program was not running
            self._journal.effect(now, "taken-over", detail=vehicle.others)
            self.stand_down(now, Ending.STOOD_DOWN)
            return False
        if self._resumed or vehicle.airborne:
            # A vehicle that an earlier run of this bundle left in the air, or armed and commanded to take off, is
            # brought down, because a bundle flies once. Any other flight that this run did not begin is someone
            # else's.
            self._journal.effect(now, "resumed" if self._resumed else "already-airborne")
            return self._come_down(now)
        self.queue.release(now.monotonic_us)
        self.stage = RunStage.DECIDING
        return True

    def _decide(self, now: Now) -> bool:
        if self._cause is not None:  # aborted while a step of the mission brought the vehicle down
            self.break_off(now, self._cause)
            return True
        invocation = self.queue.current
        if invocation is None:
            return self._finish(now)
        if not self.retry.is_due(now.monotonic_us):
            return False
        state = self.monitor.state(now.monotonic_us)
        released_us = self.queue.released_us or 0
        if not self._recording:
            if now.monotonic_us < released_us + invocation.contract.deadline_us:
                return self._bide(now, invocation, state)
            return self._come_down(now, cause=Ending.EVIDENCE_LOST)
        if self._overdue:
            self._overdue = False
            if not self.dispatcher.withdraw(now):
                return self._inadmissible(now, invocation)
        answer = self.admission.ask(now, state, Ref(STEP, invocation.step, -1))
        if answer is not None and answer.permit:
            return self._start(now, invocation, answer)
        return self._refused(now, invocation, answer, state)

    def _refused(self, now: Now, invocation: Invocation, answer: Decision | None, state: State) -> bool:
        """The current step was not admitted: wait for it, or go on without it."""
        if self._is_live(invocation):
            waits = answer is not None and answer.outcome is Outcome.DEFER
            return self._bide(now, invocation, state) if waits else self._decline(now, invocation)
        if answer is None or answer.outcome is Outcome.DENY:
            return self._come_down(now)
        released_us = self.queue.released_us or 0
        if self.retry.may_wait(invocation, answer, released_us, now.monotonic_us):
            if self.retry.may_call(invocation, answer):
                left_us = released_us + invocation.contract.deadline_us - now.monotonic_us
                self._journal.effect(
                    now, REPLAN, Ref(STEP, invocation.step, -1), detail=f"within {left_us // 1_000} ms"
                )
            return self._bide(now, invocation, state)
        return self._inadmissible(now, invocation)

    def _finish(self, now: Now) -> bool:
        if not self.aloft:
            self._end(now, Ending.COMPLETED)
            return False
        if self._idle.is_live and self._flown >= 0 and not self._alone:
            return self._wait_for_step(now)
        self._journal.effect(now, "not-landed")
        self.fall_back(CONTINGENCY_LINK)
        return True

    def _wait_for_step(self, now: Now) -> bool:
        """A live mission has no step left: the vehicle holds as it would for a step, under the conditions of the last
        one, until a replacement brings the next.
        """
        idle, flown = self._idle, self.queue.step(self._flown)
        if idle.begins(now.monotonic_us):
            self._journal.effect(now, IDLE, detail=f"for at most {(idle.idle_us or 0) // 1_000} ms")
        if idle.over(now.monotonic_us):
            self._journal.effect(now, IDLE_OVER)
            return self._come_down(now)
        if not self.retry.is_due(now.monotonic_us):
            return False
        return self._bide(now, flown, self.monitor.state(now.monotonic_us))

    def _is_live(self, invocation: Invocation) -> bool:
        return invocation.step == self._live and self.aloft

    def _decline(self, now: Now, invocation: Invocation) -> bool:
        """A step that was handed in live is refused: it is requested no more, and what flew before goes on."""
        self.admission.flush(now)
        self._journal.effect(now, DECLINED, Ref(STEP, invocation.step, -1))
        self.queue.decline(invocation.step)
        return True

    def _request_ahead(self, now: Now) -> bool:
        """Request the step that would supersede the running one. Before a take-off is seen in the air, and while no
        records are kept, it waits.
        """
        ahead, at_us = self.queue.ahead, now.monotonic_us
        if ahead is None or self._cause is not None or not self._recording or self.vehicle.airborne is not True:
            return False
        if not self.retry.is_due(at_us):
            return False
        self.queue.release_ahead(at_us)
        answer = self.admission.ask(now, self.monitor.state(at_us), Ref(STEP, ahead.step, -1))
        if answer is None or not answer.permit:
            return (answer is None or answer.outcome is not Outcome.DEFER) and self._decline(now, ahead)
        self.dispatcher.end(now, SUPERSEDED)
        self._advance(now)
        return self._start(now, ahead, answer)

    def _bide(self, now: Now, invocation: Invocation, state: State) -> bool:
        """The step has not begun: in the air the vehicle holds meanwhile, as long as its conditions hold."""
        if not self.aloft:
            return False
        unkept = self.retry.unkept(self._loaded.invocations[invocation.step], state, self._loaded.policy, now)
        if unkept is not None:
            return self._violated(now, unkept)
        if self.dispatcher.active is None and self.retry.may_hold() and not self._fallback.hold(now, state):
            self.retry.hold_again()
        return False

    def _start(self, now: Now, invocation: Invocation, answer: Decision) -> bool:
        if not self.dispatcher.fly(now, answer.permit, Ref(STEP, invocation.step, -1), None):
            self._overdue = self.dispatcher.overdue
            return not self._overdue and self._inadmissible(now, invocation)
        self._flown = invocation.step
        prepared = self._loaded.invocations[invocation.step]
        self._supervisor = Supervisor(
            prepared, self._loaded.policy, now.monotonic_us, self.link.away_us(now.monotonic_us)
        )
        self.stage = RunStage.RUNNING
        return False

    def _inadmissible(self, now: Now, invocation: Invocation) -> bool:
        if self._is_live(invocation):
            return self._decline(now, invocation)
        if invocation.on_inadmissible == OnInadmissible.SKIP:
            self._journal.effect(now, "skipped", Ref(STEP, invocation.step, -1))
            self._advance(now)
            return True
        return self._come_down(now, FALLBACK_LINK)

    def _supervise(self, now: Now) -> bool:
        supervisor, at_us = self._supervisor, now.monotonic_us
        violated = None
        if supervisor is not None:
            away_us = self.link.away_us(at_us)
            violated = supervisor.violated(self.monitor.state(at_us), now, away_us, self.dispatcher.hindrance)
        return self._request_ahead(now) if violated is None else self._violated(now, violated)

    def _violated(self, now: Now, what: Detail) -> bool:
        """A condition of the current step does not hold; in a live mission without one, of the last step."""
        current = self.queue.current
        if self.dispatcher.active is not None:
            self.dispatcher.end(now, "violated", what)
        else:  # it waits for its step, so this ends no flight
            step = self._flown if current is None else current.step
            self._journal.effect(now, "violated", Ref(STEP, step, -1), detail=what)
        self.fall_back(FALLBACK_LINK)
        return True

    def _fall(self, now: Now) -> bool:
        if self.dispatcher.active is None and self.vehicle.at_rest:
            self._rests(now)
        elif not self._fallback.turn(now, self.monitor.state(now.monotonic_us)):
            if self.link.mute:  # no command has arrived: it is repeated until the wait is over
                self._fallback.land()
                return False
            self._journal.effect(now, "stranded")
            self.stand_down(now, self._cause or Ending.ABORTED)
        return False

    def prepare(self, now: Now) -> None:
        """Evaluate in advance the running step's fallback at the vehicle's present place, if it moved."""
        current = self.queue.current
        if self.stage is RunStage.RUNNING and current is not None and self.monitor.moved():
            prepared = self._loaded.invocations[current.step]
            look_ahead(prepared, self.monitor.state(now.monotonic_us), self._loaded.policy, now)

    # -------------------------------------------------------- reports of the vehicle

    def air_reported(self, now: Now, event: AirState) -> None:
        """The vehicle reports whether it is armed and in the air."""
        self.link.air_reported()
        ours = self.dispatcher.dispatched
        came_down = self.vehicle.report(armed=event.armed, airborne=event.airborne, ours=ours)
        if self.stage is RunStage.DECIDING:
            if ours and self.vehicle.at_rest:
                self._rests(now)
            elif not ours and event.airborne:  # a flight that this run did not begin is the pilot's
                self._journal.effect(now, "taken-over", detail="took off")
                self.stand_down(now, Ending.STOOD_DOWN)
        elif came_down and (
            self.stage is RunStage.FALLING or (self.stage is RunStage.RUNNING and not self.dispatcher.homeward)
        ):
            self.down(now)

    def unfit(self, why: str) -> None:
        """The vehicle cannot become ready for this mission."""
        self._unfit = why

    def succeeded(self, now: Now, token: int) -> None:
        """The effect of a command was observed."""
        active = self.dispatcher.flying(token)
        if active is None:
            return
        self.dispatcher.end(now, "succeeded")
        if self.stage is RunStage.RUNNING:
            if active.homeward:
                self._landed()
                if self.queue.ahead is not None:  # on the ground nothing supersedes: the mission is over
                    self._decline(now, self.queue.ahead)
            self._advance(now)
        elif active.homeward:
            self.down(now)

    def failed(self, now: Now, event: CommandFailed) -> None:
        """A command was refused, its effect was not observed, or it was not sent."""
        if self.dispatcher.flying(event.token) is None:
            return
        self.dispatcher.end(now, "failed", self._why_failed(event))
        if self.stage is RunStage.RUNNING and event.reason in _LATE and self.dispatcher.withdraw(now):
            self._supervisor = None
            self.retry.renew(now.monotonic_us, at_once=True)
            self.stage = RunStage.DECIDING
        elif event.reason in _LATE and self.stage is RunStage.FALLING:
            self._fallback.late()
        elif self.stage is RunStage.DECIDING and self.aloft:
            # It was a hold: the vehicle does not wait where it should, whatever it does.
            if event.reason not in _LATE or not self.retry.hold_again():
                self.fall_back(FALLBACK_LINK, holds=False)
        elif self.stage is not RunStage.RUNNING:
            return
        elif event.reason == WITHHELD and not self._recording:
            self._come_down(now, cause=Ending.EVIDENCE_LOST)
        elif self.aloft:
            self.fall_back(FALLBACK_LINK)
        else:
            self._end(now, self._ending_on_ground)

    def _rests(self, now: Now) -> None:
        """The vehicle reports that it rests on the ground. If it was never observed in the air, that is not a
        landing: a command that it obeyed may still lift it off.
        """
        if self.vehicle.flown:
            self.down(now)
        else:
            self.dispatcher.end(now, "released")
            self._end(now, self._cause or Ending.ABORTED)

    def _why_failed(self, event: CommandFailed) -> str:
        """The reason of the failure, for the log."""
        text = LATE if event.reason in _LATE and not event.text else event.text
        why = f"{event.reason}: {text}" if text else event.reason
        return f"{why}; the link is silent: the state of the vehicle is unknown" if self.link.down else why

    def down(self, now: Now) -> None:
        """The vehicle is on the ground again, by command or not: flight and run are over. Nothing is sent to a
        vehicle on the ground.
        """
        self.dispatcher.end(now, "landed")
        self._landed()
        self._end(now, self._cause or Ending.ABORTED)

    def _landed(self) -> None:
        self.dispatcher.landed()
        self.vehicle.landed()

    def link_lost(self, now: Now, event: LinkLost) -> None:
        """The vehicle is not heard any more."""
        takes_off = self.dispatcher.active is not None and self.vehicle.airborne is not True
        if self.link.lost(now.monotonic_us, event.heard_us or now.monotonic_us, takes_off=takes_off):
            self._journal.effect(now, "link-lost", detail=event.why)
            self.retry.news()

    def stalled(self, now: Now, before_us: int) -> None:
        """This computer stood still since `before_us`: the known state of the vehicle is from before that."""
        takes_off = self.dispatcher.active is not None and self.vehicle.airborne is not True
        self.link.stalled(before_us, now.monotonic_us, takes_off=takes_off)
        self._journal.effect(now, STOOD_STILL, detail=f"for {(now.monotonic_us - before_us) // 1_000} ms")
        self.retry.news()

    def link_back(self, now: Now) -> None:
        """The vehicle is heard again."""
        down_us = self.link.back(now.monotonic_us)
        if down_us is not None:
            self._journal.effect(now, "link-back", detail=f"after {down_us // 1_000} ms")
        self.retry.news()

    # -------------------------------------------------------- aborts and the end of a run

    def break_off(self, now: Now, cause: Ending, kind: int = FALLBACK_LINK) -> None:
        """Abort the mission: on the ground the run ends, in the air a running step falls back by its own chain, or by
        the contingency if `kind` says so, and between steps the contingency flies.

        A return or a descent under way continues.
        """
        self._blame(cause)
        if not self.aloft:
            self._end(now, cause)
        elif self.stage is not RunStage.FALLING and not self.dispatcher.homeward:
            self.fall_back(kind if self.stage is RunStage.RUNNING else CONTINGENCY_LINK, cause)

    def look_at_boundary(self, now: Now) -> None:
        """If the boundary is lost no further decision is possible: abort the mission."""
        if self._alone or self.stage is RunStage.ENDED or not self._journal.look_at_boundary(now):
            return
        self._alone = True
        if self.aloft:
            self.break_off(now, Ending.ABORTED)
        else:
            self._come_down(now)

    def stop(self, now: Now) -> None:
        """Somebody asked this program to stop, and waits for it."""
        if not self._stopping:
            self._stopping = True
            self.link.hurry(now.monotonic_us)
        self.break_off(now, Ending.INTERRUPTED)

    def recall(self, now: Now) -> None:
        """An operator calls the vehicle back."""
        self.break_off(now, Ending.RECALLED, CONTINGENCY_LINK)

    def cancel(self, now: Now) -> None:
        """The proposer cancels the mission: the policy's contingency flies, as after a recall."""
        self.break_off(now, Ending.CANCELLED, CONTINGENCY_LINK)

    def evidence_failed(self, now: Now) -> None:
        """Records cannot be stored: depending on the policy, abort the mission or begin no further step."""
        if self._policy.without_evidence == WithoutEvidence.REFUSE:
            self._recording = False
        else:
            self.break_off(now, Ending.EVIDENCE_LOST)

    def evidence_kept(self) -> None:
        """Records are stored again."""
        self._recording = True
        self.retry.news()

    @property
    def released(self) -> int:
        """How many steps do not change any more: those that were released, except one that waits to be replaced."""
        current = self.queue.current
        waits = (
            current is not None and current.on_inadmissible == OnInadmissible.REPLAN and self.stage is RunStage.DECIDING
        )
        return self.queue.released - (waits and self.queue.released > 0)

    def replaced(self, now: Now, first: int) -> None:
        """A replacement is in force: the steps from `first` on are new."""
        mission, current, at_us = self._loaded.bundle.mission, self.queue.current, now.monotonic_us
        live = self._idle.is_live and self.aloft and self.queue.follows(first)
        self.queue.replace(mission, first, at_us)
        if first <= self._live:
            self._live = -1
        if live and self.stage is RunStage.RUNNING:
            self._live = first
            self.queue.put_ahead(first)
            self.retry.renew(at_us, at_once=True)
        elif live and self.stage is RunStage.DECIDING:
            self._live = first
            if current is not None and current.step < first:
                self._journal.effect(now, SUPERSEDED, Ref(STEP, current.step, -1))
            self.queue.skip_to(first, at_us)
            self._idle.stop()
            self.retry.renew(at_us, at_once=True)
        elif current is not None and first <= current.step and self.stage is RunStage.DECIDING:
            self.retry.renew(at_us, at_once=True)
        self._journal.add(Expect(mission.invocations))

    def fall_back(self, kind: int, cause: Ending = Ending.ABORTED, *, holds: bool = True) -> None:
        """Fly the current step's chain, or the contingency, down to the ground. Without `holds`, links that hold are
        skipped, because a hold has just failed.

        A vehicle that has not left the ground is only told to land: a return or a hold makes no sense there, and a
        take-off that is under way, not yet observed as armed, must not continue by itself.
        """
        self._blame(cause)
        current = self.queue.current
        if self.vehicle.airborne is False:
            self._fallback.land()
        else:
            step = self._flown if current is None else current.step
            if kind != FALLBACK_LINK or step < 0:
                kind, step = CONTINGENCY_LINK, -1
            self._fallback.begin(kind, step, holds=holds)
        self.stage = RunStage.FALLING

    def leave(self) -> None:
        """Nobody will watch any more: unless the vehicle is on its way home or down already, the last link flies."""
        if self.stage is not RunStage.ENDED and self.aloft and not self.dispatcher.homeward:
            self._blame(Ending.INTERRUPTED)
            self._fallback.land()
            self.stage = RunStage.FALLING

    def stand_down(self, now: Now, ending: Ending, *, failsafe: bool = False, paused: bool = False) -> None:
        """Send nothing more, and end. `failsafe`: the autopilot's own failsafe flies it. `paused`: it stands still."""
        flies = self.aloft or self.dispatcher.done
        self.dispatcher.release(now)
        if flies and ending is not Ending.CRASHED:
            self.may_fly = may_fly(ending, self.vehicle.last_seen, failsafe=failsafe, paused=paused)
        self._journal.effect(now, "stood-down", detail=self.may_fly or self.vehicle.last_seen)
        self._end(now, ending)

    def _come_down(self, now: Now, kind: int = CONTINGENCY_LINK, cause: Ending = Ending.ABORTED) -> bool:
        """The mission is over: in the air a chain flies, on the ground the run ends."""
        if cause is not Ending.ABORTED:
            self._blame(cause)
        if not self.aloft:
            self._end(now, self._cause or self._ending_on_ground)
            return False
        self.fall_back(kind)
        return True

    @property
    def _ending_on_ground(self) -> Ending:
        """The ending of a run that was aborted on the ground for no other cause; refused if nothing flew."""
        return Ending.ABORTED if self.vehicle.flown else Ending.REFUSED

    def _advance(self, now: Now) -> None:
        """The current step is done, or skipped."""
        self.queue.advance(now.monotonic_us)
        self._supervisor = None
        # If no step begins without records, the disk first gets a moment to report on those so far.
        at_once = self._policy.without_evidence != WithoutEvidence.REFUSE
        self.retry.renew(now.monotonic_us, at_once=at_once)
        self.stage = RunStage.DECIDING

    def _end(self, now: Now, ending: Ending) -> None:
        if not self.may_fly and ending is not Ending.CRASHED and (self.aloft or self.dispatcher.done):
            self.may_fly = may_fly(ending, self.vehicle.last_seen, rests=self.vehicle.at_rest)
            self._journal.effect(now, MAY_FLY, detail=self.may_fly)
        self.admission.flush(now)
        self._journal.tell_counted(now, ended=True)
        self.stage = RunStage.ENDED
        self.ending = ending
        self._loaded.executor.release()
        self._journal.add(End(ending))

    def _blame(self, cause: Ending) -> None:
        if self._cause is None or _GRAVITY.index(cause) > _GRAVITY.index(self._cause):
            self._cause = cause

    # -------------------------------------------------------- display

    def view(self, at_us: int) -> RuntimeView:
        """The state of the run for display at a monotonic time."""
        mission, vehicle = self._loaded.bundle.mission, self.vehicle
        active, current = self.dispatcher.active, self.queue.current
        contract = current.contract.name if current is not None else ""
        return RuntimeView(
            at_us,
            self.stage,
            mission.phases[self.queue.phase],
            current.step if current is not None else len(mission.invocations),
            len(mission.invocations),
            contract if active is None else active.command.skill,
            self._left_us(at_us),
            vehicle.armed,
            vehicle.airborne,
            not self.link.down,
            self.monitor.readings(at_us),
            tuple(self.admission.recent),
            self.ending,
        )

    def _left_us(self, at_us: int) -> int | None:
        active, current, released_us = self.dispatcher.active, self.queue.current, self.queue.released_us
        if self.stage is RunStage.DECIDING and current is not None and released_us is not None:
            return released_us + current.contract.deadline_us - at_us
        if active is None:
            return None
        if active.until_us is not None:
            return active.until_us - at_us
        supervisor = self._supervisor if self.stage is RunStage.RUNNING else None
        if supervisor is not None and current is not None and current.contract.duration_us:
            return current.contract.duration_us - supervisor.lasted_us(at_us, self.link.away_us(at_us))
        return None
