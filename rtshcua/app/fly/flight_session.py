"""One flight of a cleared bundle: connects link, runtime, evidence, raw frames and view, and makes the summary."""

import secrets
import shlex
import time
from base64 import b64encode
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rtshcua.adapters.clock import StepWatch
from rtshcua.adapters.loop import HELD_WAIT_US, RunLoop, append_all
from rtshcua.adapters.preparation import Preparations
from rtshcua.adapters.store.evidence_file import EvidenceWriter
from rtshcua.adapters.store.runs import BUNDLE, LOG, RunFolder
from rtshcua.adapters.store.vehicle_records import OwedParameters
from rtshcua.adapters.utc import CLOCK, certain_from_us
from rtshcua.adapters.vehicle.drain import drained
from rtshcua.app.fly.clearance import Cleared, bundle_lapsed
from rtshcua.app.fly.closing import ReadBack, close_log, keep_summary, read_back
from rtshcua.app.fly.connect import Connected
from rtshcua.app.fly.flight_request import FlightContext, FlightRequest
from rtshcua.app.fly.narrator import Answering, Teller, Watching, plan_of
from rtshcua.app.fly.previous_log import LOG_BEFORE, LogBefore
from rtshcua.app.fly.setting_notes import foreign
from rtshcua.app.fly.simulated_flight import SIMULATED, pace_of
from rtshcua.app.fly.start_boundary import Begun
from rtshcua.app.fly.stop_wishes import Wish
from rtshcua.app.fly.story import FlightPlanView, Note, Snapshot, Summary
from rtshcua.app.fly.verify_bundle import LogNotSigned
from rtshcua.app.fly.view_ports import LiveView
from rtshcua.app.fly.witnesses import FlightWitnesses
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.log_writer import ATTESTED, Recorder
from rtshcua.model.durability import SYNC_US, SYNCED, SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Append, Ending, Event, Interrupted, Presented
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.runtime import Runtime

if TYPE_CHECKING:
    from rtshcua.app.fly.incidents import Watch

_SEED_BYTES = 32

EXIT_CODES = {
    Ending.COMPLETED: ExitCode.OK,
    Ending.ABORTED: ExitCode.ABORTED,
    Ending.RECALLED: ExitCode.ABORTED,
    Ending.CANCELLED: ExitCode.ABORTED,
    Ending.REFUSED: ExitCode.REFUSED,
    Ending.STOOD_DOWN: ExitCode.STOOD_DOWN,
    Ending.CRASHED: ExitCode.CRASHED,
    Ending.LINK_LOST: ExitCode.LINK,
    Ending.INTERRUPTED: ExitCode.INTERRUPTED,
    Ending.EVIDENCE_LOST: ExitCode.FULL,
}

_BACKLOG_S = 1.0
_WAIT_US = 50_000
_FASTEST_WAIT_S = 0.002
_WAIT_S = 0.02
#: the most documents that are read before the loop begins; others wait in their sockets
_MOST_EARLY = 32

_LANDING = "interrupted: the vehicle falls back and lands, then the log is closed"
_SILENT = (
    "interrupted: the vehicle is silent; it falls back as soon as it is heard again, and is given up if it stays "
    "silent. Ctrl-C twice more within 3 s leaves it"
)
_CRASHED = "CRASHED: nothing more is sent to the vehicle. Keep away from its rotors and battery"
_FAILED = (
    "this program failed, and the vehicle may be flying: nothing more is sent, and nothing watches it. The same "
    "`rtshcua run` again brings it down"
)
_ON_GROUND = "interrupted on the ground: nothing is sent, and the log is closed"
_KNOWING = (
    "the vehicle is being brought down; Ctrl-C once more within 3 s tells it to land where it is, stops "
    "watching, and closes the log"
)


class FlightSession:
    """One cleared flight. Until `begin`, nothing is written to the disk or sent."""

    def __init__(
        self, context: FlightContext, begun: Begun, connected: Connected, cleared: Cleared, previous: LogBefore,
        debts: OwedParameters, witnesses: FlightWitnesses, view: LiveView,
    ) -> None:  # fmt: skip
        request, loaded, clock = context.request, begun.loaded, context.clock
        self._begun, self._loaded, self._clock = begun, loaded, clock
        self._context, self._connected, self._cleared = context, connected, cleared
        self._vehicle, self._agents, self._early = connected.vehicle, connected.agents, list(connected.events)
        self._feed = view
        self._previous, self._debts, self._witnesses = previous, debts, witnesses
        self._run, self._boundary = cleared.run, cleared.session
        self._steps = StepWatch()
        self._preparing, self._last_detail = True, ""
        self._left = ""  # set once the operator stops watching a vehicle that may fly
        self._recorder = Recorder(begun.log_key.sign, begun.log_key.public, draw)
        self._start_us = clock.now().monotonic_us
        policy, mission = loaded.bundle.policy, loaded.bundle.mission
        answering = answered_by(request, cleared.run)
        self._teller = Teller(policy, mission, self._start_us, answering, context.console.detail_of)

    def begin(self) -> Refusal | None:
        """Write the first records to the disk, and show the plan. A resumed flight does not wait for the disk. A
        refusal if the boundary does not sign the log. Raises OSError if the disk does not accept them.
        """
        run, resumed, loaded, now = self._run, self._cleared.resumed, self._loaded, self._clock.now()
        log = run.log()
        self._previous.begin(log.path, aloft=resumed)
        self._frames = run.telemetry()
        self._context.frames.attach(self._frames)
        self._sink = EvidenceWriter(log)
        try:
            self._record_beginning(now)
        except LogNotSigned as error:
            return error.refusal
        finally:
            self._begun.log_key.hand_over(_signs_no_more)  # the key is not needed in flight, so it is dropped
        if not resumed:  # a vehicle in the air comes down even without a disk
            self._sink.settle()
        self._witnesses.begin(log.path, lambda: self._sink.synced)
        debts = self._debts
        self._preparations = Preparations(
            loaded, self._vehicle.driver, self._clock, debts.left, self._record, self._note, debts.keep,
            self._context.slack, debts.trouble,
        )  # fmt: skip
        if debts.trouble is not None:
            self._feed.post(Note(debts.trouble))
        limits = Limits(stalled_us=Limits().stalled_us * self._context.slack)
        self._runtime = Runtime(
            loaded, self._recorder, limits=limits, resumed=resumed, idle_us=self._context.request.idle_us
        )
        self._vehicle.driver.resumes = resumed
        self._feed.post(self._plan())
        self._watch = Watching(
            self._feed, self._teller, self._runtime.view, self._waits_for, live=self._context.console.live,
            replan=self._replan, agents=self._agents,
        )  # fmt: skip
        return None

    def _record_beginning(self, now: Now) -> None:
        """Record the genesis, the boundary's first statement, and the facts known before the first decision."""
        loaded, request = self._loaded, self._context.request
        genesis = self._recorder.genesis(
            now, bundle=self._begun.bundle, root=self._begun.trusted.signed, boot=loaded.in_force.flight,
            vehicle=loaded.vehicle, mission=loaded.bundle.mission.name, mode=loaded.mode, before=self._previous.hash,
            received_us=loaded.in_force.received_us(0), sync_us=self._clock.us_in(SYNC_US / 1e6),
        )  # fmt: skip
        self._sink.append(genesis, SYNCED_FIRST)
        session = loaded.attestation.begin(self._boundary.key)
        self._boundary.begun(loaded.attestation.digest, session)
        self._recorder.attest = loaded.attestation.statement
        append_all(self._sink, self._recorder.attested(now), WRITTEN)
        home = loaded.attestation.home()
        if home is not None:
            self._sink.append(self._recorder.effect(now, ATTESTED, detail=b64encode(home).decode()), WRITTEN)
        simulated = pace_of(request.speed, own=request.link is None)
        known = ((SIMULATED, simulated), (LOG_BEFORE, self._previous.note), (CLOCK, self._context.utc.bound.told()))
        for event, detail in known:
            if detail:
                self._sink.append(self._recorder.effect(now, event, detail=detail), WRITTEN)

    def fly(self) -> tuple[ExitCode, Summary]:
        """Fly until an ending, and close the log."""
        try:
            ending = self._follow()
            if ending is not Ending.CRASHED:
                self._put_back()
        except BaseException:
            if self._runtime.aloft:
                self._feed.post(Note(_FAILED))
            self._close(None)
            self._witnesses.finish(lambda text: self._feed.post(Note(text)), closed=False)
            raise
        self._feed.post(Snapshot(self._runtime.view(self._clock.now())))
        if ending is Ending.REFUSED and self._vehicle.driver.unready is not None and not self._preparing:
            self._feed.post(Note(f"the vehicle was not ready to fly: {self._vehicle.driver.unready}"))
        if ending is Ending.CRASHED:
            self._feed.post(Note(_CRASHED))
        missing = self._close(ending)
        lacks = ExitCode.FULL
        found = ReadBack(None) if missing else read_back(self._run.path / LOG)
        if found.refused is not None:
            missing, lacks = (found.refused,), ExitCode.EVIDENCE
        self._witnesses.finish(lambda text: self._feed.post(Note(text)), closed=not missing)
        if not missing:
            self._previous.end(self._recorder.final_hash)
        code = EXIT_CODES[ending]
        if missing and code is ExitCode.OK:
            code = lacks
        summary = keep_summary(self._run, self._summary(ending, code, missing, found.gaps_us))
        return (code if summary.whole or code is not ExitCode.OK else ExitCode.FULL), summary

    def settle(self) -> None:
        """Restore owed parameters, and close the log of a flight that does not take place."""
        self._put_back()
        self._close(Ending.REFUSED)

    def refuse(self) -> None:
        """Close the log of a flight that does not take place."""
        self._close(Ending.REFUSED)

    @property
    def _may_fly(self) -> str:
        return self._left or self._runtime.may_fly

    @property
    def used_up(self) -> bool:
        """Whether the bundle cannot fly again after this flight."""
        return self._runtime.used_up

    @property
    def final_hash(self) -> str:
        """The hash of the last line of the log."""
        return self._recorder.final_hash

    def _plan(self) -> FlightPlanView:
        bundle = self._loaded.bundle
        return plan_of(bundle.policy, bundle.mission, mode=self._loaded.mode, speed=self._context.request.speed)

    def _replan(self) -> FlightPlanView:
        """The plan after a replacement of the mission."""
        self._teller.replace(self._loaded.bundle.mission)
        return self._plan()

    def _follow(self) -> Ending:
        wait_us = max(_WAIT_US, self._clock.us_in(_FASTEST_WAIT_S))
        held_wait_us = max(HELD_WAIT_US, self._clock.us_in(HELD_WAIT_US / 1e6))
        watch: Watch = self._watch
        incidents = self._context.request.incidents
        if incidents is not None:
            watch = incidents.around(watch, self._start_us)
        problem = self._preparations.begin(self._wait_before)
        if problem is not None:
            self._show_once(problem)
            flavour = self._vehicle.driver.flavour
            for text in () if flavour is None else foreign(self._loaded.preparation.settings, flavour.name):
                self._feed.post(Note(text))
            return Ending.REFUSED
        self._preparing = False
        loop = RunLoop(self._runtime, self._vehicle, self._sink, self._clock, watch, wait_us, held_wait_us)
        also = [*self._early, *self._backlog()]
        while True:
            match self._context.interrupts.wish():
                case Wish.LAND:
                    self._feed.post(Note(self._stop_note()))
                    also.append(Interrupted(self._clock.now().monotonic_us))
                case Wish.KNOW:
                    self._feed.post(Note(_KNOWING))
                case Wish.LEAVE:
                    self._runtime.leave()
                    return loop.turn(also) or self._leave()
                case None:
                    pass
            also += self._read_sockets()
            also += self._witnesses.events(self._clock.now().monotonic_us)
            also += self._steps.events(self._clock.now())
            if self._context.utc.waits:
                also += self._look_at_utc()
            ending = loop.turn(also)
            if ending is not None:
                return ending
            also = []

    def _wait_before(self) -> bool:
        """Wait a little before the loop, and keep the events for it; False after a request to stop."""
        self._early += self._poll()
        self._seal_when_due()
        if sum(isinstance(each, Presented) for each in self._early) < _MOST_EARLY:
            self._early += self._read_sockets()
        if self._context.interrupts.wish() is None:
            return True
        self._feed.post(Note(_ON_GROUND))
        self._early.append(Interrupted(self._clock.now().monotonic_us))
        return False

    def _waits_for(self) -> str | None:
        """Why the vehicle is not ready, as text; None while parameters are being set."""
        return None if self._preparing else self._vehicle.driver.unready

    def _put_back(self) -> None:
        problem = self._preparations.end(self._wait_after)
        if problem is not None:
            self._show_once(problem)

    def _show_once(self, text: str) -> None:
        """Show a text, unless it was just shown with its record."""
        if text != self._last_detail:
            self._feed.post(Note(text))

    def _wait_after(self) -> bool:
        """Wait a little after the loop; False once the user wants to leave."""
        self._poll()
        self._seal_when_due()
        if self._agents is not None:
            self._agents.turn_away(self._clock.now())
        return self._context.interrupts.wish() is not Wish.LEAVE

    def _read_sockets(self) -> Sequence[Event]:
        """Serve the sockets, and return the documents that agents and operators handed in."""
        if self._agents is None:
            return ()
        found = self._agents.events(self._clock.now())
        self._agents.pass_on(self._vehicle.pass_on)
        for text in self._agents.notes():
            self._feed.post(Note(text))
        return found

    def _poll(self) -> Sequence[Event]:
        return self._vehicle.poll(self._clock.now().monotonic_us, self._clock.us_in(_WAIT_S))

    def _record(self, event: str, detail: str) -> None:
        """Record an effect outside of the loop, and wait until it is on the disk. Raises OSError."""
        self._note(event, detail)
        self._sink.settle()

    def _note(self, event: str, detail: str) -> None:
        """Record an effect without waiting for the disk; the loop notices a failure. Raises OSError."""
        now = self._clock.now()
        self._catch_up(now)
        line = self._recorder.effect(now, event, detail=detail, durability=SYNCED_FIRST)
        self._sink.append(line, SYNCED_FIRST)
        self._last_detail = detail
        self._watch(now, (), (Append(line, SYNCED_FIRST),))

    def _catch_up(self, now: Now) -> None:
        """Seal a finished epoch before another record is written. Raises OSError."""
        append_all(self._sink, self._recorder.caught_up(now), SYNCED_FIRST)

    def _seal_when_due(self) -> None:
        """Seal a finished epoch outside of the loop; the loop notices a failure."""
        now = self._clock.now()
        if self._recorder.due(now):
            with suppress(OSError):
                append_all(self._sink, self._recorder.sealing(now), SYNCED_FIRST)

    def _look_at_utc(self) -> list[Event]:
        """Take the vehicle's time of day if it is reported after the log began. If the bundle has expired by that time,
        return an interruption, and nothing flies.
        """
        now, flavour = self._clock.now(), self._vehicle.driver.flavour
        if flavour is None or not self._context.utc.look(self._vehicle.driver.source, flavour.name, now.monotonic_us):
            return []
        self._vehicle.driver.asks_utc = False
        now = self._clock.now()
        self._vehicle.driver.issued_from_us = certain_from_us(self._loaded.issued_us, now)
        self._catch_up(now)
        self._sink.append(self._recorder.effect(now, CLOCK, detail=self._context.utc.bound.told()), WRITTEN)
        late = None if self._cleared.resumed else bundle_lapsed(self._context, self._begun)
        if late is None:
            return []
        self._feed.post(Note(f"by the vehicle's time: {late.text}"))
        return [Interrupted(now.monotonic_us)]

    def _stop_note(self) -> str:
        """The note for the first request to stop."""
        if not self._runtime.aloft:
            return _ON_GROUND
        return _LANDING if self._runtime.linked else _SILENT

    def _backlog(self) -> list[Event]:
        """The events received during preparation, so that the runtime begins with the present state."""
        events: list[Event] = []
        until_s = time.monotonic() + _BACKLOG_S
        while time.monotonic() < until_s and (received := self._vehicle.poll(self._clock.now().monotonic_us, 0)):
            events += received
        return events

    def _leave(self) -> Ending:
        """Stop watching, after the command to come down if it could be sent; record that in the log."""
        now = self._clock.now()
        told = "it was told to come down" if self._runtime.homeward else "it could not be told to come down"
        self._vehicle.release()
        with suppress(OSError):
            self._catch_up(now)
        line = self._recorder.effect(now, "left", detail=f"the operator stopped watching; {told}; nothing more is sent")
        with suppress(OSError):
            self._sink.append(line, SYNCED)
        self._feed.post(Note(f"left: {told}; nothing more is sent"))
        self._left = f"the vehicle may be flying: {told}; the operator left, so nothing watches it any more"
        return Ending.INTERRUPTED

    def _close(self, ending: Ending | None) -> tuple[str, ...]:
        """Sign and close the log; return missing evidence. Without an ending (a fault) the log stays unsigned."""
        missing = close_log(
            self._recorder, self._sink, self._frames, self._clock.now, ending,
            lambda text: self._feed.post(Note(text)),
            self._agents.tell if self._agents is not None else lambda line: None,
        )  # fmt: skip
        if ending is not None and not missing and self._loaded.boundary.lost is None:
            self._boundary.ended(self._loaded.attestation.digest)
        return missing

    def _summary(self, ending: Ending, code: ExitCode, missing: tuple[str, ...], gaps_us: int) -> Summary:
        loaded, policy, mission = self._loaded, self._loaded.bundle.policy, self._loaded.bundle.mission
        flavour = self._vehicle.driver.flavour
        log = _short(self._run.path / LOG)
        used = self._vehicle.driver.consumption
        for_a_km, km_declared = used.for_a_km
        return Summary(
            mission=mission.name,
            policy=f"{policy.name}@{policy.version}",
            vehicle=loaded.vehicle,
            flavour=flavour.name if flavour is not None else "",
            mode=loaded.mode,
            ending=ending,
            exit_code=code,
            steps=len(mission.invocations),
            steps_done=len(self._teller.done),
            outcomes=self._teller.outcomes,
            flight_us=self._clock.now().monotonic_us - self._start_us,
            records=self._recorder.count,
            whole=not missing,
            missing=missing,
            gaps_us=gaps_us,
            unconfirmed=tuple(self._teller.unconfirmed),
            may_fly=self._may_fly,
            battery=used.summary,
            drain_declared=drained(policy.vehicle),
            drain_measured=used.in_a_minute,
            km_declared=km_declared if for_a_km else 0,
            km_measured=for_a_km,
            images_taken=self._teller.images.taken,
            images_missing=self._teller.images.missing,
            images_failed=self._teller.images.failed,
            payload_failed=self._teller.images.commands_failed,
            folder=str(self._run.path),
            log=log,
            next=f"rtshcua verify-log {'--audit ' if self._loaded.boundary.lost else ''}{shlex.quote(log)}",
        )


def answered_by(request: FlightRequest, run: RunFolder) -> Answering | None:
    """What approvals of this flight need; None without a socket."""
    socket = request.operator_socket or request.agent_socket
    if socket is None:
        return None
    handed_in = request.wait_s is not None  # the sender's file is unknown, the run folder has a copy
    return Answering(str(run.path / BUNDLE if handed_in else request.bundle), str(socket), ahead=request.speed != 1)


def _signs_no_more(_checkpoint: bytes) -> Refusal:
    return Refusal("log-begun", "the log has begun")


def draw() -> bytes:
    """Draw the secret of an epoch's key."""
    return secrets.token_bytes(_SEED_BYTES)


def _short(path: Path) -> str:
    """The path relative to the working folder, if it lies in it."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)
