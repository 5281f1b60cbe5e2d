"""A world for the runtime: an obedient fake vehicle, a manual clock, and a whole run with both.

Only the ports are faked: the real code seals, loads and decides.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any

from msgspec.structs import replace

from reference.flat_case import (
    BATTERY,
    FIX,
    HEIGHT,
    ISSUED,
    LINK,
    MISSION,
    OBSTACLE,
    POLICY,
    POSITION_X,
    POSITION_Y,
    WIND,
    M,
    S,
)
from reference.seeds import epoch_seeds
from reference.verifiers import agree
from rtshcua.decision.session import InForce
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.log_writer import Recorder
from rtshcua.ground.audit.audit import audit
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load, session
from rtshcua.onboard.ports import (
    Action,
    AirState,
    Append,
    Command,
    CommandFailed,
    Ending,
    Event,
    Readings,
    Ready,
    Release,
    Sent,
    Succeeded,
)
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.runtime import Runtime
from rtshcua.wire import binding, bundle
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.request import CONTINGENCY_LINK, Request, encode
from rtshcua.wire.request import decode as decode_request
from rtshcua.wire.response import Status, decode
from rtshcua.wire.trust import TrustRoot

VEHICLE = POLICY.vehicle.identity
SESSION_KEY = bytes(range(32))
FLIGHT = bytes(16)
START = Now(monotonic_us=500 * S, utc_us=ISSUED + 60 * S, utc_error_us=20_000)
TICK = 50_000  # us
SKILL_US = 2 * S  # the duration of every skill of the fake vehicle
NEVER = 1 << 60

ROOT_KEY, POLICY_KEY, MISSION_KEY, LOG_KEY, APPROVAL_KEY = (
    SigningKey.from_seed(bytes([number]) * 32, duty=duty, development=True)
    for number, duty in enumerate((Duty.ROOT, Duty.POLICY, Duty.MISSION, Duty.LOG, Duty.APPROVAL))
)
ROOT = TrustRoot(
    version=1,
    development=True,
    issued_at_us=0,
    expires_at_us=ISSUED * 2,
    keys=(
        POLICY_KEY.verification(vehicles=(VEHICLE,)),
        MISSION_KEY.verification(
            roles=("operator",), sources=("agent", "operator"), vehicles=(VEHICLE,), policies=(ANY,)
        ),
        APPROVAL_KEY.verification(roles=("supervisor",), sources=("operator",), vehicles=(VEHICLE,), person="ada"),
        LOG_KEY.verification(vehicles=(VEHICLE,)),
        ROOT_KEY.verification(),
    ),
)


class The:
    """An object compared by identity, because equal values may have other types and other bytes."""

    __slots__ = ("thing",)

    def __init__(self, thing: Any) -> None:
        self.thing = thing

    def __eq__(self, other: object) -> bool:
        return isinstance(other, The) and self.thing is other.thing

    def __hash__(self) -> int:
        return id(self.thing)


# Most tests begin with the same few bundles: these are sealed and opened once.
_kept = lru_cache(maxsize=64)


def sealed(policy: Policy = POLICY, mission: Mission = MISSION) -> bytes:
    """Return the bound and signed bundle of a policy and a mission."""
    return _sealed(The(policy), The(mission))


@_kept
def _sealed(policy: The, mission: The) -> bytes:
    return _seal(policy, The(binding.bind(mission.thing, bundle.policy_digest(bundle.policy_payload(policy.thing)))))


@_kept
def _seal(policy: The, bound: The) -> bytes:
    payload, mission = bundle.policy_payload(policy.thing), bundle.mission_payload(bound.thing)
    return bundle.seal(payload, mission, policy_key=POLICY_KEY, mission_key=MISSION_KEY)


@cache
def _signed_root() -> bytes:
    return ROOT.sign(ROOT_KEY)


def sealed_again(of: Loaded) -> bytes:
    """Return the bundle of a loaded one."""
    return _seal(The(of.bundle.policy), The(of.bundle.mission))


def try_load(
    data: bytes, mode: EnforcementMode = EnforcementMode.SOFTWARE, *, own_simulator: bool = False
) -> Loaded | Refusal:
    """`load` with the keys of this world."""
    return load(
        data,
        root=ROOT,
        vehicle=VEHICLE,
        now=START,
        mode=mode,
        session_key=SESSION_KEY,
        flight=FLIGHT,
        peer_is_own_simulator=own_simulator,
    )


def loaded(
    policy: Policy = POLICY, mission: Mission = MISSION, mode: EnforcementMode = EnforcementMode.SOFTWARE
) -> Loaded:
    """Load the bundle of a policy and a mission."""
    return renewed(_loaded(The(policy), The(mission), mode))


@_kept
def _loaded(policy: The, mission: The, mode: EnforcementMode) -> Loaded:
    result = try_load(sealed(policy.thing, mission.thing), mode, own_simulator=True)
    assert isinstance(result, Loaded), result
    return result


def renewed(of: Loaded, root: TrustRoot = ROOT) -> Loaded:
    """The same bundle in a new session, without opening it again."""
    in_force = InForce(of.bundle, of.policy, of.invocations, root, VEHICLE, FLIGHT, of.in_force.received_us(0))
    return session(in_force, of.mode, SESSION_KEY)


class ManualClock:
    """A clock that only a test moves."""

    def __init__(self, start: Now = START) -> None:
        self._now = start

    def now(self) -> Now:
        return self._now

    def advance(self, us: int) -> None:
        now = self._now
        self._now = Now(now.monotonic_us + us, now.utc_us + us, now.utc_error_us)


@dataclass
class FakeVehicle:
    """Obeys commands within `SKILL_US` and reports it; `values` is its telemetry, by state slot.

    Skills in `fails` fail, those in `deaf` never end; slots in `silent` are not reported.
    """

    values: dict[int, int | None] = field(
        default_factory=lambda: {
            BATTERY: 9_000,
            HEIGHT: 0,
            WIND: 4 * M,
            LINK: 9_000,
            FIX: 3,
            POSITION_X: 0,
            POSITION_Y: 0,
            OBSTACLE: 20 * M,
        }
    )
    fails: set[str] = field(default_factory=set)
    deaf: set[str] = field(default_factory=set)
    silent: set[int] = field(default_factory=set)
    mute: bool = False
    armed: bool = False
    airborne: bool = False
    commands: list[Command] = field(default_factory=list)
    released: bool = False
    _ends_us: int = 0
    _current: Command | None = None

    def begin(self, command: Command, now_us: int) -> None:
        assert not self.released, "nothing is sent after standing down"
        self.commands.append(command)
        lasting_us = (command.hold_us or NEVER) if command.kind == MotionKind.HOLD else SKILL_US
        self._current, self._ends_us = command, now_us + lasting_us
        self.armed = True
        if command.path and command.kind in (MotionKind.FLY, MotionKind.COVER):
            self.values |= {POSITION_X: command.path[-2], POSITION_Y: command.path[-1]}

    def poll(self, now_us: int) -> list[Event]:
        if self.mute:
            return []
        values = tuple((slot, value) for slot, value in self.values.items() if slot not in self.silent)
        events: list[Event] = [Readings(now_us, values)]
        command = self._current
        over = now_us >= self._ends_us or (command is not None and command.skill in self.fails)
        if command is not None and over and command.skill not in self.deaf:
            self._current = None
            if command.skill in self.fails:
                events.append(CommandFailed(now_us, command.token, "no-effect", "because"))
            else:
                self._arrive(command)
                events += [AirState(now_us, self.armed, self.airborne), Succeeded(now_us, command.token)]
        return events

    def _arrive(self, command: Command) -> None:
        if command.kind == MotionKind.CLIMB:
            self.airborne = True
            self.values[HEIGHT] = command.altitude
        elif command.kind in (MotionKind.HOME, MotionKind.LAND):
            self.airborne = self.armed = False
            self.values[HEIGHT] = 0
            if command.kind == MotionKind.HOME:
                self.values |= {POSITION_X: 0, POSITION_Y: 0}


class Run:
    """One run: the loop with a fake vehicle, which records everything for assertions."""

    def __init__(
        self,
        of: Loaded | None = None,
        vehicle: FakeVehicle | None = None,
        *,
        limits: Limits | None = None,
        resumed: bool = False,
        ready: bool = True,
        idle_us: int | None = None,
    ) -> None:
        self.loaded = of or loaded()
        self.vehicle = vehicle or FakeVehicle()
        self.clock = ManualClock()
        recorder = Recorder(lambda data: LOG_KEY.sign(data, duty=Duty.LOG), LOG_KEY.public, epoch_seeds())
        self.lines = [
            recorder.genesis(
                START,
                bundle=sealed_again(self.loaded),
                root=_signed_root(),
                boot=self.loaded.in_force.flight,
                vehicle=VEHICLE,
                mission=self.loaded.bundle.mission.name,
                mode=self.loaded.mode,
            )
        ]
        self.recorder = recorder
        self.runtime = Runtime(self.loaded, recorder, limits=limits, resumed=resumed, idle_us=idle_us)
        self.actions: list[Action] = []
        if ready:
            self.step(AirState(0, False, self.vehicle.airborne), *self.vehicle.poll(START.monotonic_us), Ready(0))

    @property
    def ending(self) -> Ending | None:
        return self.runtime.ending

    @property
    def flown(self) -> list[str]:
        """The skills that were sent, in order."""
        return [command.skill for command in self.vehicle.commands]

    @property
    def records(self) -> list[dict[str, object]]:
        return [json.loads(line) for line in self.lines]

    @property
    def events(self) -> list[str]:
        """The effects that were recorded, in order."""
        return [str(record["event"]) for record in self.records if record["type"] == "effect"]

    @property
    def decisions(self) -> list[tuple[object, ...]]:
        """(kind, step, link, outcome, reason) of each recorded decision."""
        keys = ("kind", "step", "link", "outcome", "reason")
        return [tuple(record[key] for key in keys) for record in self.records if record["type"] == "decision"]

    def step(self, *events: Event) -> list[Action]:
        """One turn of the loop at the present moment."""
        now = self.clock.now()
        actions = self.runtime.step(now, events)
        sent: list[Event] = []
        for action in actions:
            match action:
                case Append():
                    self.lines.append(action.line)
                case Command():
                    assert self.clock.now().monotonic_us <= action.not_after_us
                    self.vehicle.begin(action, now.monotonic_us)
                    sent.append(Sent(now.monotonic_us + 1_500, action.token))
                case Release():
                    self.vehicle.released = True
        self.actions += actions
        if sent:
            actions += self.step(*sent)
        return actions

    def tick(self, *events: Event) -> list[Action]:
        """Advance by one tick: telemetry arrives, then `events`."""
        self.clock.advance(TICK)
        return self.step(*self.vehicle.poll(self.clock.now().monotonic_us), *events)

    def until(self, done: Callable[["Run"], bool], seconds: int = 120) -> "Run":
        """Tick until `done`; fail the test if that never happens."""
        for _ in range(seconds * S // TICK):
            if done(self):
                return self
            self.tick()
        raise AssertionError(f"not reached in {seconds} s: {self.flown}, {self.events}, {self.decisions}")

    def until_flies(self, skill: str) -> "Run":
        return self.until(lambda run: skill in run.flown[-1:])

    def until_over(self, seconds: int = 240) -> "Run":
        return self.until(lambda run: run.ending is not None, seconds)


def dispatches(actions: Sequence[Action]) -> list[Command]:
    """The dispatched commands."""
    return [action for action in actions if isinstance(action, Command)]


def assert_audited(run: Run) -> None:
    """Check that the closed log verifies with the root's key: each decision derives again, each dispatch is covered."""
    close = run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)
    found = audit([*run.lines, close], ROOT_KEY.public)
    agree(b"".join([*run.lines, close]), found, ROOT_KEY.public)
    report = found.report
    assert report.failure is None, report.failure
    assert report.shortfall is None


def assert_covered(run: Run) -> None:
    """Check that each command was sent after a record that covers it, and has one `sent` effect."""
    allowed: set[tuple[object, ...]] = set()
    lines = iter(run.lines[1:])
    tokens = []
    for action in run.actions:
        if isinstance(action, Append):
            record = json.loads(action.line)
            assert action.line == next(lines)
            if record["type"] == "decision" and record["outcome"] == "allow":
                allowed.add((record["kind"], record["step"], record["link"]))
            if record.get("event") == "dispatched":
                assert record["token"] == tokens[-1], "the effect follows its dispatch"
                key = (record["kind"], record["step"], record["link"])
                step_allowed = (0, record["step"], -1) in allowed
                any_allowed = any(kind == 0 for kind, _, _ in allowed)
                assert key in allowed or (record["kind"] == 1 and step_allowed) or (record["kind"] == 2 and any_allowed)
        elif isinstance(action, Command):
            tokens.append(action.token)
            assert allowed, "nothing is sent before a recorded decision"
    assert len(set(tokens)) == len(tokens)
    assert run.events.count("dispatched") == len(tokens)


def request_for(of: Loaded, kind: int = 0, step: int = 0, link: int = -1, **changed: object) -> bytes:
    """A request that an honest runtime would send on the ground (step 0) or in the air, but for what is `changed`."""
    invocations = of.bundle.mission.invocations
    invocation = invocations[min(max(step, 0), len(invocations) - 1)]
    height = invocations[1].plan.altitude if len(invocations) > 1 else 20 * M
    values = FakeVehicle().values | ({HEIGHT: height, POSITION_X: 110 * M, POSITION_Y: -20 * M} if step else {})
    honest = Request(
        kind,
        step,
        link,
        of.bundle.policy_digest if kind == CONTINGENCY_LINK else invocation.binding,
        START,
        State(tuple(values[slot] for slot in range(len(values))), (0,) * len(values)),
        START.monotonic_us,
        invocation.phase,
        20_000,
    )
    return encode(replace(honest, **changed))


def answer_to(of: Loaded, request: bytes) -> Decision | Status:
    """Return the answer of the boundary."""
    answer = read_answer(of, request, of.boundary.enforce(request))
    assert not isinstance(answer, Refusal)
    return answer


def read_answer(of: Loaded, request: bytes, answer: bytes) -> Decision | Status | Refusal:
    """Decode the answer to a request."""
    policy, steps = of.bundle.policy, of.invocations
    asked = decode_request(request, policy.slots, len(policy.monitors))
    known = not isinstance(asked, Refusal) and 0 <= asked.step < len(steps)
    return decode(answer, policy, steps[asked.step].invocation.contract if known else None)


def allowed(of: Loaded, kind: int = 0, step: int = 0, link: int = -1) -> bytes:
    """Return the permit for a request that must be allowed."""
    answer = answer_to(of, request_for(of, kind, step, link))
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.ALLOW, answer
    return answer.permit
