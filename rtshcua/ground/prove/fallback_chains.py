"""E0705: the links of every chain are permitted to whoever may start it. E0618: the last link works in the worst state.

On board links skip the step of authority: a vehicle in trouble is not asked for its papers. This proof makes that
sound. The contingency flies for everybody, so its links must be permitted to anybody. A link flies in the phase of the
step that needs it, so it must be permitted in the phases in which that step may begin: those for which its skill is
valid and in which some permit of it may hold. The phases that no condition names count as one.

In the worst state no signal arrives, and only the reserve is left of the battery. So the skill of the last link must
take no more than the reserve, maintain nothing that is unknown then, and last long enough to come down from the highest
step. E0612 says that it is a landing, requires and assumes nothing, and has no time limit as a link.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from rtshcua.decision.evaluate import NO_PHASE, Environment
from rtshcua.decision.flying import BEGINS, SETTLES, charge, landing_us
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import FALSE, MISSING, TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.model.flat.contract import Contract, Link, MotionKind, SourceKind
from rtshcua.model.flat.policy import Policy, Rule, RuleKind
from rtshcua.model.quantity import Dimension, display

#: a role and a source that may ask for a skill; the role after the last one stands for any that no rule names
_Requester = tuple[int, int]
#: in which phases somebody may ask, by their numbers among the policy's names, and by which rule
_PhaseRules = Mapping[int, Rule | None]


def prove_links(proof: ProofContext) -> None:
    """Report every skill that somebody could need as a link and nobody permitted, once each."""
    policy = proof.policy
    always: _PhaseRules = dict.fromkeys(_every(policy))
    everybody = {(len(policy.roles), int(source)): always for source in SourceKind}
    reported: set[int] = set()

    def links(chain: Iterable[Link], askers: Mapping[_Requester, _PhaseRules], words: str, why: Span | None) -> None:
        for link in chain:
            if link.skill not in reported and not _permitted(proof, link, askers, words, why):
                reported.add(link.skill)

    links(policy.contingency, everybody, "the contingency flies for any role and source", None)
    askers = {number: _requesters(proof, number) for number in range(len(policy.contracts))}
    for number, contract in enumerate(policy.contracts):
        words = f"the fallback of `{contract.name}` flies for whoever may ask for that"
        links(contract.fallback, askers[number], words, None)
    for rule in policy.rules:
        if rule.target is not None:
            asking: dict[_Requester, dict[int, Rule | None]] = {}
            for number in rule.skills or range(len(policy.contracts)):
                applies = {phase for phase in _every(policy) if _may(proof, rule, number, phase)}
                for asker, phases in askers[number].items():
                    kept = {phase: permit for phase, permit in phases.items() if phase in applies}
                    asking.setdefault(asker, {}).update(kept)
            links([rule.target], asking, "the rule applies to whoever may ask for its skills", proof.span(rule))


def _every(policy: Policy) -> range:
    """All phases: those that the policy names, and the others as one."""
    return range(NO_PHASE, len(policy.phases))


def _valid(policy: Policy, contract: Contract) -> Iterator[int]:
    """The phases for which a skill is valid."""
    names = contract.phases
    if not names or not set(policy.phases).issuperset(names):
        yield NO_PHASE
    yield from (number for number, name in enumerate(policy.phases) if not names or name in names)


def _may(proof: ProofContext, rule: Rule, skill: int, phase: int) -> bool:
    """Whether a rule may apply to a skill in a phase, with any arguments in any state."""
    at = proof.environment(proof.questions.space(skill).arguments, phase)
    return bool(proof.condition(rule)(at) & TRUE)


def _requesters(proof: ProofContext, skill: int) -> dict[_Requester, dict[int, Rule | None]]:
    """Who may ask for a skill, in which phases, by the rules that permit it."""
    policy = proof.policy
    valid = tuple(_valid(policy, policy.contracts[skill]))
    found: dict[_Requester, dict[int, Rule | None]] = {}
    for rule in policy.rules:
        if rule.kind == RuleKind.PERMIT and (not rule.skills or skill in rule.skills):
            phases = [phase for phase in valid if _may(proof, rule, skill, phase)]
            for role in rule.roles or (len(policy.roles),):
                for source in rule.sources or tuple(map(int, SourceKind)):
                    asked = found.setdefault((role, source), {})
                    for phase in phases:
                        asked.setdefault(phase, rule)
    return found


def _permitted(
    proof: ProofContext, link: Link, askers: Mapping[_Requester, _PhaseRules], words: str, why: Span | None
) -> bool:
    """Whether a link is permitted to all askers whenever they may ask; reports the first one to whom it is not."""
    asking = ((role, source, phase, rule) for (role, source), asked in askers.items() for phase, rule in asked.items())
    for role, source, phase, rule in asking:
        forbid, permit, partly = _doubts(proof, link, role, source, phase)
        if forbid is None and permit:
            continue
        policy = proof.policy
        in_phase = ""
        if any(_doubts(proof, link, role, source, each)[:2] == (None, True) for each in askers[role, source]):
            names = " and ".join(f"`{name}`" for name in policy.phases)
            in_phase = f" in phases other than {names}" if phase == NO_PHASE else f" in `{policy.phases[phase]}`"
        named = f"`{policy.roles[role]}`" if role < len(policy.roles) else "any role"
        labels = [] if why is None else [(why, words)]
        if rule is not None:
            labels.append((proof.span(rule), "this rule permits what the link is a way out of"))
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
            help=f"{words}: add `permit {name} by any`, without a condition that may fail"
            if forbid is None
            else f"{words}: leave `{name}` out of the rule that forbids it",
            labels=labels,
        )
        return False
    return True


def _permit_labels(proof: ProofContext, link: Link, partly: list[Rule]) -> list[tuple[Span, str]]:
    """The rules that permit a link, and why these do not suffice."""
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
    """A rule that may forbid a link in a phase, if there is one, whether one surely permits it, and those that may."""
    at = proof.environment(tuple(map(point, link.arguments)), phase)
    found = proof.prepared.rules.candidates(link.skill, role, source)
    forbid = next((rule.rule for rule in found.forbids if rule.condition(at) != FALSE), None)
    sure = any(rule.condition(at) == TRUE for rule in found.permits)
    return forbid, sure, [rule.rule for rule in found.permits]


_SECOND_US = 1_000_000


def prove_last_links(proof: ProofContext) -> None:
    """Report each skill that ends a chain of the policy and cannot in the worst state, once."""
    policy = proof.policy
    chains = [policy.contingency, *(contract.fallback for contract in policy.contracts)]
    reported: set[int] = set()
    for chain in chains:
        if chain and chain[-1].skill not in reported:
            for words, help, span, label in _last_link_lacks(proof, chain[-1]):
                reported.add(chain[-1].skill)
                _report_last_link(proof, proof.span(chain[-1]), words, help, [(span, label)])


def _last_link_lacks(proof: ProofContext, link: Link) -> Iterator[tuple[str, str, Span, str]]:
    """What a last link lacks, what would help, and where that is written."""
    policy = proof.policy
    contract, reserve = policy.contracts[link.skill], policy.vehicle.reserve
    skill = proof.skills[contract.name]
    if contract.energy > reserve:
        assert skill.energy is not None
        yield (
            f"the last link `{contract.name}` may take {_percent(contract.energy)} of the charge, and what is kept for "
            f"it is the reserve of `{policy.vehicle.name}`, {_percent(reserve)}",
            "raise the vehicle's `reserve`, or end the chain in a skill that takes less",
            skill.energy.span,
            "it may take so much",
        )
    any_time = proof.sets()
    nothing = Environment(
        [MISSING] * (policy.slots + 1), tuple(map(point, link.arguments)), any_time.utc_us, any_time.utc_error_us
    )
    for clause, condition in proof.prepared.compiler.guards(contract.maintain, contract):
        if slots_read((clause,), policy.vehicle, policy.monitors) and not condition(nothing) & TRUE:
            yield (
                f"the last link `{contract.name}` maintains `{clause.text}`, which is unknown when no signal arrives",
                "end the chain in a skill that maintains nothing, for then nothing is left to fall back on",
                proof.span(clause),
                "it is to maintain this",
            )


def prove_landing_height(proof: ProofContext, steps: Sequence[MissionStep]) -> None:
    """Report the last links that may not be down from the highest step in the time, or with the charge, that they have.

    A return climbs before it can be broken off, so its height counts too.
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
        takes = f"from {display(highest, Dimension.ALTITUDE)} the last link `{contract.name}` takes up to "
        if 0 < contract.duration_us < needed:
            assert declared.duration is not None
            words = (
                f"{takes}{display(-(-needed // _SECOND_US) * _SECOND_US, Dimension.DURATION)} to come down, and it "
                f"lasts at most {display(contract.duration_us, Dimension.DURATION)}"
            )
            help, written = "let it last longer, or stay lower", declared.duration.span
        elif charge(speeds, needed) > contract.energy:
            assert declared.energy is not None
            words = (
                f"{takes}{_percent(-(-charge(speeds, needed) // 10) * 10)} of a full charge to come down, and it takes "
                f"at most {_percent(contract.energy)}"
            )
            help, written = "let it take more, or stay lower", declared.energy.span
        else:
            continue
        labels = [(written, "declared here"), (proof.span(link), "the last link of a chain")]
        _report_last_link(proof, steps[heights.index(max(heights))].span, words, help, labels)


def _report_last_link(proof: ProofContext, span: Span, words: str, help: str, labels: list[tuple[Span, str]]) -> None:
    proof.report.add(codes.INFEASIBLE_LAST_LINK, span, words, help=help, labels=labels)


def _percent(charge: int) -> str:
    return display(charge, Dimension.RATIO)
