"""Assumption 2: pre-dispatch enforcement. Only a decision makes a permit.

Statement. Every permit leaves `enforce`, in the answer to a request that it decided as `allow`; no other answer,
receipt or refusal contains one. `allow` is decided for a step only if the published predicate holds for the state, the
time and the context of the request (with authority, and approvals where a rule asks for them), and for a link only if
it may fly then. The executor dispatches nothing but these octets.

Attacker: a compromised runtime, under any policy: it makes arbitrary requests, for steps and links, in any order, with
any state, time, release, phase, binding and latency, and hands in malformed octets and documents.

Enforced by: `rtshcua/onboard/enforcement/boundary.py`, `rtshcua/decision/decide.py`, `rtshcua/decision/session.py`,
`rtshcua/decision/fallbacks.py`, `rtshcua/wire/permit.py`, `boundary/decision/decide.c`,
`boundary/enforcement/boundary.c`.

Not covered: the state in a request is the runtime's word (the stated limit). In mode `none` the assumption is false by
design: a step's permit is issued whatever was decided; the mode flies simulated vehicles only. Expired missions and
missing approvals are rare under random policies: theorem 1 attacks them under one of its own.

Decisions are compared with `reference.oracle`, which is independent of `decide`; policies and missions are random.
"""

from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.documents import approval, cancellation, recall
from reference.naive_code import TooNear
from reference.oracle import Oracle
from reference.world import ROOT, SESSION_KEY, START, VEHICLE, read_answer, sealed
from rtshcua.decision import decide, session
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Context, Now
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command
from rtshcua.wire.permit import SIZE, open_permit
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Request, encode

STEPS = 4


def opened(of: Random, mode: EnforcementMode) -> Loaded:
    """A random mission under a random policy, in force; arguments and plans are those of the language."""
    while True:
        policy = worlds.policy(of)
        steps = [worlds.invocation(of, policy) for _ in range(STEPS)]
        mission = replace(flat.MISSION, invocations=tuple(
            replace(each, step=number, invocation_id=bytes([number]) * 16, phase=1)
            for number, each in enumerate(steps)
        ))  # fmt: skip
        found = load(
            sealed(policy, mission), root=ROOT, vehicle=VEHICLE, now=START, mode=mode, session_key=SESSION_KEY,
            flight=bytes(16), peer_is_own_simulator=True,
        )  # fmt: skip
        if isinstance(found, Loaded):
            return found


class Requests:
    """The requests of an attacker, and a notary who knows what was admissible. `broken` lists the violations."""

    def __init__(self, of: Random, mode: EnforcementMode = EnforcementMode.SOFTWARE) -> None:
        self.of, self.loaded, self.now = of, opened(of, mode), START
        self.issued: set[bytes] = set()
        self.used: set[int] = set()
        self.step = 0
        self.allowed = {STEP: 0, FALLBACK_LINK: 0, CONTINGENCY_LINK: 0}
        self.broken: list[str] = []

    def go(self, acts: int) -> list[str]:
        for _ in range(acts):
            match self.of.randrange(12):
                case 0:
                    self.nonsense()
                case 1:
                    self.hand()
                case 2:
                    self.send(self.of.randbytes(SIZE))
                case 3 if self.issued:
                    self.send(self.of.choice([*self.issued]))
                case 4:
                    us = self.of.choice([1_000, 50_000, flat.S])
                    self.now = Now(self.now.monotonic_us + us, self.now.utc_us + us, self.of.choice([0, 20_000]))
                case _:
                    self.ask()
        return self.broken

    # ------------------------------------------------------------------------------------------------ actions

    def ask(self) -> None:
        of, steps = self.of, self.loaded.bundle.mission.invocations
        kind = of.choice((STEP,) * 4 + (FALLBACK_LINK, CONTINGENCY_LINK))
        step = of.choice((self.step,) * 6 + tuple(range(STEPS)))
        link = -1 if kind == STEP else of.randrange(-1, 3)
        step = -1 if kind == CONTINGENCY_LINK else step
        meant = steps[step]
        binding = self.loaded.bundle.policy_digest if kind == CONTINGENCY_LINK else meant.binding
        state = worlds.state(of, monitors := len(self.loaded.bundle.policy.monitors))
        if of.random() < 0.5:
            state = replace(flat.state(), monitors=(1,) * monitors)
        asked = Request(
            kind, step, link, of.choice((binding,) * 8 + (bytes(32), steps[0].binding)), self.now,
            replace(state, ages=tuple(max(age, 0) for age in state.ages)),
            max(self.now.monotonic_us - of.choice((0,) * 20 + (flat.S, 3 * flat.S)), 0),
            of.choice((1,) * 20 + (0, 2)), of.choice((5_000,) * 20 + (3 * flat.S,)),
        )  # fmt: skip
        before = self.context_of(asked) if kind == STEP else None
        octets = encode(asked)
        answer = self.loaded.boundary.enforce(octets)
        found = read_answer(self.loaded, octets, answer)
        if not isinstance(found, Decision) or not found.permit:
            self.hold(not holds_permit(answer), "a permit outside of a decision")
            self.hold(
                not isinstance(found, Decision) or found.outcome is not Outcome.ALLOW, "an allow without a permit"
            )
            if isinstance(found, Decision) and kind == STEP and self.of.random() < 0.3:
                self.step = min(self.step + found.consumed, STEPS - 1)
            return
        self.hold(found.outcome is Outcome.ALLOW, "a permit without an allow")
        self.issued.add(found.permit)
        self.allowed[kind] += 1
        self.hold(self.admissible(asked, before), "a permit for what is inadmissible")
        if kind == STEP:
            self.hold(step not in self.used, "an id was allowed twice")
            self.used.add(step)
            self.step = min(step + 1, STEPS - 1)
            self.loaded.executor.ended()
            if self.of.random() < 0.8:
                self.send(found.permit)

    def context_of(self, asked: Request) -> Context:
        """The context of a request for a step, before it is decided."""
        meant = self.loaded.bundle.mission.invocations[asked.step]
        approvals = self.loaded.in_force.approvals(meant, asked.now)
        return Context(
            asked.binding, VEHICLE, self.loaded.bundle.policy.version, 0, asked.released_us, asked.phase,
            asked.remaining_us, approvals,
        )  # fmt: skip

    def nonsense(self) -> None:
        """Malformed octets, among them permits in place of requests."""
        octets = self.of.choice((self.of.randbytes(self.of.randrange(300)), *[*self.issued][-1:]))
        self.hold(not holds_permit(self.loaded.boundary.enforce(octets)), "a permit outside of a decision")

    def hand(self) -> None:
        """Documents, good ones, late ones and no documents."""
        of = self.of
        made: Any = of.choice((approval, approval, approval, recall, cancellation))
        changed: dict[str, Any] = {"step": of.randrange(STEPS)} if made is approval else {}
        rare = made is not approval and of.random() < 0.8
        document = b"no document" if rare else made(self.loaded, now=self.now, **changed)
        answer = self.loaded.boundary.present(document, self.now, self.step)
        self.hold(not holds_permit(answer), "a permit outside of a decision")

    def send(self, octets: bytes) -> None:
        try:
            found = self.loaded.executor.dispatch(octets, self.now.monotonic_us)
        except LookupError:  # accepted, without an effect
            self.hold(False, "a permit that nobody issued")
        else:
            self.hold(not isinstance(found, Command) or octets in self.issued, "a permit that nobody issued")

    # ------------------------------------------------------------------------------------------- properties

    def admissible(self, asked: Request, context: Context | None) -> bool:
        """Whether a naive reading of the design admits what was asked for; true where it is too near to call."""
        policy, steps = self.loaded.bundle.policy, self.loaded.bundle.mission.invocations
        oracle = Oracle(policy, asked.state, asked.now)
        try:
            if context is not None:
                return oracle.decide(steps[asked.step], context)[0] is Outcome.ALLOW
            if asked.kind == CONTINGENCY_LINK:
                return asked.binding == self.loaded.bundle.policy_digest and oracle.may_fly(
                    policy.contingency[asked.link]
                )
            meant = steps[asked.step]
            if asked.binding != meant.binding:
                return False
            if asked.link == DEGRADE:
                target = oracle.target(meant)
                return target is not None and target[0] == DEGRADE
            oracle.enter(meant)
            return oracle.may_fly(meant.contract.fallback[asked.link])
        except TooNear:
            return True

    def hold(self, truth: bool, what: str) -> None:
        if not truth:
            self.broken.append(what)


def holds_permit(octets: bytes) -> bool:
    """Whether a permit of the session is anywhere in these octets."""
    return any(open_permit(octets[at : at + SIZE], SESSION_KEY) for at in range(len(octets) - SIZE + 1))


@pytest.mark.claim("A2")
@given(worlds.CHANCES)
def test_no_request_gets_a_permit_without_a_decision(of: Random) -> None:
    assert Requests(of).go(60) == []


@pytest.mark.soak
@pytest.mark.claim("A2")
@settings(max_examples=10_000)
@given(worlds.CHANCES)
def test_no_longer_history_gets_a_permit_without_a_decision(of: Random) -> None:
    assert Requests(of).go(200) == []


def test_histories_get_permits_of_all_kinds() -> None:
    """Otherwise there would be nothing to break."""
    allowed = {STEP: 0, FALLBACK_LINK: 0, CONTINGENCY_LINK: 0}
    for seed in range(15):
        made = Requests(Random(seed))
        made.go(60)
        allowed = {kind: number + made.allowed[kind] for kind, number in allowed.items()}
    assert min(allowed.values()) > 2, allowed


def breaks(what: str, mode: EnforcementMode = EnforcementMode.SOFTWARE, most: int = 150) -> bool:
    """Whether some history violates the assumption in this way."""
    return any(what in Requests(Random(seed), mode).go(60) for seed in range(most))


@pytest.mark.claim("A2", broken="mode `none`, which issues a step's permit whatever was decided")
def test_search_detects_mode_none() -> None:
    assert breaks("a permit without an allow", EnforcementMode.NONE)


@pytest.mark.altered
@pytest.mark.claim("A2", broken="a decision that does not look at the state")
def test_search_detects_decision_without_state(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decide, "state", lambda *_: decide.PASSED)
    assert breaks("a permit for what is inadmissible")


@pytest.mark.altered
@pytest.mark.slow
@pytest.mark.claim("A2", broken="a decision without its step integrity, authority, phase, timing or safety")
@pytest.mark.parametrize("step", ["integrity", "authority", "phase", "timing", "safety"])
def test_search_detects_decision_without_a_step(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decide, step, lambda *_: decide.PASSED)
    assert breaks("a permit for what is inadmissible")


@pytest.mark.altered
@pytest.mark.claim("A2", broken="a session that forgets which ids were used")
def test_search_detects_session_without_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session.Session, "consumed", lambda *_: 0)
    assert breaks("an id was allowed twice")


@pytest.mark.altered
@pytest.mark.claim("A2", broken="links that fly in any state")
def test_search_detects_links_without_conditions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "link_admissible", lambda *_: True)
    assert breaks("a permit for what is inadmissible")
