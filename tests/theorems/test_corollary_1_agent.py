"""Corollary 1: a compromised agent can only propose missions.

Statement. From theorem 1: of a mission that an agent signs with its own key, only steps fly that the policy permits to
agents, under the policy's contracts or tighter ones, on this vehicle. The agent cannot approve, recall, or replace
steps that a person ordered; a cancelled mission only flies the policy's contingency. Whatever the agent does at any
moment, the flight is completed or ended by a chain of the policy. The trust root binds the key to its source, roles and
policies; approvals are bound to a person, the mission and the flight.

Attacker: the agent, with the mission key that `keys init` makes for agents, and all documents that were ever signed. It
need not use our compiler.

Enforced by: `rtshcua/wire/trust.py`, `rtshcua/wire/bundle.py`, `rtshcua/decision/checks/mission.py`,
`rtshcua/decision/checks/contracts.py`, `rtshcua/decision/session.py`, and what enforces theorem 1.

Not covered: an agent may propose any mission that the policy permits to agents, however unwise, and as often as it
likes. Its assumptions about keys are stronger than those of the paper: with a mission key that is bound to nothing, the
corollary is false.
"""

from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.documents import MIN, approval, cancellation, hand, low_mission, recall, replacement
from reference.flat_case import BATTERY, HEIGHT, MISSION, POLICY, POSITION_X, POSITION_Y
from reference.naive_code import TooNear
from reference.oracle import Oracle
from reference.world import (
    FLIGHT,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    SESSION_KEY,
    START,
    VEHICLE,
    Run,
    answer_to,
    assert_audited,
    loaded,
    request_for,
)
from rtshcua.decision.checks import mission as mission_checks
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Invocation, Mission, OnInadmissible
from rtshcua.model.flat.situation import Context, State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.ports import Command, Ending
from rtshcua.wire import binding, bundle
from rtshcua.wire.document import DocumentError
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.receipt import CANCELLATION, REPLACEMENT, Receipt
from rtshcua.wire.receipt import decode as read_receipt
from rtshcua.wire.request import CONTINGENCY_LINK

AGENT_SEED = b"\xa9" * 32
AGENT = SigningKey.from_seed(AGENT_SEED, duty=Duty.MISSION, development=True)
#: the same secret, claimed for another duty: all that an agent can sign an approval with
AS_APPROVER = SigningKey.from_seed(AGENT_SEED, duty=Duty.APPROVAL, development=True)
BOUND = AGENT.verification(roles=("operator",), sources=("agent",), vehicles=(VEHICLE,), policies=(POLICY.name,))
TRUST = replace(ROOT, keys=(*ROOT.keys, BOUND))
LAX = {"require": (), "assume": (), "maintain": (), "energy": 0}


def opened(mission: Mission, key: SigningKey = AGENT) -> Loaded | Refusal:
    """The boundary's result for a mission that somebody signed under the policy."""
    payload = bundle.policy_payload(POLICY)
    bound = binding.bind(mission, bundle.policy_digest(payload))
    data = bundle.seal(payload, bundle.mission_payload(bound), policy_key=POLICY_KEY, mission_key=key)
    return load(
        data, root=TRUST, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE, session_key=SESSION_KEY,
        flight=FLIGHT,
        peer_is_own_simulator=True,
    )  # fmt: skip


def proposed(of: Random) -> Mission:
    """A mission of the agent, with arbitrary sources, roles, policies and contracts."""
    mission = of.choice([MISSION, low_mission()])
    steps = list(mission.invocations)
    for _ in range(of.choice([0, 1, 1, 2])):
        at = of.randrange(len(steps))
        steps[at] = twisted(of, steps[at])
    claims: dict[str, Any] = {"proposer": "operator"}
    if of.random() < 0.1:
        claims |= of.choice([{"policy": "lax"}, {"policy_version": 6}, {"vehicle": "quad-08"}])
    return replace(mission, invocations=tuple(steps), **claims)


def twisted(of: Random, step: Invocation) -> Invocation:
    """A step with a change in the agent's favour."""
    match of.randrange(6):
        case 0:
            return replace(step, source=of.choice([*SourceKind]))
        case 1:
            return replace(step, role=of.randrange(3))
        case 2:
            name = of.choice([*LAX])
            return replace(step, contract=replace(step.contract, **{name: LAX[name]}))
        case 3:
            return replace(step, contract=replace(step.contract, deadline_us=600_000_000, validity_us=1 << 40))
        case 4:
            other = worlds.invocation(of, POLICY)
            return replace(other, step=step.step, phase=step.phase, phases=step.phases)
        case _:
            return replace(step, arguments=worlds.arguments(of, step.skill))


def broken(of: Random) -> list[str]:
    """The violations of the corollary by one agent."""
    found = opened(proposed(of))
    if isinstance(found, Refusal):
        return []
    wrong = papers(of, found)
    for step in found.bundle.mission.invocations:
        if step.source != SourceKind.AGENT:
            wrong.append("it speaks as somebody else")
        state = told(of, step)
        answer = answer_to(found, request_for(found, step=step.step, state=state))
        if not isinstance(answer, Decision) or not answer.permit:
            break
        found.executor.ended()
        if isinstance(found.executor.dispatch(answer.permit, START.monotonic_us), Command):
            wrong += judged(found, step, state)
    return wrong


def told(of: Random, step: Invocation) -> State:
    """A nominal state, or one near a threshold."""
    values: dict[int, int | None] = {HEIGHT: 0, POSITION_X: 0, POSITION_Y: 0} if step.step == 0 else {}
    if of.random() < 0.3:
        slot = of.choice([*worlds.NEAR])
        values[slot] = of.choice(worlds.NEAR[slot])
    return flat.state(values)


def judged(found: Loaded, step: Invocation, state: State) -> list[str]:
    """Judge a dispatched command by the oracle, under the policy's own contract, with the rights of agents."""
    as_agent = replace(step, source=SourceKind.AGENT, contract=POLICY.contracts[step.skill])
    approvals = found.in_force.approvals(step, START)
    context = Context(step.binding, VEHICLE, POLICY.version, 0, START.monotonic_us, step.phase, 20_000, approvals)
    try:
        outcome, reason, _ = Oracle(POLICY, state, START).decide(as_agent, context)
    except TooNear:
        return []
    return [] if outcome is Outcome.ALLOW else [f"it did what agents may not: {reason}"]


def papers(of: Random, found: Loaded) -> list[str]:
    """Documents of the agent: approvals and recalls in another name, and a replacement of a person's steps."""
    step = of.randrange(len(found.bundle.mission.invocations))
    for paper in (approval(found, step, AS_APPROVER), recall(found, AS_APPROVER, expires_at_us=START.utc_us + MIN)):
        receipt = read_receipt(found.boundary.present(paper, START, 0))
        assert isinstance(receipt, Receipt)
        if receipt.accepted:
            return ["its word was taken for a person's"]
    return []


@pytest.mark.claim("C1")
@given(worlds.CHANCES)
def test_agent_cannot_do_what_policy_forbids(of: Random) -> None:
    assert broken(of) == []


@pytest.mark.claim("C1")
@pytest.mark.soak
@settings(max_examples=20_000)
@given(worlds.CHANCES)
def test_no_agent_strategy_does_forbidden_actions(of: Random) -> None:
    assert broken(of) == []


def test_agent_cannot_cancel_mission_of_a_person() -> None:
    """A person's mission, by a key for both, can be replaced and cancelled by that person and not by the agent."""
    ordered = replace(
        MISSION, invocations=tuple(replace(each, source=SourceKind.OPERATOR) for each in MISSION.invocations)
    )
    for key, accepted in ((AGENT, False), (MISSION_KEY, True)):
        found = opened(ordered, MISSION_KEY)
        assert isinstance(found, Loaded), found
        receipt = read_receipt(found.boundary.present(cancellation(found, key), START, 0))
        assert isinstance(receipt, Receipt)
        assert (receipt.kind, receipt.accepted) == (CANCELLATION, accepted), receipt
        found = opened(ordered, MISSION_KEY)
        assert isinstance(found, Loaded), found
        first, *_, last = found.bundle.mission.invocations
        source = SourceKind.AGENT if key is AGENT else SourceKind.OPERATOR
        shorter = replace(
            found.bundle.mission, issued_at_us=START.utc_us, invocations=(first, replace(last, step=1, source=source))
        )
        try:
            paper = replacement(found, 1, shorter, key)
        except DocumentError:
            assert not accepted
            continue
        receipt = read_receipt(found.boundary.present(paper, START, 1))
        assert isinstance(receipt, Receipt)
        assert (receipt.kind, receipt.accepted) == (REPLACEMENT, accepted), receipt


@pytest.mark.claim("C1")
@given(worlds.CHANCES)
def test_cancelled_mission_flies_only_contingency(of: Random) -> None:
    """For any proposal and any step: the links of the policy are decided as usual."""
    found = opened(proposed(of))
    if isinstance(found, Refusal):
        return
    for step in found.bundle.mission.invocations[: of.randrange(3)]:
        answer = answer_to(found, request_for(found, step=step.step))
        if isinstance(answer, Decision) and answer.permit:
            found.executor.ended()
            found.executor.dispatch(answer.permit, START.monotonic_us)
    receipt = read_receipt(found.boundary.present(cancellation(found, AGENT), START, 0))
    assert isinstance(receipt, Receipt)
    assert receipt.accepted, receipt
    for step in found.bundle.mission.invocations:
        assert not isinstance(answer_to(found, request_for(found, step=step.step)), Decision)
    links = [request_for(found, CONTINGENCY_LINK, -1, number) for number in range(len(POLICY.contingency))]
    allowed = [answer for answer in (answer_to(found, link) for link in links) if isinstance(answer, Decision)]
    assert len(allowed) == len(links)
    assert any(answer.permit for answer in allowed)


#: the allowed endings of a flight without a takeover or a fault
ENDS = {Ending.COMPLETED, Ending.ABORTED, Ending.CANCELLED, Ending.REFUSED}


def meddled(of: Random) -> Run:
    """A whole flight, in which steps are not always admitted, with arbitrary behaviour of the agent at any moment: it
    replaces, cancels, repeats documents, sends garbage, or is silent when a replacement is requested.
    """
    otherwise = [OnInadmissible.REPLAN, *OnInadmissible]
    steps = [replace(each, on_inadmissible=of.choice(otherwise)) for each in MISSION.invocations]
    run = Run(loaded(mission=replace(MISSION, invocations=tuple(steps))))
    handed: list[bytes] = []
    for _ in range(4_000):
        if run.ending is not None:
            return run
        run.tick()
        slot = of.choice([*worlds.NEAR])
        if of.random() < 0.05:
            run.vehicle.values[slot] = of.choice([*worlds.NEAR[slot], flat.state().values[slot]])
        if of.random() < 0.03 and run.ending is None:
            handed.append(paper_of(of, run.loaded, handed))
            hand(run, handed[-1])
    return run


def paper_of(of: Random, flying: Loaded, handed: list[bytes]) -> bytes:
    """Return a document that the agent of this flight signs or sends."""
    mission, kept = flying.bundle.mission, of.randrange(len(flying.bundle.mission.invocations))
    chance = of.random()
    if chance < 0.1:
        return cancellation(flying, MISSION_KEY)
    if chance < 0.3:
        return of.choice([*handed, of.randbytes(of.randrange(300))])
    steps = list(mission.invocations[:kept])
    for _ in range(of.randrange(3)):
        steps.append(replace(of.choice(mission.invocations[1:]), step=len(steps)))
    otherwise = of.choice([*OnInadmissible])
    steps.append(replace(mission.invocations[-1], step=len(steps), on_inadmissible=otherwise))
    other = replace(mission, issued_at_us=mission.issued_at_us + 1, invocations=tuple(steps))
    try:
        return replacement(flying, kept, other, MISSION_KEY)
    except DocumentError:
        return b""


def met_its_end(run: Run) -> list[str]:
    """Return the fault of a flight's ending, if any."""
    wrong = [] if run.ending in ENDS else [f"it ended as {run.ending}"]
    return [*wrong, "it was left in the air"] if run.vehicle.airborne else wrong


@pytest.mark.claim("C1")
@pytest.mark.slow
@given(worlds.CHANCES)
@settings(max_examples=20)
def test_flight_ends_by_policy_for_any_agent_behaviour(of: Random) -> None:
    run = meddled(of)
    assert met_its_end(run) == []
    assert_audited(run)


@pytest.mark.claim("C1")
@pytest.mark.soak
@settings(max_examples=2_000)
@given(worlds.CHANCES)
def test_flight_ends_by_policy_for_many_agents(of: Random) -> None:
    run = meddled(of)
    assert met_its_end(run) == []
    assert_audited(run)


def test_permitted_agent_mission_flies() -> None:
    """Otherwise there would be nothing to break."""
    found = opened(MISSION)
    assert isinstance(found, Loaded)
    for step in MISSION.invocations[:3]:
        answer = answer_to(found, request_for(found, step=step.step))
        assert isinstance(answer, Decision)
        found.executor.ended()
        assert isinstance(found.executor.dispatch(answer.permit, START.monotonic_us), Command)


def breaks(what: str, most: int = 400) -> bool:
    return any(what in each for seed in range(most) for each in broken(Random(seed)))


@pytest.mark.claim("C1", broken="a mission key that is not bound to its source, roles and policies")
def test_search_detects_unrestricted_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bundle, "check_proposer", lambda *_: None)
    assert breaks("it speaks as somebody else")


@pytest.mark.claim("C1", broken="contracts that a mission may loosen")
def test_search_detects_loosened_contract(monkeypatch: pytest.MonkeyPatch) -> None:
    first = MISSION.invocations[0]
    lax = replace(MISSION, invocations=(replace(first, contract=replace(first.contract, **LAX)),))
    assert isinstance(opened(lax), Refusal)
    monkeypatch.setattr(mission_checks, "invocation", lambda *_: iter(()))
    found = opened(lax)
    assert isinstance(found, Loaded)
    step, state = found.bundle.mission.invocations[0], flat.state({HEIGHT: 0, POSITION_X: 0, POSITION_Y: 0, BATTERY: 0})
    answer = answer_to(found, request_for(found, state=state))
    assert isinstance(answer, Decision)
    assert judged(found, step, state) != [], "it would fly, on an empty battery"


@pytest.mark.claim("C1", broken="an agent that is trusted for approvals")
def test_search_detects_approval_by_anybody(monkeypatch: pytest.MonkeyPatch) -> None:
    named = AS_APPROVER.verification(roles=("supervisor",), sources=("operator",), vehicles=(VEHICLE,), person="agent")
    monkeypatch.setitem(globals(), "TRUST", replace(TRUST, keys=(*TRUST.keys, named)))
    assert breaks("its word was taken for a person's", 5)
