"""Check policies: their rules name known declarations, and the contingency ends on the ground."""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.chains import check_chain, check_end, check_link
from rtshcua.ground.checker.conditions import check_condition, references
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import one_of, quantity
from rtshcua.ground.checker.lookup import find_skill, find_zone
from rtshcua.ground.checker.name_scope import Argument, Scope
from rtshcua.ground.checker.symbols import brought_about
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.limits import MAX_SILENCE, MAX_VALUE
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.policies import PolicyDecl, RuleDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Dimension

SOURCES = tuple(each.name.lower() for each in SourceKind)


def check_policies(context: CheckContext) -> None:
    """Report every invalid rule, and every policy without a valid contingency."""
    for policy in context.symbols.policies.values():
        if policy.version > MAX_VALUE:
            context.report.add(
                codes.NUMBER_SIZE,
                policy.name.span,
                f"the version of `{policy.name.text}` is too large",
                help=f"the maximum is {MAX_VALUE}",
            )
        for rule in policy.rules:
            with context.report.within(brought_about(rule)):
                _rule(context, rule)
        if policy.airspace is not None:
            for name in (*policy.airspace.inside, *policy.airspace.outside):
                find_zone(context, name)
        _contingency(context, policy)
        if policy.without_link is not None:
            quantity(context, policy.without_link.limit, Dimension.DURATION, most=MAX_SILENCE)
    for rule in context.samples:
        _rule(context, rule)


def _contingency(context: CheckContext, policy: PolicyDecl) -> None:
    links = policy.contingency
    if links:
        check_chain(context, links, None, links[0].span.to(links[-1].span))
        return
    context.report.add(
        codes.NO_CONTINGENCY,
        policy.name.span,
        f"the policy `{policy.name.text}` has no contingency",
        help="add the skills to fly when a step is denied in flight, as in "
        "`contingency hover for 10 s, return_home, emergency_land`",
    )


def _rule(context: CheckContext, rule: RuleDecl) -> None:
    skills = [skill for skill in (find_skill(context, name) for name in rule.skills) if skill is not None]
    for source in rule.through:
        one_of(context, codes.UNKNOWN_SOURCE, source, SOURCES, "source")
    if rule.kind == "confirm":
        _confirm(context, rule)
    if rule.target is not None:
        target = check_link(context, rule.target)
        if target is not None:
            check_end(context, rule.target, target)
    if rule.when is not None and len(skills) == len(rule.skills):
        shared = shared_arguments(context, rule, skills)
        if shared is not None:
            check_condition(Scope(context.symbols, context.report, shared), rule.when)


def _confirm(context: CheckContext, rule: RuleDecl) -> None:
    if rule.within is not None:
        quantity(context, rule.within, Dimension.DURATION)
        return
    context.report.add(
        codes.CONFIRM_WITHOUT_WITHIN,
        rule.span,
        "the rule has no time limit for the approval",
        help="add `within` and a duration, as in `within 30 s`; after that the step is denied",
    )


def shared_arguments(context: CheckContext, rule: RuleDecl, skills: Sequence[SkillDecl]) -> dict[str, Argument] | None:
    """Return the arguments that all skills of a rule have, which its condition may read; None after a finding."""
    assert rule.when is not None
    signatures = [context.arguments(skill) for skill in skills]
    shared = dict(signatures[0]) if signatures else {}
    failed = False
    for reference in references(rule.when):
        name = reference.name
        if name in context.symbols.signals or name in context.symbols.zones:
            continue
        if not rule.skills:
            failed = _is_argument(context, rule, reference) or failed
            continue
        having = next((signature[name] for signature in signatures if name in signature), None)
        if having is None:
            continue  # an enumerator, a zone's entry, or unknown: the check of the condition reports it
        for lacking, signature in zip(skills, signatures, strict=True):
            if name in signature and signature[name].type == having.type:
                continue
            context.report.add(
                codes.RULE_ARGUMENT,
                reference.span,
                f"`{lacking.name.text}` has no argument `{name}` of this type, which the rule reads",
                help="write one rule for each skill",
                labels=[
                    (lacking.name.span, "declared here"),
                    (having.declaration.span, f"`{name}` is declared here"),
                ],
            )
            failed = True
            break
    return None if failed else shared


def _is_argument(context: CheckContext, rule: RuleDecl, reference: Reference) -> bool:
    """Whether a rule for any skill reads an argument; reports it."""
    name = reference.name
    if not any(name in context.arguments(skill) for skill in context.symbols.skills.values()):
        return False
    context.report.add(
        codes.RULE_ARGUMENT,
        reference.span,
        f"a rule for any skill cannot read the argument `{name}`, which some skills lack",
        help="name the skills of the rule",
        labels=[(rule.span, "this rule is for any skill")],
    )
    return True
