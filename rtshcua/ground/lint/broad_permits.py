"""Rules that permit more than their author is likely to mean (E1303), and permits that do not bound a place (E1308).

E1303: `permit any` also permits skills that an import adds later, and `delegate any` also delegates permits that are
added later. Everyone may be permitted to hold, return home and land, and to fly the links of a chain, which E0705
requires. Any other moving skill needs a role or a condition. A rule for both agent and onboard software needs a
condition even if it names roles. A condition that never fails does not count.

E1308: a permit for a skill that flies to a place from its arguments, where nothing bounds the place. A zone of
`airspace inside` bounds the place. So does a condition of a rule about the skill, unless it is only about a height.
Neither counts if it restricts nothing (`restrictions`).
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.ground.lint.lint_input import LintInput, rules_of
from rtshcua.ground.lint.restrictions import VacuousRules, is_unbounded
from rtshcua.ground.lint.unused import mentions
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import Delegation, PolicyDecl, RuleDecl
from rtshcua.model.ir.skills import MotionDecl, ParameterDecl, SkillDecl

_MOVING_MOTIONS = ("climb", "fly", "cover")
#: the sources other than a person that may request a tactical skill
_SOFTWARE = frozenset({"agent", "onboard"})


def broad_permits(subject: LintInput) -> Iterator[Diagnostic]:
    """Report permits for any skill, and permits for moving skills without a role and a condition (E1303)."""
    links, vacuous = frozenset(_chain_links(subject)), VacuousRules(subject.grounds)
    for unit in subject.requested:
        for rule in rules_of(unit):
            if rule.kind == "permit":
                yield from _of_permit(subject, rule, links, vacuous)
        for policy in unit.policies:
            for delegation in policy.delegations:
                if not delegation.skills and delegation.when is None:
                    yield _broad_delegation(delegation)


def _chain_links(subject: LintInput) -> Iterator[str]:
    """Yield the skills of fallback and contingency chains, and the skills that a `degrade` rule switches to."""
    chains = [skill.fallback for skill in subject.symbols.skills.values()]
    chains += [policy.contingency for policy in subject.symbols.policies.values()]
    yield from (link.skill.text for chain in chains for link in chain)
    yield from (
        rule.target.skill.text for rule in subject.rules() if isinstance(rule, RuleDecl) and rule.target is not None
    )


def _of_permit(
    subject: LintInput, rule: RuleDecl, links: frozenset[str], vacuous: VacuousRules
) -> Iterator[Diagnostic]:
    if not rule.skills:
        yield Diagnostic(
            codes.BROAD_AUTHORITY,
            "this permits every skill, including skills that an import adds later",
            rule.span,
            "name the permitted skills",
        )
    elif not rule.roles or {source.text for source in rule.through} >= _SOFTWARE:
        for name in rule.skills:
            skill = subject.symbols.skills.get(name.text)
            motion = None if skill is None else skill.motion
            if motion is None or motion.kind not in _MOVING_MOTIONS or name.text in links:
                continue
            if rule.when is None or vacuous(rule, name.text):
                yield _broad_permit(rule, name, motion)


def _broad_permit(rule: RuleDecl, name: Name, motion: MotionDecl) -> Diagnostic:
    to, help = "everyone", "name the roles, as in `by role operator`, or add a condition with `when`"
    labels = [Label(motion.span, "this skill moves the vehicle")]
    if rule.roles:
        to, help = "all software", "name fewer sources, as in `through agent`, or add a condition with `when`"
        labels = [Label(rule.through[0].span.to(rule.through[-1].span), "any of these may request the skill"), *labels]
    if rule.when is not None:
        labels.append(Label(rule.when.span, "this condition never fails"))
    message = f"this permits `{name.text}` to {to}, with any arguments and in any state"
    return Diagnostic(codes.BROAD_AUTHORITY, message, name.span, help, tuple(labels))


def _broad_delegation(delegation: Delegation) -> Diagnostic:
    return Diagnostic(
        codes.BROAD_AUTHORITY,
        f"this delegates everything that `{delegation.grantor.text}` may do, including permits that are added later",
        delegation.span,
        "name the delegated skills, or add a condition with `when`",
    )


_FLYING_KINDS = ("fly", "cover")
#: the signal of the vehicle's height
HEIGHT_SIGNAL = "height"


def unbounded_places(subject: LintInput) -> Iterator[Diagnostic]:
    """Report permits that let a skill fly anywhere (E1308)."""
    vacuous = VacuousRules(subject.grounds)
    for unit in subject.requested:
        for policy in unit.policies:
            if _is_unbounded(subject, policy):
                yield from _in_policy(subject, policy, vacuous)


def _is_unbounded(subject: LintInput, policy: PolicyDecl) -> bool:
    """Whether the policy has no `airspace inside` zone that restricts where its vehicle can fly."""
    if policy.airspace is None or not policy.airspace.inside:
        return True
    lowered = [ground for ground in subject.grounds if ground.lowered.declaration.span == policy.span]
    return bool(lowered) and all(is_unbounded(ground.prepared.policy) for ground in lowered)


def _in_policy(subject: LintInput, policy: PolicyDecl, vacuous: VacuousRules) -> Iterator[Diagnostic]:
    used = [subject.symbols.templates[use.template.text] for use in policy.uses]
    rules = [*policy.rules, *(rule for template in used for rule in template.rules)]
    for permit in policy.rules:
        for name in permit.skills if permit.kind == "permit" else ():
            skill = subject.symbols.skills.get(name.text)
            place = None if skill is None else _place_parameter(skill)
            if skill is None or place is None:
                continue
            if all(vacuous(rule, name.text) for rule in rules if _bounds_place(rule, permit, skill)):
                yield _unbounded_place(policy, permit, name, place)


def _bounds_place(rule: RuleDecl, permit: RuleDecl, skill: SkillDecl) -> bool:
    """Whether a rule narrows the places to which a permit lets a skill fly. Another permit does not."""
    names = [name.text for name in rule.skills]
    if rule is not permit and (rule.kind == "permit" or (names and skill.name.text not in names)):
        return False
    heights = {HEIGHT_SIGNAL, *(each.name.text for each in skill.parameters if each.type.text == "altitude")}
    return bool(mentions(rule.when) - heights)


def _place_parameter(skill: SkillDecl) -> ParameterDecl | None:
    """The parameter that holds the place to which a skill flies."""
    if skill.motion is None or skill.motion.kind not in _FLYING_KINDS:
        return None
    return next((each for each in skill.parameters if each.type.text in ("zone", "position")), None)


def _unbounded_place(policy: PolicyDecl, rule: RuleDecl, name: Name, place: ParameterDecl) -> Diagnostic:
    labels = [Label(place.name.span, f"`{place.name.text}` is the destination")]
    if rule.when is not None:
        labels.append(Label(rule.when.span, "this bounds the height, not the place"))
    return Diagnostic(
        codes.UNBOUNDED_PLACE,
        f"this permits `{name.text}` to any place: nothing in `{policy.name.text}` bounds where it may fly",
        name.span,
        "add `airspace inside ...`, or a condition as in `when target inside city`",
        tuple(labels),
    )
