"""X1, X2 and X5: flights of each mission with each deadline in each mode, and how long every step takes in them.

The vehicle is simulated in virtual time; what is between a frame of the vehicle and the frame of a command runs in real
time, as in `run`: decoding, state, decision, permit, evidence written by its thread to a file, encoding, and a real UDP
socket. The simulation runs in the same process, so that a step finds the processor's caches as cold as after a wait.
While the vehicle flies the runtime's clock stands still during a computation, so its own estimate of the latency is
the conservative one at first and 0 later; misses are judged here, by the measured times.
"""

import gc
import os
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter_ns
from typing import Any, Final, NamedTuple

from msgspec.structs import replace

from rtshcua.adapters.loop import HELD_WAIT_US, RunLoop, append_all
from rtshcua.adapters.store.evidence_file import EvidenceFile, EvidenceWriter
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation import sources
from rtshcua.evaluation.design import MODES, POINTS, UNENFORCED, EvaluationPlan, EvaluationPoint, WorkUnit
from rtshcua.evaluation.modes import NoEvidence, NoRecorder, load_in, started, unavailable
from rtshcua.evaluation.results import PointFlight, Result, StepTiming, UnavailableMode
from rtshcua.evaluation.worlds import ISSUED_US
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.durability import SYNCED_FIRST
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import BoundaryKey, Command, Event, EvidenceSink, Succeeded
from rtshcua.onboard.runtime.runtime import Runtime
from rtshcua.virtual import development_keys
from rtshcua.virtual.flight import LATER_US
from rtshcua.virtual.vehicle import SECOND, START, VirtualClock, VirtualVehicle
from rtshcua.wire.boundary_chain import START as FIRST
from rtshcua.wire.keys import Duty
from rtshcua.wire.request import STEP
from rtshcua.wire.request import decode as decode_request
from rtshcua.wire.response import decode as decode_response

#: the key of the unit that says why a mode is not available; its second part is the mode
ABSENT: Final = "unavailable"
#: the modes in an emulator, whose flights take minutes
EMULATED: Final = ("trustzone-m", "optee")
#: of a sample: the point of all modes, and those of longer missions, which take longer, of one mode
_QUICK_POINT: Final = EvaluationPoint("short", 1_500_000)
_QUICK_LONGER: Final = (EvaluationPoint("standard", 500_000), EvaluationPoint("extended", 500_000))
_QUICK_MODE: Final = "software"
#: the loop's longest wait, and how often it reads the vehicle's frames, in us of the flight
_WAIT_US: Final = 100_000
_TICK_US: Final = 50_000
#: the speed of the last metres of a landing, as the vehicle's owner may set it: shorter flights
_LAND_MM_S: Final = 1_500
#: us: a flight that lasts longer has failed
_LONGEST_US: Final = 1_800 * SECOND


class CompiledPoint(NamedTuple):
    """A mission that was compiled, signed, and the trust root under which a vehicle opens it."""

    bundle: bytes
    root: bytes
    policy: Policy
    mission: Mission


def compiled(mission: str, deadline_us: int, issued_us: int) -> CompiledPoint:
    """Compile and sign a mission whose steps all have one deadline. Raises ValueError where it has errors."""
    policy, flown = sources.compiled(mission, deadline_us, issued_us)
    return CompiledPoint(
        development_keys.seal(policy, flown), development_keys.root(ISSUED_US, policy.roles), policy, flown
    )


class _Asked(NamedTuple):
    """One request to the boundary, with its answer, and when that came."""

    request: bytes
    answer: bytes
    took_ns: int
    answered_ns: int


class _TimedBoundary:
    """A boundary whose answers are timed."""

    def __init__(self, boundary: Any) -> None:
        self._boundary = boundary
        self.asked: list[_Asked] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._boundary, name)

    def enforce(self, request: bytes) -> bytes:
        """Time one decision."""
        began_ns = perf_counter_ns()
        answer: bytes = self._boundary.enforce(request)
        ended_ns = perf_counter_ns()
        self.asked.append(_Asked(request, answer, ended_ns - began_ns, ended_ns))
        return answer


class _Begun(NamedTuple):
    """A command, with the time from its step's release to its first frame, and when that was handed to the socket."""

    command: Command
    took_ns: int
    sent_ns: int


class TimedVehicle(VirtualVehicle):
    """Time-stamps the frames that release steps, and sends commands to a socket."""

    def begin_timing(self, link: socket.socket) -> None:
        """Set where frames go: a socket that sends to itself."""
        self._link, self._address = link, link.getsockname()
        self._released = (0, 0)  # on the flight's clock in us, and on the computer's in ns
        self._turned = (0, 0)  # the same for the last advance of the flight's clock
        self.begun: list[_Begun] = []

    @property
    def over(self) -> bool:
        """Whether the flight can be left: never before the end of the mission."""
        return False

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Event]:
        """Wait in real time for a record."""
        if timeout_us == HELD_WAIT_US:
            time.sleep(timeout_us / 1e6)
            return super().poll(now_us, 0)
        events = super().poll(now_us, timeout_us)
        self._turned = self.clock.elapsed_us, perf_counter_ns()
        return events

    def begin(self, command: Command, now_us: int) -> None:
        """Send and time-stamp the frames of a command."""
        events, frames = self.driver.begin(command, now_us)
        for frame in frames[:1]:
            self._link.sendto(frame, self._address)
        sent_ns = perf_counter_ns()
        for frame in frames[1:]:
            self._link.sendto(frame, self._address)
        elapsed_us, (released_us, released_ns) = self.clock.elapsed_us, self._released
        if not self.begun:  # nothing ends before the first step, which is released when the vehicle is ready
            released_us, released_ns = self._turned
        took_ns = sent_ns - released_ns
        if released_us != elapsed_us:  # it was deferred
            took_ns = 1_000 * (elapsed_us - released_us) + sent_ns - self._turned[1]
        self.begun.append(_Begun(command, took_ns, sent_ns))
        self._send(frames, events)
        self._pending += events

    def _take(self, datagrams: Iterable[bytes], events: list[Event]) -> None:
        take = super()._take
        for datagram in datagrams:
            before = len(events)
            came_ns = perf_counter_ns()
            take([datagram], events)
            if any(type(event) is Succeeded for event in events[before:]):
                self._released = self.clock.elapsed_us, came_ns


class _Flown(NamedTuple):
    """What one flight gave: how it ended, how long loading took, the requests and the commands."""

    ending: str
    loaded_ns: int
    asked: Sequence[_Asked]
    begun: Sequence[_Begun]


def fly(
    point: CompiledPoint, mode: str, seed: int, link: socket.socket, folder: Path,
    making: Callable[..., TimedVehicle] = TimedVehicle,
) -> _Flown:  # fmt: skip
    """Fly a mission once, with the vehicle that `making` makes. Raises RuntimeError for a refused bundle, BoundaryError
    and OSError.
    """
    policy, mission = point.policy, point.mission
    clock = VirtualClock(Now(START.monotonic_us, mission.issued_at_us + LATER_US, START.utc_error_us))
    with ExitStack() as stack:
        caller = stack.enter_context(started(mode, point.root, policy.vehicle.identity, folder))
        now, began_ns = clock.now(), perf_counter_ns()
        loaded = load_in(mode, point.bundle, root=point.root, now=now, caller=caller)
        if isinstance(loaded, Refusal):
            raise RuntimeError(f"{mode}: the bundle of `{mission.name}` is refused: {loaded.text}")
        loaded_ns = perf_counter_ns() - began_ns
        boundary = _TimedBoundary(loaded.boundary)
        loaded = replace(loaded, boundary=boundary)
        config = sources.fitted(policy, seed=seed, land_mm_s=_LAND_MM_S)
        vehicle = making(policy, config, clock, loaded.executor.frames, tick_us=_TICK_US, steps=mission.invocations)
        vehicle.begin_timing(link)
        recorder, sink = _evidence(mode, folder)
        stack.callback(sink.close)
        _open_log(recorder, sink, loaded, point, now)
        loop = RunLoop(Runtime(loaded, recorder), vehicle, sink, clock, lambda *_: None, _WAIT_US, prepares=False)
        gc.collect()
        gc.freeze()
        stack.callback(gc.unfreeze)
        ending = None
        while ending is None and not vehicle.over and clock.elapsed_us < _LONGEST_US:
            ending = loop.turn()
        closing = recorder.closing(clock.now(), ending=ending or "none", tlog=None)
        append_all(sink, closing, SYNCED_FIRST)
    return _Flown(ending or "none", loaded_ns, boundary.asked, vehicle.begun)


def _evidence(mode: str, folder: Path) -> tuple[Recorder, EvidenceSink]:
    if mode == UNENFORCED:
        return NoRecorder(), NoEvidence()
    key = development_keys.keys()[Duty.LOG]
    recorder = Recorder(lambda text: key.sign(text, duty=Duty.LOG), key.public, partial(os.urandom, 32))
    return recorder, EvidenceWriter(EvidenceFile(folder / "log.jsonl"))


def _open_log(recorder: Recorder, sink: EvidenceSink, loaded: Loaded, point: CompiledPoint, now: Now) -> None:
    genesis = recorder.genesis(
        now, bundle=point.bundle, root=point.root, boot=loaded.in_force.flight, vehicle=loaded.vehicle,
        mission=point.mission.name, mode=loaded.mode, received_us=now.monotonic_us,
    )  # fmt: skip
    sink.append(genesis, SYNCED_FIRST)
    loaded.attestation.begin(BoundaryKey(development_keys.keys()[Duty.BOUNDARY], 1, FIRST))
    recorder.attest = loaded.attestation.statement
    append_all(sink, recorder.attested(now), SYNCED_FIRST)


def units(plan: EvaluationPlan) -> Sequence[WorkUnit]:
    """Each flight: mission, deadline, seed and mode. Those that differ in the mode only follow each other.

    Flights in an emulated home are slow and come last. A mode that is not available here has one unit.
    """
    absent = [mode for mode in plan.modes if unavailable(mode) is not None]
    here = [mode for mode in plan.modes if mode not in absent]
    points = (_QUICK_POINT,) if plan.quick else POINTS
    found = [
        WorkUnit("X1", (*point, seed, mode))
        for emulated in (False, True)
        for seed in range(1, plan.runs + 1)
        for point in points
        for mode in here
        if (mode in EMULATED) is emulated
    ]
    return [*(WorkUnit("X1", (ABSENT, mode)) for mode in absent), *found, *_longer(plan, here)]


def _longer(plan: EvaluationPlan, here: Sequence[str]) -> Iterator[WorkUnit]:
    """The flights of longer missions in a sample."""
    if plan.quick and _QUICK_MODE in here:
        for point in _QUICK_LONGER:
            for seed in range(1, plan.runs + 1):
                yield WorkUnit("X1", (*point, seed, _QUICK_MODE))


def run(unit: WorkUnit) -> Sequence[Result]:
    """Fly one flight. Raises RuntimeError for a refused bundle, BoundaryError and OSError."""
    if unit.key[0] == ABSENT:
        absent = unavailable(str(unit.key[1]))
        why = "" if absent is None else f"{absent.text}; {absent.help}"
        return (UnavailableMode(mode=str(unit.key[1]), why=why),)
    mission, deadline_us, seed, mode = str(unit.key[0]), int(unit.key[1]), int(unit.key[2]), str(unit.key[3])
    began_ns = perf_counter_ns()
    point = compiled(mission, deadline_us, issued_us(seed, mode))
    compiled_ns = perf_counter_ns() - began_ns
    flown = _flown(point, mode, seed)
    first_ns = next((each.took_ns for each in flown.begun), 0)
    answers = [*_answers(point, flown)]
    steps = tuple(_steps(flown, {step: (asked, answer) for step, asked, answer in answers}))
    late = sum(each.end_to_end_ns is None or each.end_to_end_ns > 1_000 * deadline_us for each in steps)
    fallbacks = sum(each.outcome == "fallback" for each in steps) + sum(
        not each.command.needs_record for each in flown.begun
    )
    return (
        PointFlight(
            mission=mission, deadline_us=deadline_us, mode=mode, seed=seed, ending=flown.ending, misses=late,
            fallbacks=fallbacks, proposal_ns=compiled_ns + flown.loaded_ns + first_ns, invocations=steps,
            asked_again=len(answers) - len(steps),
        ),
    )  # fmt: skip


def issued_us(seed: int, mode: str) -> int:
    """UTC in us at which the mission of a flight is issued: that of each seed one second later, so that ids differ."""
    return ISSUED_US + seed * SECOND + MODES.index(mode)


def _flown(point: CompiledPoint, mode: str, seed: int) -> _Flown:
    """Fly in a folder of its own, with a socket that nothing reads as the vehicle."""
    with (
        TemporaryDirectory(prefix="rtshcua-flight-") as folder,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        link.bind(("127.0.0.1", 0))
        return fly(point, mode, seed, link, Path(folder))


def _answers(point: CompiledPoint, flown: _Flown) -> Iterator[tuple[int, _Asked, Decision]]:
    """The decisions about steps, in their order, each with its step."""
    policy, steps = point.policy, point.mission.invocations
    for each in flown.asked:
        request = decode_request(each.request, policy.slots, len(policy.monitors))
        if isinstance(request, Refusal) or request.kind != STEP:
            continue
        answer = decode_response(each.answer, policy, steps[request.step].contract)
        if isinstance(answer, Decision):
            yield request.step, each, answer


def _steps(flown: _Flown, last: Mapping[int, tuple[_Asked, Decision]]) -> Iterator[StepTiming]:
    """The invocations of a flight: of each step its last answer, and what was sent by it."""
    granted = ((_granting(last, begun), begun) for begun in flown.begun)
    sent = {asked.answered_ns: begun for asked, begun in granted if asked is not None}
    for step, (each, answer) in sorted(last.items()):
        begun = sent.get(each.answered_ns)
        yield StepTiming(
            step=step, outcome=answer.outcome.name.lower(), reason=answer.reason.value, validation_ns=each.took_ns,
            end_to_end_ns=None if begun is None else begun.took_ns,
            dispatch_ns=None if begun is None else begun.sent_ns - each.answered_ns,
        )  # fmt: skip


def _granting(last: Mapping[int, tuple[_Asked, Decision]], begun: _Begun) -> _Asked | None:
    """The answer that granted a command: the last one before it; None for a link."""
    before = [each for each, answer in last.values() if each.answered_ns < begun.sent_ns and answer.permit]
    return max(before, key=lambda each: each.answered_ns, default=None) if begun.command.needs_record else None
