"""Run all proofs in order: those of a policy, and those of a mission, which follow the vehicle from step to step."""

from collections.abc import Sequence
from functools import lru_cache
from itertools import compress

from rtshcua.decision.flying import slower
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, at_slowest, paths_fit, prepare
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.solve import Questions
from rtshcua.ground.analysis.space import signals
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.prove.contradiction import prove_contracts, prove_step_contract
from rtshcua.ground.prove.deferral import prove_deferrals, prove_observation_time, prove_step_deferral
from rtshcua.ground.prove.fallback_chains import prove_landing_height, prove_last_links, prove_links
from rtshcua.ground.prove.fallback_ways import FallbackWays
from rtshcua.ground.prove.issue_times import prove_known_issue, prove_some_issue
from rtshcua.ground.prove.mission_bounds import prove_charge
from rtshcua.ground.prove.observability import prove_observability, prove_step_observability
from rtshcua.ground.prove.parameter_ranges import prove_between, unmoved_lines
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.rule_checks import prove_delegations, prove_rules
from rtshcua.ground.prove.step_paths import prove_home, prove_path
from rtshcua.ground.prove.step_permissions import prove_authority
from rtshcua.ground.prove.step_starts import (
    FROM_HOME,
    MOST_PLACES,
    MissionStart,
    StartPlace,
    may_be_skipped,
    places_after,
    prove_aloft,
    prove_start,
    warn_not_landed,
)
from rtshcua.ground.prove.step_time_and_energy import StepBound, prove_step_bounds
from rtshcua.ground.prove.step_times import MissionStep, mission_steps, prove_validity
from rtshcua.ground.prove.survey_quality import prove_survey_quality
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl

#: the proofs of a policy, in order
POLICY_PROOFS = (
    prove_links, prove_last_links, prove_deferrals, prove_observability, prove_contracts, prove_delegations,
    prove_rules, prove_survey_quality,
)  # fmt: skip


def prove_policy(context: CheckContext, lowered: LoweredPolicy) -> ProofContext | None:
    """Prove a policy and return it prepared as on board, or None if it would be refused there."""
    found = _prepared(lowered.policy)
    if isinstance(found, Refusal):
        report_refused(context, lowered, found)
        return None
    prepared, questions = found
    proof = ProofContext(context, lowered, prepared, tuple(signals(lowered.policy)), questions.again())
    for prove in POLICY_PROOFS:
        prove(proof)
    return proof


@lru_cache(maxsize=32)
def _prepared(policy: Policy) -> tuple[PreparedPolicy, Questions] | Refusal:
    """Prepare a policy and its questions. The cache serves programs of several missions with the same policy."""
    prepared = prepare(policy)
    return prepared if isinstance(prepared, Refusal) else (prepared, Questions(prepared))


def prove_mission(
    proof: ProofContext, declared: MissionDecl, mission: Mission, start: MissionStart = FROM_HOME
) -> tuple[StepBound, ...]:
    """Prove a mission under a policy, from where it begins. Returns the bounds of its steps; empty if it cannot be
    flown.
    """
    too_long = paths_fit(mission, proof.prepared)
    if too_long is not None:
        text = f"`{declared.name.text}` does not fit on board: {too_long.text}"
        proof.report.add(codes.TOO_MANY, declared.name.span, text, help=too_long.help)
        return ()
    prepared: list[PreparedInvocation] = []
    slowest = start.speed
    for invocation in mission.invocations:
        found = proof.prepare(invocation, mission.phases)
        if isinstance(found, Refusal):
            report_refused(proof.context, proof.lowered, found)
            return ()
        prepared.append(at_slowest(found, slowest))
        slowest = slower(slowest, invocation.plan.speed)
    declared_steps = [step for phase in declared.phases for step in phase.steps]
    steps = list(mission_steps(proof, declared_steps, prepared))
    permitted = [prove_authority(proof, declared, step) for step in steps]
    before = len(proof.report.found)
    flown = prove_flight(proof, declared, steps, permitted, start)
    if len(proof.report.found) == before:
        for step in compress(steps, permitted):
            prove_step_contract(proof, step)
    if all(permitted):
        timely = prove_known_issue if mission.issued_at_us else prove_some_issue
        if not timely(proof, steps, unmoved_lines(steps)):
            prove_between(proof, declared, steps, timely)
    for step in steps:
        prove_step_deferral(proof, step)
        prove_step_observability(proof, step)
    prove_validity(proof, steps)
    prove_observation_time(proof, steps)
    return flown


def report_refused(context: CheckContext, lowered: LoweredPolicy, malformed: Refusal) -> None:
    """Report a compiled policy or mission that would be refused on board."""
    context.report.add(
        codes.REFUSED_ON_BOARD,
        lowered.declaration.name.span,
        f"`{lowered.declaration.name.text}` as compiled would be refused on board: {malformed.text}",
        help="stay within the limit that the message names; if it names none, this is a bug in the compiler",
    )


def prove_flight(
    proof: ProofContext, mission: MissionDecl, steps: Sequence[MissionStep], permitted: Sequence[bool],
    start: MissionStart,
) -> tuple[StepBound, ...]:  # fmt: skip
    """Prove the flight of a mission up to the first step that cannot be flown. Returns the bounds of the steps, or ().

    Steps after it are not proved: they would begin at a place that the vehicle never reaches.
    """
    ways = FallbackWays(proof)
    starts: list[tuple[StartPlace, ...]] = []
    places: tuple[StartPlace, ...] = (start.place,)
    slowest, skipped = start.speed, list[MissionStep]()
    bounds: list[StepBound] = []
    followed = True
    for step, permits in zip(steps, permitted, strict=True):
        may_skip = may_be_skipped(step.prepared)
        able = places if permits and step.flat.skill not in proof.impossible else ()
        if (able and not may_skip) or not any(place.aloft for place in places):
            able = prove_aloft(proof, step, able, skipped)
        able = prove_path(proof, step, able, skipped) if able else ()
        able = prove_aloft(proof, step, able, skipped)
        slowest = slower(slowest, step.flat.plan.speed)
        bound = prove_step_bounds(proof, step, able, slowest) if able else None
        able = prove_start(proof, step, able, skipped) if able else ()
        if not able or not (starts or prove_home(proof, steps)):
            return ()
        bounds += [] if bound is None else [bound]
        ways.prove(step, able)
        starts.append(able)
        skipped += [step] if may_skip else []
        places = places_after(step.prepared, places, able)
        if followed and len(places) > MOST_PLACES:
            followed = False
            _too_many_places(proof, step)
        places = places[:MOST_PLACES]
    warn_not_landed(proof, mission, steps[-1], places)
    prove_charge(proof, steps, starts, start.charge)
    prove_landing_height(proof, steps)
    return tuple(bounds) if len(bounds) == len(steps) else ()


def _too_many_places(proof: ProofContext, step: MissionStep) -> None:
    proof.report.add(
        codes.UNDECIDED,
        step.span,
        f"after this step the vehicle may be at more than {MOST_PLACES} places, because many steps may be skipped",
        help="the ways from some of these places are only checked on board; let an earlier step `abort` or `hold`",
    )
