"""Check that the expected outcome of a test is possible."""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.ground.checker.context import CheckContext
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import PolicyDecl
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.ir.tests import Expectation
from rtshcua.model.outcome import Outcome, Reason, outcome_of

_REASONS = {str(reason.value): reason for reason in Reason}


def check_expectation(
    context: CheckContext, expected: Expectation, skill: SkillDecl | None, policy: PolicyDecl | None
) -> None:
    """Report an unknown reason, a reason of another outcome, and a target that never flies."""
    if expected.reason is not None:
        _reason(context, expected, expected.reason)
    if expected.target is not None and skill is not None and policy is not None:
        _target(context, expected.target, skill, policy)


def _reason(context: CheckContext, expected: Expectation, name: Name) -> None:
    reason = _REASONS.get(name.text)
    if reason is None:
        fitting = [slug for slug, each in _REASONS.items() if outcome_of(each) is Outcome[expected.outcome.upper()]]
        near = nearest(name.text, _REASONS)
        context.report.add(
            codes.UNKNOWN_REASON,
            name.span,
            f"unknown reason `{name.text}`",
            help=f"did you mean `{near}`?" if near else f"the reasons of `{expected.outcome}` are {listed(fitting)}",
            fix=None if near is None else (name.span, near, f"write `{near}`"),
        )
        return
    outcome = outcome_of(reason).name.lower()
    if outcome != expected.outcome:
        context.report.add(
            codes.NEVER_DECIDED,
            name.span,
            f"`{name.text}` is a reason for `{outcome}`, not for `{expected.outcome}`",
            help=f"write `expect {outcome}`, or another reason",
            labels=[(expected.span, "expected here")],
        )


def _target(context: CheckContext, target: Name, skill: SkillDecl, policy: PolicyDecl) -> None:
    places = list(_targets(skill, policy))
    names = list(dict.fromkeys(name for name, _ in places))
    if target.text in names or target.text in context.symbols.broken:
        return
    near = nearest(target.text, names)
    context.report.add(
        codes.NEVER_DECIDED,
        target.span,
        f"`{target.text}` never replaces `{skill.name.text}`",
        help=f"did you mean `{near}`?" if near else f"possible replacements: {listed(names)}" if names else None,
        labels=[(span, f"`{name}` may replace it") for name, span in places[:3]],
        fix=None if near is None else (target.span, near, f"write `{near}`"),
    )


def _targets(skill: SkillDecl, policy: PolicyDecl) -> Iterator[tuple[str, Span]]:
    """The possible replacements of a skill: the links of its chain, and targets of `degrade`."""
    for link in skill.fallback:
        yield link.skill.text, link.span
    for rule in policy.rules:
        named = [name.text for name in rule.skills]
        if rule.target is not None and (not named or skill.name.text in named):
            yield rule.target.skill.text, rule.span
