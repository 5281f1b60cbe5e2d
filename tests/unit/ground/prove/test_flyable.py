"""Compiled missions can fly: in good conditions, each step is allowed where the step before it ends."""

from itertools import pairwise
from pathlib import Path

import pytest

from rtshcua.decision.decide import decide
from rtshcua.decision.fallbacks import link_admissible
from rtshcua.decision.prepare import PreparedPolicy, prepare, prepare_mission
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import ConfirmAnswer, Context, Now, State
from rtshcua.model.outcome import Outcome
from rtshcua.wire.binding import bind

CHECKOUT = Path(__file__).resolve().parents[4]
MISSIONS = sorted(path.stem for path in (CHECKOUT / "missions").glob("*.rts"))
AT = 1_700_000_000_000_000
GOOD = {"battery": 9_500, "wind.speed": 1_000, "link.quality": 9_000, "obstacle.distance": 50_000, "gps.fix": 3}
GOOD |= {"battery.cell": 3_900, "velocity.north": 0, "velocity.east": 0}


def flat(name: str) -> tuple[Policy, Mission]:
    program = load([str(CHECKOUT / "missions" / f"{name}.rts")], lambda path: Path(path).read_bytes(), str(CHECKOUT))
    compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=AT)
    assert compiled.policy is not None
    assert compiled.mission is not None
    return compiled.policy, bind(compiled.mission, bytes(32))


def flown(policy: Policy, mission: Mission, conditions: dict[str, int], *, drained: bool = False) -> list[Decision]:
    """Return the decision on each step with the vehicle at the planned end of the step before it.

    With `drained`, each earlier step has used its whole energy.
    """
    prepared = prepare(policy)
    assert isinstance(prepared, PreparedPolicy), prepared
    steps = prepare_mission(mission, prepared)
    approvals = tuple(
        ConfirmAnswer(n, rule.approver, 1, 0) for n, rule in enumerate(policy.rules) if rule.approver >= 0
    )
    x, y, height = 0, 0, 0
    decisions: list[Decision] = []
    for step in steps:
        invocation = step.invocation
        values: list[int | None] = [None] * policy.slots
        for signal in policy.signals:
            values[signal.slot] = conditions.get(signal.name)
            if signal.name == "landed":
                values[signal.slot] = 2 if height else 1
        values[policy.vehicle.position : policy.vehicle.position + 2] = [x, y]
        values[policy.vehicle.height] = height
        state = State(tuple(values), (0,) * policy.slots)
        context = Context(
            invocation.binding, policy.vehicle.identity, policy.version, 0, 0, invocation.phase, 1_000, approvals
        )
        decisions.append(decide(step, state, prepared, context, Now(0, AT + 1, 0)))
        if drained:
            conditions = {**conditions, "battery": conditions["battery"] - invocation.contract.energy}
        plan = invocation.plan
        if plan.path:
            x, y = plan.path[-2:]
        if plan.kind != MotionKind.HOLD:
            height = plan.altitude
    return decisions


@pytest.mark.parametrize("name", MISSIONS)
def test_every_step_is_allowed_in_good_conditions(name: str) -> None:
    policy, mission = flat(name)
    decisions = flown(policy, mission, GOOD)
    assert [(each.outcome, each.reason) for each in decisions if each.outcome is not Outcome.ALLOW] == []


@pytest.mark.parametrize("name", MISSIONS)
def test_every_step_is_allowed_with_the_least_proved_charge(name: str) -> None:
    policy, mission = flat(name)
    decisions = flown(policy, mission, {**GOOD, "battery": FULL}, drained=True)
    assert {each.outcome for each in decisions} == {Outcome.ALLOW}


@pytest.mark.parametrize("name", MISSIONS)
def test_low_battery_ends_every_step_in_a_proved_link(name: str) -> None:
    policy, mission = flat(name)
    for decision in flown(policy, mission, {**GOOD, "battery": 2_000}):
        assert decision.outcome in (Outcome.FALLBACK, Outcome.ALLOW)
        if decision.outcome is Outcome.FALLBACK:
            assert decision.target is not None
            assert policy.contracts[decision.target.skill].name == "return_home"


@pytest.mark.parametrize("name", MISSIONS)
def test_return_is_allowed_from_everywhere_on_the_path(name: str) -> None:
    policy, mission = flat(name)
    prepared = prepare(policy)
    assert isinstance(prepared, PreparedPolicy), prepared
    x, y, height = 0, 0, 0
    for step in prepare_mission(mission, prepared):
        plan = step.invocation.plan
        points = [(x, y), *zip(plan.path[::2], plan.path[1::2], strict=True)]
        low, high = sorted((height, height if plan.kind == MotionKind.HOLD else plan.altitude))
        homes = [link for link in (*step.chain, *prepared.contingency) if link.motion == MotionKind.HOME]
        for (ax, ay), (bx, by) in pairwise([*points, points[-1]]):
            for part in range(5):
                values: list[int | None] = [None] * policy.slots
                for signal in policy.signals:
                    values[signal.slot] = GOOD.get(signal.name)
                place = [ax + (bx - ax) * part // 4, ay + (by - ay) * part // 4]
                values[policy.vehicle.position : policy.vehicle.position + 2] = place
                values[policy.vehicle.height] = low + (high - low) * part // 4
                state = State(tuple(values), (0,) * policy.slots)
                assert all(link_admissible(link, state, prepared, Now(0, AT + 1, 0)) for link in homes), place
        x, y = points[-1]
        height = height if plan.kind == MotionKind.HOLD else plan.altitude
