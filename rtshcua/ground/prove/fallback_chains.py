"""Prove that the links of every chain are permitted (E0705), and that the last link works in the worst state (E0618).

On board, a link is flown without checking authority, so that the vehicle can react in an emergency. This proof
justifies that: every link is permitted to everyone who may start its chain. The contingency flies for every requester,
so its links must be permitted to every requester. A link flies in the phase of the step that it replaces. So it must be
permitted in each phase in which that step may begin: the phases for which its skill is valid and in which a permit for
it may hold. The phases that no condition names count as one.

In the worst state no signal arrives, and the battery is down to the reserve. So the skill of the last link must need no
more than the reserve, must maintain nothing that is then unknown, and must last long enough to descend from the highest
step. E0612 ensures that the last link is a landing, requires and assumes nothing, and has no time limit as a link.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from rtshcua.decision.evaluate import NO_PHASE, Environment
from rtshcua.decision.flying import BEGINS, SETTLES, charge, landing_us
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import FALSE, MISSING, TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.substitution import named_at
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.model.flat.contract import Contract, Link, MotionKind, SourceKind
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.quantity import Dimension, display

#: a role and a source that may request a skill; the number after the last role stands for all roles without a rule
_Requester = tuple[int, int]
#: the phases in which a skill may be requested, by their index in the policy, each with the rule that permits it
_PhaseRules = Mapping[int, Rule | None]


def prove_links(proof: ProofContext) -> None:
    """Report every skill that may be needed as a link by a requester to whom it is not permitted, once each."""
    policy = proof.policy
    always: _PhaseRules = dict.fromkeys(_every(policy))
    everybody = {(len(policy.roles), int(source)): always for source in SourceKind}
    reported: set[int] = set()

    def links(
        chain: Iterable[Link], requesters: Mapping[_Requester, _PhaseRules], reason: str, rule: Span | None
    ) -> None:
        for link in chain:
            if link.skill not in reported and not _permitted(proof, link, requesters, reason, rule):
                reported.add(link.skill)

    links(policy.contingency, everybody, "the contingency flies for any role and source", None)
    of_skill = {number: _requesters(proof, number) for number in range(len(policy.contracts))}
    for number, contract in enumerate(policy.contracts):
        reason = f"the fallback of `{contract.name}` flies for everyone who may request it"
        links(contract.fallback, of_skill[number], reason, None)
    for rule in policy.rules:
        if rule.target is not None:
            requesters: dict[_Requester, dict[int, Rule | None]] = {}
            for number in rule.skills or range(len(policy.contracts)):
                applies = {phase for phase in _every(policy) if _may(proof, rule, number, phase)}
                for requester, phases in of_skill[number].items():
                    kept = {phase: permit for phase, permit in phases.items() if phase in applies}
                    requesters.setdefault(requester, {}).update(kept)
            reason = "the rule applies to everyone who may request its skills"
            links([rule.target], requesters, reason, proof.span(rule))


def _every(policy: Policy) -> range:
    """Return all phases: those that the policy names, and one for all others."""
    return range(NO_PHASE, len(policy.phases))


def _valid(policy: Policy, contract: Contract) -> Iterator[int]:
    """Yield the phases for which a skill is valid."""
    names = contract.phases
    if not names or not set(policy.phases).issuperset(names):
        yield NO_PHASE
    yield from (number for number, name in enumerate(policy.phases) if not names or name in names)


def _may(proof: ProofContext, rule: Rule, skill: int, phase: int) -> bool:
    """Whether a rule may apply to a skill in a phase, with some arguments in some state."""
    at = proof.environment(proof.questions.space(skill).arguments, phase)
    return bool(proof.condition(rule)(at) & TRUE)


def _requesters(proof: ProofContext, skill: int) -> dict[_Requester, dict[int, Rule | None]]:
    """Return who may request a skill, in which phases, and by which permit."""
    policy = proof.policy
    valid = tuple(_valid(policy, policy.contracts[skill]))
    found: dict[_Requester, dict[int, Rule | None]] = {}
    for rule in policy.rules:
        if rule.kind == RuleKind.PERMIT and (not rule.skills or skill in rule.skills):
            phases = [phase for phase in valid if _may(proof, rule, skill, phase)]
            for role in rule.roles or (len(policy.roles),):
                for source in rule.sources or tuple(map(int, SourceKind)):
                    permits = found.setdefault((role, source), {})
                    for phase in phases:
                        permits.setdefault(phase, rule)
    return found


def _permitted(
    proof: ProofContext, link: Link, requesters: Mapping[_Requester, _PhaseRules], reason: str, applied: Span | None
) -> bool:
    """Whether a link is permitted to all requesters in all their phases. Reports the first for whom it is not.

    `applied` is the degrade rule that makes the link necessary, if there is one.
    """
    cases = ((role, source, phase, rule) for (role, source), by in requesters.items() for phase, rule in by.items())
    for role, source, phase, rule in cases:
        forbid, permit, partly = _doubts(proof, link, role, source, phase)
        if forbid is None and permit:
            continue
        policy = proof.policy
        in_phase = ""
        if any(_doubts(proof, link, role, source, each)[:2] == (None, True) for each in requesters[role, source]):
            names = " and ".join(f"`{name}`" for name in policy.phases)
            in_phase = f" in phases other than {names}" if phase == NO_PHASE else f" in `{policy.phases[phase]}`"
        named = f"`{policy.roles[role]}`" if role < len(policy.roles) else "any role"
        labels = [] if applied is None else [(applied, reason)]
        if rule is not None:
            labels.append((proof.span(rule), "this rule permits the step that the link replaces"))
        if forbid is not None:
            labels.append((proof.span(forbid), "this rule may forbid it"))
        else:
            labels += _permit_labels(proof, link, partly)
        name = policy.contracts[link.skill].name
        proof.report.add(
            codes.LINK_NOT_PERMITTED,
            proof.span(link),
            f"the link `{name}` is not always permitted to {named} through `{SourceKind(source).name.lower()}`"
            + in_phase,
            help=f"{reason}: add `permit {name} by any`, without a condition that may fail"
            if forbid is None
            else f"{reason}: exclude `{name}` from the rule that forbids it",
            labels=labels,
        )
        return False
    return True


def _permit_labels(proof: ProofContext, link: Link, partly: list[Rule]) -> list[tuple[Span, str]]:
    """Return the permits for a link, each with the reason why it does not suffice."""
    permits = [rule for rule in proof.policy.rules if rule.kind == RuleKind.PERMIT]
    return [
        (
            proof.span(rule),
            "this rule permits it, if its condition holds" if rule in partly else "this rule permits it to others",
        )
        for rule in permits
        if link.skill in rule.skills
    ]


def _doubts(
    proof: ProofContext, link: Link, role: int, source: int, phase: int
) -> tuple[Rule | None, bool, list[Rule]]:
    """Return a rule that may forbid a link in a phase, whether a rule certainly permits it, and all its permits."""
    at = proof.environment(tuple(map(point, link.arguments)), phase)
    found = proof.prepared.rules.candidates(link.skill, role, source)
    forbid = next((rule.rule for rule in found.forbids if rule.condition(at) != FALSE), None)
    sure = any(rule.condition(at) == TRUE for rule in found.permits)
    return forbid, sure, [rule.rule for rule in found.permits]


_SECOND_US = 1_000_000


def prove_last_links(proof: ProofContext) -> None:
    """Report each skill that ends a chain and does not work in the worst state, once."""
    policy = proof.policy
    chains = [policy.contingency, *(contract.fallback for contract in policy.contracts)]
    reported: set[int] = set()
    for chain in chains:
        if chain and chain[-1].skill not in reported:
            for message, help, span, label in _last_link_faults(proof, chain[-1]):
                reported.add(chain[-1].skill)
                _report_last_link(proof, proof.span(chain[-1]), message, help, [(span, label)])


def _last_link_faults(proof: ProofContext, link: Link) -> Iterator[tuple[str, str, Span, str]]:
    """Yield each fault of a last link in the worst state: message, help, and a label with its span."""
    policy = proof.policy
    contract, reserve = policy.contracts[link.skill], policy.vehicle.reserve
    skill = proof.skills[contract.name]
    if contract.energy > reserve:
        assert skill.energy is not None
        yield (
            f"the last link `{contract.name}` may use {_percent(contract.energy)} of the charge, but the reserve of "
            f"`{policy.vehicle.name}` is {_percent(reserve)}",
            "raise the vehicle's `reserve`, or end the chain with a skill that uses less",
            skill.energy.span,
            "declared here",
        )
    any_time = proof.sets()
    nothing = Environment(
        [MISSING] * (policy.slots + 1), tuple(map(point, link.arguments)), any_time.utc_us, any_time.utc_error_us
    )
    for clause, condition in proof.prepared.compiler.guards(contract.maintain, contract):
        if slots_read((clause,), policy.vehicle, policy.monitors) and not condition(nothing) & TRUE:
            yield (
                f"the last link `{contract.name}` maintains `{clause.text}`, which is unknown when no signal arrives",
                "end the chain with a skill that maintains nothing: the last link has no fallback",
                proof.span(clause),
                "the skill maintains this condition",
            )


def prove_landing_height(proof: ProofContext, steps: Sequence[MissionStep]) -> None:
    """Report last links without the time or the charge to descend from the highest step.

    The return altitude counts too: a return may be aborted after its climb.
    """
    policy = proof.policy
    vehicle, speeds = policy.vehicle, proof.speeds
    heights = [step.flat.plan.altitude for step in steps]
    chains = [policy.contingency, *(step.contract.fallback for step in steps)]
    returns = any(policy.contracts[link.skill].motion.kind == MotionKind.HOME for chain in chains for link in chain)
    highest = max(*heights, vehicle.return_altitude if returns else 0)
    needed = BEGINS + SETTLES + landing_us(speeds, highest)
    for skill, link in {chain[-1].skill: chain[-1] for chain in chains if chain}.items():
        contract = policy.contracts[skill]
        declared = proof.skills[contract.name]
        needs = f"the last link `{contract.name}` needs up to "
        descent = f" to descend from {display(highest, Dimension.ALTITUDE)}, but"
        if 0 < contract.duration_us < needed:
            assert declared.duration is not None
            enough = display(-(-needed // _SECOND_US) * _SECOND_US, Dimension.DURATION)
            message = f"{needs}{enough}{descent} lasts at most {display(contract.duration_us, Dimension.DURATION)}"
            part, written = "lasts at most", declared.duration.span
        elif charge(speeds, needed) > contract.energy:
            assert declared.energy is not None
            enough = _percent(-(-charge(speeds, needed) // 10) * 10)
            message = f"{needs}{enough} of a full charge{descent} may use at most {_percent(contract.energy)}"
            part, written = "energy at most", declared.energy.span
        else:
            continue
        size = named_at(proof.report, declared, written)
        more = f"raise its `{part}`" if size is None else f"write `sizes {contract.name}({size} = {enough})`"
        help = f"{more}, or fly lower"
        labels = [(written, "declared here"), (proof.span(link), "the last link of a chain")]
        _report_last_link(proof, steps[heights.index(max(heights))].span, message, help, labels)


def _report_last_link(proof: ProofContext, span: Span, message: str, help: str, labels: list[tuple[Span, str]]) -> None:
    proof.report.add(codes.INFEASIBLE_LAST_LINK, span, message, help=help, labels=labels)


def _percent(charge: int) -> str:
    return display(charge, Dimension.RATIO)
