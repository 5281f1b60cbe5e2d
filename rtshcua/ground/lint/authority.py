"""E1303: rules that permit more than anyone is likely to mean.

`permit any` permits also what an import brings later. Everyone may be permitted what makes a flight safer: to hold, to
go home, to land, and whatever is a link of a chain, which must be permitted to whoever may need it (E0705). What else
takes the vehicle elsewhere wants a role or a condition.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.policies import Rule

_MOVING = ("climb", "fly", "cover")


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report permits for any skill, and permits of moving skills for any role and in any state."""
    links = frozenset(_links(subject))
    for unit in subject.asked:
        rules = [rule for policy in unit.policies for rule in policy.rules]
        rules += [rule for template in unit.templates for rule in template.rules]
        for rule in rules:
            if rule.kind == "permit":
                yield from _permit(subject, rule, links)


def _links(subject: Subject) -> Iterator[str]:
    """The skills that fly as links, of a fallback or contingency chain, or as what a flight is degraded to."""
    chains = [skill.fallback for skill in subject.symbols.skills.values()]
    chains += [policy.contingency for policy in subject.policies]
    yield from (link.skill.text for chain in chains for link in chain)
    yield from (
        rule.target.skill.text for rule in subject.rules() if isinstance(rule, Rule) and rule.target is not None
    )


def _permit(subject: Subject, rule: Rule, links: frozenset[str]) -> Iterator[Diagnostic]:
    if not rule.skills:
        yield Diagnostic(
            codes.BROAD_AUTHORITY,
            "this permits every skill, also those that an import brings later",
            rule.span,
            "name the skills that you mean",
        )
    elif not rule.roles and rule.when is None:
        for name in rule.skills:
            skill = subject.symbols.skills.get(name.text)
            motion = None if skill is None else skill.motion
            if motion is not None and motion.kind in _MOVING and name.text not in links:
                yield Diagnostic(
                    codes.BROAD_AUTHORITY,
                    f"this permits `{name.text}` to everyone, whatever its arguments and the state",
                    name.span,
                    "name the roles, as in `by role operator`, or add a condition with `when`",
                    (Label(motion.span, "it moves the vehicle"),),
                )
