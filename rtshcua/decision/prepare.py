"""Check a policy and a mission once, at load, and compile them for many decisions.

The bundle may come from the wrong people or be damaged, so everything that deciding relies on is checked here; what is
malformed is refused with a value that names it. Signatures, digests and bindings are verified before, by `wire`.
"""

from rtshcua.decision.checks import mission as mission_checks
from rtshcua.decision.checks.policy import problems
from rtshcua.decision.contracts import Energy, longest, misfit
from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.prepared import (
    Compiler,
    Limit,
    PreparedAirspace,
    PreparedInvocation,
    PreparedMonitor,
    PreparedPolicy,
    RuleIndex,
)
from rtshcua.decision.tree import monitored, slots_read, where
from rtshcua.decision.values import point
from rtshcua.decision.volume import Planner, flown_at
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import MAX_DURATION, MAX_GAP, MAX_VALUE
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Airspace, Policy
from rtshcua.model.flat.signal import POSITION
from rtshcua.model.flat.zone import MAX_COORDINATE


def prepare(policy: Policy) -> PreparedPolicy | Refusal:
    """The policy, compiled, or what is wrong with it."""
    problem = next(problems(policy), None)
    if problem is not None:
        return Refusal("malformed", problem)
    compiler = Compiler(policy)
    return PreparedPolicy(
        policy=policy,
        compiler=compiler,
        tables=compiler.tables,
        limits=_limits(policy),
        rules=RuleIndex(policy.rules, compiler),
        airspace=None if policy.airspace is None else _airspace(policy.airspace, compiler),
        contingency=compiler.links(policy.contingency),
        still=Planner(MotionKind.HOLD, (), None, policy.vehicle.position_error),
        monitors=tuple(
            PreparedMonitor(monitor.kind, monitor.window_us, compiler.monitored(monitor, number))
            for number, monitor in enumerate(policy.monitors)
        ),
    )


def prepare_mission(mission: Mission, policy: PreparedPolicy) -> tuple[PreparedInvocation, ...] | Refusal:
    """The mission's invocations in order, compiled, or what is wrong with them."""
    problem = next(mission_checks.mission(mission, policy.policy), None)
    if problem is not None:
        return Refusal("malformed", problem)
    prepared: list[PreparedInvocation] = []
    for step, invocation in enumerate(mission.invocations):
        found = prepare_invocation(invocation, policy, mission.phases)
        if isinstance(found, Refusal):
            return Refusal("malformed", f"step {step}: {found.text}")
        prepared.append(found)
    return tuple(prepared)


def prepare_invocation(
    invocation: Invocation, policy: PreparedPolicy, phases: tuple[str, ...]
) -> PreparedInvocation | Refusal:
    """The invocation of a mission with these phases, compiled, or what is wrong with it. An argument out of range is
    for `decide` to refuse.
    """
    problem = next(mission_checks.invocation(invocation, policy.policy, policy.tables.zones), None)
    if problem is not None:
        return Refusal("malformed", problem)
    compiler, contract, plan = policy.compiler, invocation.contract, invocation.plan
    candidates = policy.rules.candidates(invocation.skill, invocation.role, invocation.source)
    clauses = [*contract.require, *contract.assume, *contract.maintain]
    clauses += [rule.rule.when for rules in candidates for rule in rules if rule.rule.when is not None]
    return PreparedInvocation(
        invocation=invocation,
        policy=policy,
        arguments=tuple(map(point, invocation.arguments)),
        misfit=misfit(invocation.arguments, contract),
        require=compiler.guards(contract.require, contract),
        assume=compiler.guards(contract.assume, contract),
        maintain=compiler.guards(contract.maintain, contract),
        chain=compiler.links(contract.fallback),
        candidates=candidates,
        planner=Planner(
            plan.kind,
            plan.path,
            flown_at(contract.motion, plan.altitude, policy.policy.vehicle),
            policy.policy.vehicle.position_error,
        ),
        energy=Energy(contract, policy.policy.vehicle),
        reads=tuple((slot, policy.limits[slot].stale_us) for slot in _reads(clauses, policy.policy)),
        phase=_phase(invocation, policy.policy, phases),
        rests_us=MAX_GAP if monitored(clauses) else MAX_DURATION,
        lasts_us=longest(contract, policy.policy.vehicle),
    )


def _airspace(airspace: Airspace, compiler: Compiler) -> PreparedAirspace:
    zones = compiler.tables.zones
    return PreparedAirspace(
        airspace, tuple(zones[zone] for zone in airspace.inside), tuple(zones[zone] for zone in airspace.outside)
    )


def _limits(policy: Policy) -> tuple[Limit, ...]:
    limits = [Limit(0, 0)] * policy.slots
    for signal in policy.signals:
        if signal.kind == POSITION:
            limits[signal.slot] = limits[signal.slot + 1] = Limit(signal.stale_us, MAX_COORDINATE)
        else:
            limits[signal.slot] = Limit(signal.stale_us, MAX_VALUE)
    return tuple(limits)


def _reads(clauses: list[Clause], policy: Policy) -> tuple[int, ...]:
    """The slots that a decision on these clauses may read: whatever it found there bounds how long it holds."""
    vehicle = policy.vehicle
    battery = () if vehicle.battery == -1 else (vehicle.battery,)
    return tuple(sorted({*slots_read(clauses, vehicle, policy.monitors), *where(vehicle), *battery}))


def _phase(invocation: Invocation, policy: Policy, phases: tuple[str, ...]) -> int:
    """The number of the invocation's phase among the policy's names. One that no condition names is as good as none."""
    name = phases[invocation.phase] if 0 <= invocation.phase < len(phases) else None
    return policy.phases.index(name) if name in policy.phases else NO_PHASE
