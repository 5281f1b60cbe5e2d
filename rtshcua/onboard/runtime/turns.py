"""The turns of a run: what is to be done now, by stage (design section 4.4).

What a step that is not admitted does: denied in the air, the contingency flies, and nothing that the step itself says
is listened to. Deferred, it is asked for again until its deadline, in the air under a hold. Else `on inadmissible`
counts: `skip` goes on with the next step, `hold` waits like a deferral, `abort` flies the step's fallback and, when
that is used up, the contingency. On the ground nothing is sent, and the run ends.

While the link is down, and until fresh state came or its time is over, there is no turn at all (`link`).
"""

from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.policy import AfterSilence
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.ports import Ending
from rtshcua.onboard.runtime.conduct import Conduct
from rtshcua.onboard.runtime.fallback import Progress
from rtshcua.onboard.runtime.flight import Stage
from rtshcua.onboard.runtime.link import Silence
from rtshcua.onboard.runtime.supervisor import Supervisor
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Ref
from rtshcua.wire.response import Answer


class Turns:
    """Takes the turns of a `Conduct`."""

    def __init__(self, conduct: Conduct) -> None:
        self._conduct = conduct
        self._began_us: int | None = None

    def turn(self, now: Now) -> bool:
        """Do one thing that can be done now; False when there is none left."""
        self._began_us = now.monotonic_us if self._began_us is None else self._began_us
        stage = self._conduct.stage
        if stage is Stage.ENDED or not self._judges(now):
            return False
        match self._conduct.stage:
            case Stage.WAITING:
                return self._wait(now, self._began_us)
            case Stage.DECIDING:
                return self._decide(now)
            case Stage.RUNNING:
                return self._supervise(now)
            case Stage.FALLING:
                return self._fall(now)
        return False

    # -------------------------------------------------------- silence

    def _judges(self, now: Now) -> bool:
        """Whether the vehicle is heard, and what is known of it may be judged."""
        conduct, link = self._conduct, self._conduct.link
        if link.down:
            if self._is_gone(now.monotonic_us):
                conduct.stand_down(now, Ending.LINK_LOST)
            return False  # nothing that is sent would arrive
        if link.awaits(now.monotonic_us):
            return False
        stood_us, silence = link.judged(now.monotonic_us)
        if stood_us:
            conduct.patience.stood(stood_us)
            if conduct.supervisor is not None:
                conduct.supervisor.stood(stood_us)
        if silence is not None:
            self._heard_again(now, silence)
        return True

    def _is_gone(self, now_us: int) -> bool:
        """Whether the silence was waited out: in the air the vehicle may come back as long as it can fly, unless
        somebody waits for this program to stop.
        """
        conduct = self._conduct
        limit_us = conduct.limits.silent_us
        if conduct.aloft and not conduct.stopping:
            limit_us += conduct.loaded.bundle.policy.vehicle.endurance_us
        return conduct.link.waited_us(now_us) > limit_us

    def _heard_again(self, now: Now, silence: Silence) -> None:
        """State is judged again after a silence. One that was too long ends the mission, if the policy says so."""
        conduct, policy = self._conduct, self._conduct.loaded.bundle.policy
        waited = f"after {silence.awaited_us // 1_000} ms"
        if silence.missing:
            conduct.journal.effect(now, "not-fresh", detail=f"{waited} without {', '.join(silence.missing)}")
        else:
            conduct.journal.effect(now, "fresh", detail=waited)
        if policy.after_silence != AfterSilence.CONTINGENCY or silence.lasted_us <= policy.silence_us:
            return
        ends = conduct.dispatcher.homeward and conduct.queue.at_last  # then nothing is left to be given up
        if conduct.aloft and conduct.stage in (Stage.DECIDING, Stage.RUNNING) and not ends:
            text = f"{silence.lasted_us // 1_000} ms, more than {policy.silence_us // 1_000} ms"
            conduct.journal.effect(now, "long-silence", detail=text)
            conduct.call_back(now, Ending.ABORTED)

    # -------------------------------------------------------- stages

    def _wait(self, now: Now, began_us: int) -> bool:
        conduct, craft = self._conduct, self._conduct.craft
        if not craft.ready or craft.airborne is None:
            if now.monotonic_us - began_us > conduct.limits.ready_us:
                conduct.journal.effect(now, "never-ready")
                return conduct.come_down(now)
            return False
        conduct.journal.effect(now, "ready")
        if conduct.resumed and craft.airborne and craft.others:  # while this program was gone somebody took it
            conduct.journal.effect(now, "taken-over", detail=craft.others)
            conduct.stand_down(now, Ending.STOOD_DOWN)
            return False
        if conduct.resumed and craft.airborne:
            conduct.journal.effect(now, "resumed")
            conduct.fall_back(CONTINGENCY_LINK)
            return True
        if conduct.resumed or craft.airborne:
            # A flight that this run did not begin is someone else's, and a bundle flies once.
            conduct.journal.effect(now, "resumed" if conduct.resumed else "already-airborne")
            return conduct.give_up(now)
        conduct.queue.release(now.monotonic_us)
        conduct.stage = Stage.DECIDING
        return True

    def _decide(self, now: Now) -> bool:
        conduct = self._conduct
        if conduct.cause is not None:  # given up while a step of the mission brought the vehicle down
            conduct.break_off(now, conduct.cause)
            return True
        invocation = conduct.queue.current
        if invocation is None:
            return self._finish(now)
        if not conduct.fresh and now.monotonic_us - conduct.asked_us < conduct.limits.again_us:
            return False
        conduct.fresh, conduct.asked_us = False, now.monotonic_us
        state = conduct.monitor.state(now.monotonic_us)
        released_us = conduct.queue.released_us or 0
        if not conduct.recording:
            if now.monotonic_us < released_us + invocation.contract.deadline_us:
                return self._bide(now, invocation, state)
            return conduct.come_down(now, cause=Ending.EVIDENCE_LOST)
        answer = conduct.admission.ask(now, state, Ref(STEP, invocation.step, -1))
        if answer is None or (answer.outcome is Outcome.DENY and not answer.permit):
            return conduct.come_down(now)
        if answer.permit:
            return self._start(now, invocation, answer)
        if conduct.patience.may_wait(invocation, answer, released_us, now.monotonic_us):
            return self._bide(now, invocation, state)
        return self._inadmissible(now, invocation)

    def _bide(self, now: Now, invocation: Invocation, state: State) -> bool:
        """The step is not begun yet: in the air it is waited for under a hold, as long as what must hold does."""
        conduct = self._conduct
        unkept = conduct.patience.unkept(invocation, state, now) if conduct.aloft else None
        if unkept is not None:
            conduct.dispatcher.end(now, "violated", unkept)
            conduct.fall_back(FALLBACK_LINK)
            return True
        if not conduct.held and conduct.aloft and conduct.dispatcher.active is None:
            conduct.held = True  # once, for a hold goes on
            conduct.fallback.hold(now, state)
        return False

    def _finish(self, now: Now) -> bool:
        conduct = self._conduct
        if not conduct.aloft:
            conduct.end(now, Ending.COMPLETED)
            return False
        conduct.journal.effect(now, "not-landed")
        conduct.fall_back(CONTINGENCY_LINK)
        return True

    def _start(self, now: Now, invocation: Invocation, answer: Answer) -> bool:
        conduct, loaded = self._conduct, self._conduct.loaded
        if not conduct.dispatcher.fly(now, answer.permit, Ref(STEP, invocation.step, -1), None):
            return self._inadmissible(now, invocation)
        conduct.supervisor = Supervisor(loaded.invocations[invocation.step], loaded.policy, now.monotonic_us)
        conduct.stage = Stage.RUNNING
        return False

    def _inadmissible(self, now: Now, invocation: Invocation) -> bool:
        conduct = self._conduct
        if invocation.on_inadmissible == OnInadmissible.SKIP:
            conduct.journal.effect(now, "skipped", Ref(STEP, invocation.step, -1))
            conduct.advance(now)
            return True
        return conduct.come_down(now, FALLBACK_LINK)

    def _supervise(self, now: Now) -> bool:
        conduct, watch = self._conduct, self._conduct.supervisor
        violated = None if watch is None else watch.violated(conduct.monitor.state(now.monotonic_us), now)
        if violated is None:
            return False
        conduct.dispatcher.end(now, "violated", violated)
        conduct.fall_back(FALLBACK_LINK)
        return True

    def _fall(self, now: Now) -> bool:
        conduct = self._conduct
        if conduct.dispatcher.active is None and conduct.craft.at_rest:
            conduct.down(now)
            return False
        if conduct.fallback.turn(now, conduct.monitor.state(now.monotonic_us)) is Progress.STRANDED:
            conduct.journal.effect(now, "stranded")
            conduct.stand_down(now, conduct.cause or Ending.ABORTED)
        return False
