"""E0705: the links of every chain are permitted to whoever may start it, whatever the state of the vehicle is then.

On board links skip the step of authority: a vehicle in trouble is not asked for its papers. That is sound because of
this proof. The contingency flies for whoever it was, so its links must be permitted by any.
"""

from collections.abc import Iterable, Mapping

from rtshcua.decision.truth import FALSE, TRUE
from rtshcua.decision.values import point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.model.flat.contract import Link, SourceKind
from rtshcua.model.flat.policy import Rule, RuleKind

#: a role and a source that may ask for a skill; the role after the last one stands for any that no rule names
Asker = tuple[int, int]


def prove(ground: Ground) -> None:
    """Report every skill that somebody could need as a link and nobody permitted, once each."""
    policy = ground.prepared.policy
    everybody = dict.fromkeys((len(policy.roles), int(source)) for source in SourceKind)
    reported: set[int] = set()

    def links(chain: Iterable[Link], askers: Mapping[Asker, Rule | None], words: str, why: Span | None) -> None:
        for link in chain:
            if link.skill not in reported and not _permitted(ground, link, askers, words, why):
                reported.add(link.skill)

    links(policy.contingency, everybody, "the contingency flies for any role and source", None)
    askers = {number: _askers(policy.rules, number, len(policy.roles)) for number in range(len(policy.contracts))}
    for number, contract in enumerate(policy.contracts):
        words = f"the fallback of `{contract.name}` flies for whoever may ask for that"
        links(contract.fallback, askers[number], words, None)
    for rule in policy.rules:
        if rule.target is not None:
            numbers = rule.skills or range(len(policy.contracts))
            asking = {asker: permit for number in numbers for asker, permit in askers[number].items()}
            links([rule.target], asking, "the rule applies to whoever may ask for its skills", ground.span(rule))


def _askers(rules: Iterable[Rule], skill: int, anyone: int) -> dict[Asker, Rule | None]:
    """Who may ask for a skill, by the rules that permit it."""
    found: dict[Asker, Rule | None] = {}
    for rule in rules:
        if rule.kind == RuleKind.PERMIT and (not rule.skills or skill in rule.skills):
            for role in rule.roles or (anyone,):
                for source in rule.sources or tuple(map(int, SourceKind)):
                    found.setdefault((role, source), rule)
    return found


def _permitted(ground: Ground, link: Link, askers: Mapping[Asker, Rule | None], words: str, why: Span | None) -> bool:
    """Whether a link is permitted to all askers; reports the first one to whom it is not."""
    for (role, source), rule in askers.items():
        forbid, permit = _doubts(ground, link, role, source)
        if forbid is None and permit:
            continue
        policy = ground.prepared.policy
        named = f"`{policy.roles[role]}`" if role < len(policy.roles) else "any role"
        labels = [] if why is None else [(why, words)]
        if rule is not None:
            labels.append((ground.span(rule), "this rule permits what the link is a way out of"))
        if forbid is not None:
            labels.append((ground.span(forbid), "this rule may forbid it"))
        name = policy.contracts[link.skill].name
        ground.context.report.add(
            codes.LINK_NOT_PERMITTED,
            ground.span(link),
            f"the link `{name}` is not always permitted to {named} through `{SourceKind(source).name.lower()}`",
            help=f"{words}: add `permit {name} by any`, without a condition that may fail"
            if forbid is None
            else f"{words}: leave `{name}` out of the rule that forbids it",
            labels=labels,
        )
        return False
    return True


def _doubts(ground: Ground, link: Link, role: int, source: int) -> tuple[Rule | None, bool]:
    """A rule that may forbid a link, if there is one, and whether a rule surely permits it."""
    at = ground.environment(tuple(map(point, link.arguments)))
    found = ground.prepared.rules.candidates(link.skill, role, source)
    forbid = next((rule.rule for rule in found.forbids if rule.condition(at) != FALSE), None)
    return forbid, any(rule.condition(at) == TRUE for rule in found.permits)
