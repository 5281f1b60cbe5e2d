"""E1303: rules that permit more than anyone is likely to mean.

`permit any` permits also what an import brings later. Everyone may be permitted what makes a flight safer: to hold, to
go home, to land, and whatever is a link of a chain, which must be permitted to whoever may need it (E0705). What else
takes the vehicle elsewhere wants a role or a condition; a role that all software may speak for, the agent and what runs
on board, is hardly one, nor is a condition that never fails. `delegate any` passes on also what its grantor is
permitted later.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.deciding import Vacuous
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import Delegation, Rule
from rtshcua.model.ir.skills import Motion

_MOVING = ("climb", "fly", "cover")
#: who may ask for a tactical skill besides a person
_SOFTWARE = frozenset({"agent", "onboard"})


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report permits for any skill, and permits of moving skills for any role and in any state."""
    links, vacuous = frozenset(_links(subject)), Vacuous(subject.grounds)
    for unit in subject.asked:
        rules = [rule for policy in unit.policies for rule in policy.rules]
        rules += [rule for template in unit.templates for rule in template.rules]
        for rule in rules:
            if rule.kind == "permit":
                yield from _permit(subject, rule, links, vacuous)
        for policy in unit.policies:
            for delegation in policy.delegations:
                if not delegation.skills and delegation.when is None:
                    yield _everything(delegation)


def _links(subject: Subject) -> Iterator[str]:
    """The skills that fly as links, of a fallback or contingency chain, or as what a flight is degraded to."""
    chains = [skill.fallback for skill in subject.symbols.skills.values()]
    chains += [policy.contingency for policy in subject.policies]
    yield from (link.skill.text for chain in chains for link in chain)
    yield from (
        rule.target.skill.text for rule in subject.rules() if isinstance(rule, Rule) and rule.target is not None
    )


def _permit(subject: Subject, rule: Rule, links: frozenset[str], vacuous: Vacuous) -> Iterator[Diagnostic]:
    if not rule.skills:
        yield Diagnostic(
            codes.BROAD_AUTHORITY,
            "this permits every skill, also those that an import brings later",
            rule.span,
            "name the skills that you mean",
        )
    elif not rule.roles or {source.text for source in rule.through} >= _SOFTWARE:
        for name in rule.skills:
            skill = subject.symbols.skills.get(name.text)
            motion = None if skill is None else skill.motion
            if motion is None or motion.kind not in _MOVING or name.text in links:
                continue
            if rule.when is None or vacuous(rule, name.text):
                yield _moving(rule, name, motion)


def _moving(rule: Rule, name: Name, motion: Motion) -> Diagnostic:
    to, help = "everyone", "name the roles, as in `by role operator`, or add a condition with `when`"
    labels = [Label(motion.span, "it moves the vehicle")]
    if rule.roles:
        to, help = "software of every kind", "name fewer sources, as in `through agent`, or add a condition with `when`"
        labels = [Label(rule.through[0].span.to(rule.through[-1].span), "all of these may ask for it"), *labels]
    if rule.when is not None:
        labels.append(Label(rule.when.span, "this never fails"))
    message = f"this permits `{name.text}` to {to}, whatever its arguments and the state"
    return Diagnostic(codes.BROAD_AUTHORITY, message, name.span, help, tuple(labels))


def _everything(delegation: Delegation) -> Diagnostic:
    return Diagnostic(
        codes.BROAD_AUTHORITY,
        f"this passes on all that `{delegation.grantor.text}` may do, also what it is permitted later",
        delegation.span,
        "name the skills that you mean, or add a condition with `when`",
    )
