"""E1308: a permit for a skill that flies to a place it is told, where nothing bounds the place.

Something bounds it where the airspace names a zone to stay inside of, or a rule about the skill has a condition on more
than a height. Neither counts that restricts nothing: a zone that holds all that the vehicle can reach, a condition that
never makes a difference.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.deciding import Vacuous
from rtshcua.ground.lint.mentions import mentions
from rtshcua.ground.lint.reach import is_unbounded
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import PolicyDecl, Rule
from rtshcua.model.ir.skills import Parameter

_FLYING = ("fly", "cover")
#: the signal of the height that the vehicle is at
HEIGHT = "height"


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
            if told is None:
                continue
            heights = {HEIGHT, *(each.name.text for each in _parameters(subject, name) if each.type.text == "altitude")}
            about = [each for each in conditional if _bears_on(each, rule, name) and mentions(each.when) - heights]
            if all(vacuous(each, name.text) for each in about):
                yield _found(policy, rule, name, told)


def _bears_on(rule: Rule, permit: Rule, skill: Name) -> bool:
    """Whether a rule narrows what a permit lets a skill do; another permit does not."""
    if rule.kind == "permit":
        return rule is permit
    return not rule.skills or any(name.text == skill.text for name in rule.skills)


def _told(subject: Subject, name: Name) -> Parameter | None:
    """The parameter by which a skill is told where to fly."""
    skill = subject.symbols.skills.get(name.text)
    if skill is None or skill.motion is None or skill.motion.kind not in _FLYING:
        return None
    return next((each for each in skill.parameters if each.type.text in ("zone", "position")), None)


def _parameters(subject: Subject, name: Name) -> tuple[Parameter, ...]:
    return subject.symbols.skills[name.text].parameters


def _found(policy: PolicyDecl, rule: Rule, name: Name, told: Parameter) -> Diagnostic:
    labels = [Label(told.name.span, f"`{told.name.text}` says where")]
    if rule.when is not None:
        labels.append(Label(rule.when.span, "this bounds how high it flies, not where"))
    return Diagnostic(
        codes.UNBOUNDED_PLACE,
        f"this permits `{name.text}` to any place, and nothing in `{policy.name.text}` says where it may fly",
        name.span,
        "add `airspace inside ...`, or a condition as in `when target inside city`",
        tuple(labels),
    )
