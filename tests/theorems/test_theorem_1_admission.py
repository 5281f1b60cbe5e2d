"""Theorem 1: no dispatch without admission.

Statement. Let the executor be the only way to the vehicle (assumption 1) and `enforce` the only source of permits
(assumption 2), both behind a boundary that shares no key with anyone (assumption 4). Then each step that is dispatched
was admissible when its permit was made: valid_T and valid_S and L_rem <= ddl - t, with authority, and an approval where
a rule asks for one. It is the command that was signed, sent once, within its deadline and validity, and not after a
recall or a cancellation.

Attacker: a compromised runtime. It makes arbitrary requests, in any order, with any state, time, release and phase. It
keeps and alters every permit. It presents documents signed by people or strangers, damaged ones, and replays. It holds
no key.

Enforced by: `rtshcua/decision/decide.py`, `rtshcua/decision/session.py`, `rtshcua/onboard/enforcement/boundary.py`,
`rtshcua/onboard/enforcement/executor.py`, `rtshcua/wire/permit.py`, and in C `boundary/decision`,
`boundary/enforcement`.

Not covered: claims of the runtime about the state are accepted (the stated limit): the theorem speaks of the state in
the request. In mode `none` it is false by design.

Admission is compared with `reference.oracle`, which is independent of `decide`.
"""

from random import Random

import pytest
from hypothesis import given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.documents import MIN, approval, cancellation, low_mission, recall, replacement
from reference.flat_case import (
    BATTERY,
    HEIGHT,
    NOMINAL,
    OBSTACLE,
    POSITION_X,
    POSITION_Y,
    SLOTS,
    WIND,
    M,
    S,
    apply,
    clause,
    const,
    signal,
)
from reference.naive_code import TooNear
from reference.oracle import Oracle
from reference.world import APPROVAL_KEY, START, VEHICLE, loaded, renewed
from rtshcua.decision import decide
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import Sets
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.why.trace import NAMES
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.flat.situation import Context, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement import executor as executors
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.ports import Command
from rtshcua.wire import permit as permits
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.permit import Permit
from rtshcua.wire.receipt import APPROVAL, CANCELLATION, RECALL, Receipt
from rtshcua.wire.receipt import decode as read_receipt
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Request, encode
from rtshcua.wire.response import decode

WINDY = clause("wind.speed > 15 m/s", apply(Op.GT, signal(WIND), const(15 * M)))
POLICY = replace(flat.POLICY, rules=(*flat.POLICY.rules, flat.rule(RuleKind.FORBID, when=WINDY)))
OF, UNENFORCED = (loaded(POLICY, low_mission(), mode) for mode in (EnforcementMode.SOFTWARE, EnforcementMode.NONE))
STRANGER = SigningKey.from_seed(bytes([99]) * 32, duty=Duty.APPROVAL, development=True)
ACTS = ("ask", "ask", "ask", "send", "send", "stand in", "ended", "sign", "again", "wait", "fly", "fly", "fly")
#: us before the end of a deadline or validity; values become stale later than that
SHORTLY_US = 100_000
STRANGE = {BATTERY: 1_000, WIND: 20 * M, OBSTACLE: None, HEIGHT: 130 * M, POSITION_X: 600 * M}


class TakenOver:
    """A runtime controlled by an attacker, and a notary who knows what was admissible. `broken` lists the violations
    of the theorem.
    """

    def __init__(self, of: Random, template: Loaded = OF) -> None:
        self.of, self.loaded, self.now = of, renewed(template), START
        self.permits: list[bytes] = []
        self.papers: list[bytes] = []
        self.step = 0  # where an honest runtime would be
        self.admitted: dict[bytes, tuple[Invocation, int]] = {}  # by permit: what, and until when at most
        self.sent: set[bytes] = set()
        self.confirmed: set[bytes] = set()
        self.recalled = False
        self.broken: list[str] = []

    def go(self, acts: int) -> list[str]:
        for _ in range(acts):
            match self.of.choice(ACTS):
                case "ask":
                    self.ask()
                case "send":
                    self.send()
                case "stand in":
                    self.stand_in()
                case "ended":
                    self.loaded.executor.ended()
                case "sign":
                    self.hand(self.signed())
                case "again" if self.papers:
                    self.hand(self.of.choice(self.papers))
                case "wait":
                    self.wait(self.of.choice([50_000, S, 11 * S, 11 * MIN]))
                case "fly":
                    self.fly()
        return self.broken

    # ------------------------------------------------------------------------------------------------ actions

    def wait(self, us: int) -> None:
        """Let the time pass."""
        self.now = replace(self.now, monotonic_us=self.now.monotonic_us + us, utc_us=self.now.utc_us + us)

    def fly(self) -> None:
        """The actions of an honest runtime, to reach the rest of the mission; one in four requests has a single fault,
        so that nothing but the check of that can refuse it.
        """
        steps = self.loaded.bundle.mission.invocations
        if self.step >= len(steps):
            return
        meant, late = steps[self.step], self.of.random()  # it asks just before an end, and sends just after it:
        overdue, outdated = late < 0.2, late > 0.95  # of the deadline, or of the validity
        ready_us = meant.contract.deadline_us - SHORTLY_US
        if overdue:  # nothing is released before it was received
            self.wait(max(self.loaded.in_force.received_us(meant.step) + ready_us - self.now.monotonic_us, 0))
        if outdated:
            over_us = meant.issued_at_us + meant.contract.validity_us - self.now.utc_us - self.now.utc_error_us
            self.wait(max(over_us - SHORTLY_US, 0))
        at = self.now.monotonic_us
        state = self.told(meant, strange=0.25)
        released_us = at - ready_us if overdue else at
        asked = Request(STEP, meant.step, -1, meant.binding, self.now, state, released_us, meant.phase, 5_000)
        self.enforce(self.spoiled(asked) if self.of.random() < 0.25 else asked, meant)
        if self.permits and self.permits[-1] in self.admitted and self.admitted[self.permits[-1]][0] is meant:
            self.loaded.executor.ended()
            if overdue or outdated:
                self.wait(2 * SHORTLY_US)
            self.send(self.permits[-1])
            self.loaded.executor.ended()
            self.step += 1

    def spoiled(self, asked: Request) -> Request:
        """A request with a single fault."""
        match self.of.randrange(4):
            case 0:
                return replace(asked, binding=asked.binding[:-1] + bytes([asked.binding[-1] ^ 1]))
            case 1:
                return replace(asked, phase=(asked.phase + self.of.choice([1, 2])) % 3)
            case 2:
                return replace(asked, released_us=max(asked.released_us + self.of.choice([-9, 9]) * S, 0))
            case _:
                return replace(asked, remaining_us=20 * S)

    def ask(self) -> None:
        of, steps = self.of, self.loaded.bundle.mission.invocations
        kind = of.choice([STEP] * 6 + [FALLBACK_LINK, CONTINGENCY_LINK])
        step = of.choice([min(self.step, len(steps) - 1)] * 4 + [0, 1, 2, 3, of.randrange(-1, 6)])
        step = -1 if kind == CONTINGENCY_LINK else step
        link = -1 if kind == STEP else of.randrange(-1, 3)
        meant = steps[min(max(step, 0), len(steps) - 1)]
        binding = self.loaded.bundle.policy_digest if kind == CONTINGENCY_LINK else meant.binding
        if of.random() < 0.1:
            binding = of.choice([bytes(32), of.choice(steps).binding])
        at = self.now.monotonic_us
        released = max(of.choice([at, at, at - S, at - 9 * S]), 0)
        phase = of.choice([meant.phase] * 8 + [0, 1, 2])
        state = self.told(meant)
        asked = Request(kind, step, link, binding, self.now, state, released, phase, of.choice([5_000, 20_000, 20 * S]))
        self.enforce(asked, meant)

    def enforce(self, asked: Request, meant: Invocation) -> None:
        answer = decode(self.loaded.boundary.enforce(encode(asked)), self.loaded.bundle.policy, meant.contract)
        if isinstance(answer, Decision) and answer.permit:
            self.permits.append(answer.permit)
            if asked.kind == STEP:
                self.judge(asked, meant, answer.permit)

    def told(self, meant: Invocation, strange: float = 0.3) -> State:
        """A state: nominal, near a threshold, or with missing values."""
        values = dict(NOMINAL)
        if meant.step == 0:
            values |= {HEIGHT: 0, POSITION_X: 0, POSITION_Y: 0}
        else:
            values |= {HEIGHT: 8 * M}
        if self.of.random() < strange:
            slot = self.of.choice([*STRANGE, WIND, WIND, OBSTACLE])
            values[slot] = STRANGE[slot]
        return State(tuple(values[slot] for slot in range(SLOTS)), (10_000,) * SLOTS)

    def send(self, permit: bytes = b"") -> None:
        if not self.permits:
            return
        chosen = permit or self.of.choice(self.permits)
        if not permit and self.of.random() < 0.2:
            at = self.of.randrange(8 * len(chosen))
            chosen = chosen[: at // 8] + bytes([chosen[at // 8] ^ 1 << at % 8]) + chosen[at // 8 + 1 :]
        try:
            found = self.loaded.executor.dispatch(chosen, self.now.monotonic_us)
        except LookupError:  # accepted, without an effect
            self.hold(False, "a permit that nobody made")
        else:
            if isinstance(found, Command):
                self.witness(found, chosen)

    def stand_in(self) -> None:
        if not self.permits:
            return
        permit, kind = self.of.choice(self.permits), self.of.choice([FALLBACK_LINK, CONTINGENCY_LINK])
        found = self.loaded.executor.stand_in(permit, kind, self.of.randrange(-1, 4), self.now.monotonic_us)
        if isinstance(found, Command):
            self.hold(permit in self.sent, "a link stood in for a step that never flew")

    def signed(self) -> bytes:
        """A document signed by people, or by strangers."""
        of, now, steps = self.of, self.now, len(self.loaded.bundle.mission.invocations)
        match of.randrange(8):
            case 0:
                called_off = of.choice([recall, cancellation])
                return called_off(self.loaded, now=now, expires_at_us=now.utc_us + MIN) if of.random() < 0.5 else b""
            case 1:
                kept = min(2, steps - 1)
                return replacement(self.loaded, kept) if steps == 4 and of.random() < 0.3 else b""
            case 2:
                return approval(self.loaded, of.randrange(steps), STRANGER, now)
            case 3:
                paper = bytearray(approval(self.loaded, of.randrange(steps), APPROVAL_KEY, now))
                paper[of.randrange(len(paper))] ^= 1
                return bytes(paper)
            case 4:
                return approval(self.loaded, of.randrange(steps), APPROVAL_KEY, now, granted=0)
            case _:
                return approval(self.loaded, min(2, steps - 1), APPROVAL_KEY, now)

    def hand(self, paper: bytes) -> None:
        self.papers.append(paper)
        before = self.loaded.bundle.mission.invocations
        receipt = read_receipt(self.loaded.boundary.present(paper, self.now, self.step))
        assert isinstance(receipt, Receipt)
        if receipt.accepted and receipt.kind == APPROVAL and receipt.granted:
            self.confirmed.add(before[receipt.step].invocation_id)
        self.recalled = self.recalled or (receipt.accepted and receipt.kind in (RECALL, CANCELLATION))

    # ------------------------------------------------------------------------------------------- properties

    def judge(self, asked: Request, meant: Invocation, permit: bytes) -> None:
        """A permit was made for a step: check that it was admissible."""
        approvals = self.loaded.in_force.approvals(meant, asked.now)
        context = Context(asked.binding, VEHICLE, 7, 0, asked.released_us, asked.phase, asked.remaining_us, approvals)
        try:
            outcome, reason, _ = Oracle(self.loaded.bundle.policy, asked.state, asked.now).decide(meant, context)
        except TooNear:
            return
        self.hold(outcome is Outcome.ALLOW, f"a permit for what is inadmissible: {reason}")
        again = any(known.invocation_id == meant.invocation_id for known, _ in self.admitted.values())
        self.hold(not again, "an id was admitted twice")
        due = max([asked.released_us, *(each.monotonic_us for each in approvals)]) + meant.contract.deadline_us
        valid = asked.now.monotonic_us + meant.issued_at_us + meant.contract.validity_us - asked.now.utc_us
        self.admitted[permit] = meant, min(due, valid)

    def witness(self, command: Command, permit: bytes) -> None:
        """Check a dispatched command."""
        self.hold(permit in self.permits, "a permit that nobody made")
        self.hold(permit not in self.sent, "a permit was used twice")
        self.sent.add(permit)
        if permit not in self.admitted:
            return
        meant, until_us = self.admitted[permit]
        told = (command.skill, command.kind, command.path, command.altitude, command.speed)
        plan = meant.plan
        signed = (meant.contract.name, plan.kind, plan.path, plan.altitude, plan.speed)
        self.hold(told == signed, "another command than the one that was signed")
        self.hold(self.now.monotonic_us <= until_us, "sent after its deadline or validity")
        self.hold(not self.recalled, "a step was sent after a recall or a cancellation")
        self.hold(meant.step != 2 or plan.altitude != 8 * M or meant.invocation_id in self.confirmed, "unconfirmed")

    def hold(self, truth: bool, what: str) -> None:
        if not truth:
            self.broken.append(what)


@pytest.mark.claim("T1")
@settings(max_examples=settings().max_examples * 5)
@given(worlds.CHANCES)
def test_no_history_dispatches_unadmitted_step(of: Random) -> None:
    assert TakenOver(of).go(40) == []


@pytest.mark.claim("T1")
@pytest.mark.soak
@settings(max_examples=20_000)
@given(worlds.CHANCES)
def test_no_longer_history_dispatches_unadmitted_step(of: Random) -> None:
    assert TakenOver(of).go(120) == []


def breaks(what: str = "", template: Loaded = OF, most: int = 300) -> bool:
    """Whether some history violates the theorem in a given way."""
    return any(what in each for seed in range(most) for each in TakenOver(Random(seed), template).go(60))


def test_histories_reach_all_cases_of_theorem() -> None:
    """Steps are sent, including a confirmed one, and some mission is recalled; otherwise there would be nothing to
    break.
    """
    reached: set[object] = set()
    for seed in range(300):
        history = TakenOver(Random(seed))
        history.go(60)
        reached |= {history.admitted[permit][0].step for permit in history.sent & history.admitted.keys()}
        reached |= {"recalled"} if history.recalled else set()
        if {0, 1, 2, 3, "recalled"} <= reached:
            return
    raise AssertionError(reached)


@pytest.mark.claim("T1", broken="mode `none`, which enforces nothing")
def test_theorem_fails_without_enforcement() -> None:
    assert breaks("a permit for what is inadmissible", UNENFORCED)


@pytest.mark.claim("T1", broken="a decision without any one of its steps")
@pytest.mark.slow
@pytest.mark.altered
@pytest.mark.parametrize("step", [name for _, name in NAMES])
def test_search_detects_decision_without_a_step(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decide, step, lambda *_: decide.PASSED)
    assert breaks("a permit for what is inadmissible")


@pytest.mark.claim("T1", broken="an executor that checks no MAC of a permit")
def test_search_detects_executor_without_mac(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permits, "compare_digest", lambda _, __: True)
    assert breaks("a permit that nobody made")


@pytest.mark.claim("T1", broken="an executor that sends late")
def test_search_detects_executor_without_time_check(monkeypatch: pytest.MonkeyPatch) -> None:
    dispatch = executors.Executor._dispatch

    def whenever(self: executors.Executor, permit: Permit, now_us: int) -> Command | Refusal:
        return dispatch(self, permit, min(now_us, permit.not_after_us))

    monkeypatch.setattr(executors.Executor, "_dispatch", whenever)
    assert breaks("sent after its deadline or validity")


@pytest.mark.claim("T1", broken="permits whose deadline counts from the decision, not from the release")
@pytest.mark.altered
def test_search_detects_deadline_from_decision(monkeypatch: pytest.MonkeyPatch) -> None:
    until = decide.valid_until

    def from_now(invocation: PreparedInvocation, state: State, context: Context, sets: Sets, at: Environment) -> int:
        return until(invocation, state, replace(context, released_us=sets.monotonic_us[0]), sets, at)

    monkeypatch.setattr(decide, "valid_until", from_now)
    assert breaks("sent after its deadline or validity")
