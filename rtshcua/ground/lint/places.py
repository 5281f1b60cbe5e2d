"""E1308: a permit without a condition for a skill that flies to a place it is told, where nothing bounds the place.

Something bounds it where the airspace names a zone to stay inside of, or any rule about the skill has a condition.
Neither counts that restricts nothing: a zone that holds all that the vehicle can reach, a condition that never makes a
difference.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.deciding import Vacuous
from rtshcua.ground.lint.reach import is_unbounded
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import PolicyDecl, Rule
from rtshcua.model.ir.skills import Parameter

_FLYING = ("fly", "cover")


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report permits that let a skill fly anywhere."""
    vacuous = Vacuous(subject.grounds)
    for unit in subject.asked:
        for policy in unit.policies:
            if _is_unbounded(subject, policy):
                yield from _of_policy(subject, policy, vacuous)


def _is_unbounded(subject: Subject, policy: PolicyDecl) -> bool:
    """Whether no zone to stay inside of restricts where a vehicle of the policy comes."""
    if policy.airspace is None or not policy.airspace.inside:
        return True
    lowered = [ground for ground in subject.grounds if ground.lowered.declaration.span == policy.span]
    return bool(lowered) and all(is_unbounded(ground.prepared.policy) for ground in lowered)


def _of_policy(subject: Subject, policy: PolicyDecl, vacuous: Vacuous) -> Iterator[Diagnostic]:
    used = [subject.symbols.templates[use.template.text] for use in policy.uses]
    rules = [*policy.rules, *(rule for template in used for rule in template.rules)]
    conditional = [rule for rule in rules if rule.when is not None]
    for rule in policy.rules:
        for name in rule.skills if rule.kind == "permit" else ():
            told = _told(subject, name)
            if told is None or (rule.when is not None and not vacuous(rule, name.text)):
                continue
            about = [each for each in conditional if not each.skills or _names(each, name)]
            if all(vacuous(each, name.text) for each in about):
                yield _found(policy, name, told)


def _names(rule: Rule, skill: Name) -> bool:
    return any(name.text == skill.text for name in rule.skills)


def _told(subject: Subject, name: Name) -> Parameter | None:
    """The parameter by which a skill is told where to fly."""
    skill = subject.symbols.skills.get(name.text)
    if skill is None or skill.motion is None or skill.motion.kind not in _FLYING:
        return None
    return next((each for each in skill.parameters if each.type.text in ("zone", "position")), None)


def _found(policy: PolicyDecl, name: Name, told: Parameter) -> Diagnostic:
    return Diagnostic(
        codes.UNBOUNDED_PLACE,
        f"this permits `{name.text}` to any place, and nothing in `{policy.name.text}` says where it may fly",
        name.span,
        "add `airspace inside ...`, or a condition as in `when target inside city`",
        (Label(told.name.span, f"`{told.name.text}` says where"),),
    )
