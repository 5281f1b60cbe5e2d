"""E0705: the links of every chain are permitted to whoever may start it, whatever the state of the vehicle is then.

On board links skip the step of authority: a vehicle in trouble is not asked for its papers. That is sound because of
this proof. The contingency flies for whoever it was, so its links must be permitted by any.

A link flies in the phase of the step that needs it. So it must be permitted in the phases in which the step may begin:
those for which its skill is valid and in which some permit of it may hold. The phases that no condition names are one.
"""

from collections.abc import Iterable, Iterator, Mapping

from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.values import FALSE, TRUE, point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.flat.contract import Contract, Link, SourceKind
from rtshcua.model.flat.policy import Policy, Rule, RuleKind

#: a role and a source that may ask for a skill; the role after the last one stands for any that no rule names
Asker = tuple[int, int]
#: in which phases somebody may ask, by their numbers among the policy's names, and by which rule
Asked = Mapping[int, Rule | None]


def prove(ground: Ground) -> None:
    """Report every skill that somebody could need as a link and nobody permitted, once each."""
    policy = ground.prepared.policy
    always: Asked = dict.fromkeys(_every(policy))
    everybody = {(len(policy.roles), int(source)): always for source in SourceKind}
    reported: set[int] = set()

    def links(chain: Iterable[Link], askers: Mapping[Asker, Asked], words: str, why: Span | None) -> None:
        for link in chain:
            if link.skill not in reported and not _permitted(ground, link, askers, words, why):
                reported.add(link.skill)

    links(policy.contingency, everybody, "the contingency flies for any role and source", None)
    askers = {number: _askers(ground, number) for number in range(len(policy.contracts))}
    for number, contract in enumerate(policy.contracts):
        words = f"the fallback of `{contract.name}` flies for whoever may ask for that"
        links(contract.fallback, askers[number], words, None)
    for rule in policy.rules:
        if rule.target is not None:
            asking: dict[Asker, dict[int, Rule | None]] = {}
            for number in rule.skills or range(len(policy.contracts)):
                applies = {phase for phase in _every(policy) if _may(ground, rule, number, phase)}
                for asker, phases in askers[number].items():
                    kept = {phase: permit for phase, permit in phases.items() if phase in applies}
                    asking.setdefault(asker, {}).update(kept)
            links([rule.target], asking, "the rule applies to whoever may ask for its skills", ground.span(rule))


def _every(policy: Policy) -> range:
    """All phases: those that the policy names, and the others as one."""
    return range(NO_PHASE, len(policy.phases))


def _valid(policy: Policy, contract: Contract) -> Iterator[int]:
    """The phases for which a skill is valid."""
    names = contract.phases
    if not names or not set(policy.phases).issuperset(names):
        yield NO_PHASE
    yield from (number for number, name in enumerate(policy.phases) if not names or name in names)


def _may(ground: Ground, rule: Rule, skill: int, phase: int) -> bool:
    """Whether a rule may apply to a skill in a phase, with any arguments in any state."""
    at = ground.environment(ground.questions.space(skill).arguments, phase)
    return bool(ground.condition(rule)(at) & TRUE)


def _askers(ground: Ground, skill: int) -> dict[Asker, dict[int, Rule | None]]:
    """Who may ask for a skill, in which phases, by the rules that permit it."""
    policy = ground.prepared.policy
    valid = tuple(_valid(policy, policy.contracts[skill]))
    found: dict[Asker, dict[int, Rule | None]] = {}
    for rule in policy.rules:
        if rule.kind == RuleKind.PERMIT and (not rule.skills or skill in rule.skills):
            phases = [phase for phase in valid if _may(ground, rule, skill, phase)]
            for role in rule.roles or (len(policy.roles),):
                for source in rule.sources or tuple(map(int, SourceKind)):
                    asked = found.setdefault((role, source), {})
                    for phase in phases:
                        asked.setdefault(phase, rule)
    return found


def _permitted(ground: Ground, link: Link, askers: Mapping[Asker, Asked], words: str, why: Span | None) -> bool:
    """Whether a link is permitted to all askers whenever they may ask; reports the first one to whom it is not."""
    asking = ((role, source, phase, rule) for (role, source), asked in askers.items() for phase, rule in asked.items())
    for role, source, phase, rule in asking:
        forbid, permit, partly = _doubts(ground, link, role, source, phase)
        if forbid is None and permit:
            continue
        policy = ground.prepared.policy
        in_phase = ""
        if any(_doubts(ground, link, role, source, each)[:2] == (None, True) for each in askers[role, source]):
            names = " and ".join(f"`{name}`" for name in policy.phases)
            in_phase = f" in phases other than {names}" if phase == NO_PHASE else f" in `{policy.phases[phase]}`"
        named = f"`{policy.roles[role]}`" if role < len(policy.roles) else "any role"
        labels = [] if why is None else [(why, words)]
        if rule is not None:
            labels.append((ground.span(rule), "this rule permits what the link is a way out of"))
        if forbid is not None:
            labels.append((ground.span(forbid), "this rule may forbid it"))
        else:
            labels += _permits(ground, link, partly)
        name = policy.contracts[link.skill].name
        ground.context.report.add(
            codes.LINK_NOT_PERMITTED,
            ground.span(link),
            f"the link `{name}` is not always permitted to {named} through `{SourceKind(source).name.lower()}`"
            + in_phase,
            help=f"{words}: add `permit {name} by any`, without a condition that may fail"
            if forbid is None
            else f"{words}: leave `{name}` out of the rule that forbids it",
            labels=labels,
        )
        return False
    return True


def _permits(ground: Ground, link: Link, partly: list[Rule]) -> list[tuple[Span, str]]:
    """The rules that permit a link, and why these do not suffice."""
    permits = [rule for rule in ground.prepared.policy.rules if rule.kind == RuleKind.PERMIT]
    return [
        (
            ground.span(rule),
            "this rule permits it, if its condition holds" if rule in partly else "this rule permits it to others",
        )
        for rule in permits
        if link.skill in rule.skills
    ]


def _doubts(ground: Ground, link: Link, role: int, source: int, phase: int) -> tuple[Rule | None, bool, list[Rule]]:
    """A rule that may forbid a link in a phase, if there is one, whether one surely permits it, and those that may."""
    at = ground.environment(tuple(map(point, link.arguments)), phase)
    found = ground.prepared.rules.candidates(link.skill, role, source)
    forbid = next((rule.rule for rule in found.forbids if rule.condition(at) != FALSE), None)
    sure = any(rule.condition(at) == TRUE for rule in found.permits)
    return forbid, sure, [rule.rule for rule in found.permits]
