"""Elaborate `delegate goto by role operator to role trainee`: permissions of one role are given to another.

Each permit of the grantor becomes one of the grantee, for the delegated skills and sources, with the condition of the
delegation added. Each `forbid` of the grantor also becomes one of the grantee. A delegation is elaborated after those
to its grantor, so that a chain of delegations narrows at each step.
"""

from collections.abc import Iterable, Iterator, Sequence

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.checks.policies import SOURCES, shared_arguments
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import one_of
from rtshcua.ground.checker.lookup import find_skill
from rtshcua.ground.checker.report import Report
from rtshcua.model.flat.limits import MAX_ROLES, MAX_RULES
from rtshcua.model.ir.expression import Condition, Junction
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import Delegation, PolicyDecl, RuleDecl

#: the source of a role if a permit names none
OWN_SOURCE = "operator"
#: the most delegations of a policy
MOST_DELEGATIONS = 4_096


def delegated(
    context: CheckContext, policy: PolicyDecl, rules: Sequence[RuleDecl], *, whole: bool
) -> tuple[RuleDecl, ...]:
    """Return the rules of a policy with those of its delegations; `whole` if no rule is missing."""
    found = list(rules)
    if _too_many(context.report, policy.delegations):
        return tuple(found)
    ordered = list(_ordered(context.report, policy.delegations))
    made = {each.span for each in ordered}
    # roles that may lack something, for a reason that is reported
    lacking = {each.grantee.text for each in policy.delegations if each.span not in made}
    for delegation in ordered:
        before = len(context.report.found)
        found += _made(context, delegation, found, whole=whole and delegation.grantor.text not in lacking)
        if len(context.report.found) > before or delegation.grantor.text in lacking:
            lacking.add(delegation.grantee.text)
        if len(found) > MAX_RULES:
            context.report.add(
                codes.TOO_MANY,
                delegation.span,
                f"the policy has more than {MAX_RULES} rules with its delegations, the limit",
                help="delegate fewer skills, or to fewer roles",
            )
            break
    return tuple(found)


def _too_many(report: Report, delegations: Sequence[Delegation]) -> bool:
    """Report too many delegations or roles, which would take minutes to order."""
    roles: set[str] = set()
    for number, each in enumerate(delegations, 1):
        roles |= {each.grantor.text, each.grantee.text}
        if len(roles) > MAX_ROLES or number > MOST_DELEGATIONS:
            many = len(roles) > MAX_ROLES
            what, most = ("roles in delegations", MAX_ROLES) if many else ("delegations", MOST_DELEGATIONS)
            report.add(codes.TOO_MANY, each.span, f"the policy has more than {most} {what}, the limit")
            return True
    return False


def _ordered(report: Report, delegations: Sequence[Delegation]) -> Iterator[Delegation]:
    """The delegations, each after those to its grantor; those of a cycle are reported and dropped."""
    waiting = list(delegations)
    while waiting:
        grantees = {each.grantee.text for each in waiting}
        ready = [each for each in waiting if each.grantor.text not in grantees]
        yield from ready
        if not ready:
            ready = _circle(waiting)
            _report_circle(report, ready)
        made = {each.span for each in ready}
        waiting = [each for each in waiting if each.span not in made]


def _circle(waiting: Sequence[Delegation]) -> list[Delegation]:
    """A cycle among delegations, where each grantor is the grantee of another."""
    path: list[Delegation] = [waiting[0]]
    while True:
        before = next(each for each in waiting if each.grantee.text == path[-1].grantor.text)
        for number, each in enumerate(path):
            if each is before:
                return path[number:]
        path.append(before)


def _report_circle(report: Report, circle: Sequence[Delegation]) -> None:
    last = max(circle, key=lambda each: each.span)
    own = last.grantor.text == last.grantee.text
    report.add(
        codes.DELEGATION_CYCLE,
        last.span,
        f"the role `{last.grantor.text}` delegates to itself"
        if own
        else f"delegation cycle: the role `{last.grantee.text}` receives its own delegation",
        help="remove it: a role keeps its own permissions" if own else "delegate in one direction only",
        labels=[
            (each.span, f"`{each.grantor.text}` delegates to `{each.grantee.text}` here")
            for each in circle
            if each is not last
        ],
    )


def _made(context: CheckContext, delegation: Delegation, rules: Sequence[RuleDecl], *, whole: bool) -> list[RuleDecl]:
    """The rules that one delegation makes from the rules before it."""
    if not _is_valid(context, delegation):
        return []
    grantor = delegation.grantor.text
    permits = [rule for rule in rules if rule.kind == "permit" and (not rule.roles or _names(rule.roles, grantor))]
    named = [rule for rule in permits if rule.roles]
    made = [permit for rule in named if (permit := _permit(delegation, rule)) is not None]
    if whole:
        _nothing(context, delegation, permits, made)
    return made + [forbid for rule in rules if (forbid := _forbid(delegation, rule)) is not None]


def _is_valid(context: CheckContext, delegation: Delegation) -> bool:
    """Whether the skills and sources exist, and all skills have the arguments of the condition; reports it if not."""
    known = [find_skill(context, name) for name in delegation.skills]
    sources = [one_of(context, codes.UNKNOWN_SOURCE, name, SOURCES, "source") for name in delegation.through]
    skills = [skill for skill in known if skill is not None]
    if len(skills) < len(known) or not all(sources):
        return False
    if delegation.when is None:
        return True
    as_rule = RuleDecl(
        span=delegation.span, kind="permit", skills=delegation.skills, roles=(delegation.grantee,), through=(),
        when=delegation.when, approver=None, another=None, within=None, target=None,
    )  # fmt: skip
    return shared_arguments(context, as_rule, skills) is not None


def _permit(delegation: Delegation, permit: RuleDecl) -> RuleDecl | None:
    """The permit of the grantee made from one of the grantor; None if nothing remains."""
    skills = _shared(delegation, permit)
    through = _through(delegation, permit)
    if skills is None or through is None:
        return None
    changes = {"skills": skills, "through": through, "when": _both(permit.when, delegation.when)}
    return _for_grantee(delegation, permit).copied(**changes)


def _forbid(delegation: Delegation, rule: RuleDecl) -> RuleDecl | None:
    """The forbid of the grantee made from one of the grantor; None if nothing remains."""
    if rule.kind != "forbid" or not _names(rule.roles, delegation.grantor.text):
        return None
    skills = _shared(delegation, rule)
    if skills is None or _names(rule.roles, delegation.grantee.text):
        return None
    return _for_grantee(delegation, rule).copied(skills=skills)


def _for_grantee(delegation: Delegation, rule: RuleDecl) -> RuleDecl:
    return rule.copied(roles=(delegation.grantee,), origin=(delegation, *rule.origin))


def _shared(delegation: Delegation, rule: RuleDecl) -> tuple[Name, ...] | None:
    """The delegated skills of a rule, empty for any; None if there are none."""
    if not delegation.skills:
        return rule.skills
    if not rule.skills:
        return delegation.skills
    return tuple(name for name in rule.skills if _names(delegation.skills, name.text)) or None


def _through(delegation: Delegation, permit: RuleDecl) -> tuple[Name, ...] | None:
    """The sources of both the delegation and the permit; None if there are none."""
    if not delegation.through:
        return permit.through
    own = {name.text for name in permit.through} or {OWN_SOURCE}
    return tuple(name for name in delegation.through if name.text in own) or None


def _both(one: Condition | None, other: Condition | None) -> Condition | None:
    if one is None or other is None:
        return one or other
    return Junction(span=other.span, operator="and", operands=(one, other))


def _names(names: Iterable[Name], text: str) -> bool:
    return any(name.text == text for name in names)


def _nothing(
    context: CheckContext, delegation: Delegation, permits: Sequence[RuleDecl], made: Sequence[RuleDecl]
) -> None:
    """Report every delegated skill that the grantor is not permitted. A skill permitted to any role is not reported."""
    if not delegation.skills and not made:
        _report_nothing(context, delegation, delegation.grantor, "any skill", permits)
    for name in delegation.skills:
        about = [rule for rule in permits if not rule.skills or _names(rule.skills, name.text)]
        if any(not rule.roles for rule in about):
            continue
        if not any(not rule.skills or _names(rule.skills, name.text) for rule in made):
            _report_nothing(context, delegation, name, f"`{name.text}`", about)


def _report_nothing(
    context: CheckContext, delegation: Delegation, at: Name, what: str, about: Sequence[RuleDecl]
) -> None:
    named = [rule for rule in about if rule.roles]
    through = " or ".join(f"`{name.text}`" for name in delegation.through)
    context.report.add(
        codes.NOTHING_DELEGATED,
        at.span,
        f"the role `{delegation.grantor.text}` is not permitted {what}" + (f" through {through}" if named else ""),
        help="a role can only delegate its own permissions: add a permit, or remove this",
        labels=[(rule.span, "permitted here, through other sources") for rule in named[:3]],
    )
