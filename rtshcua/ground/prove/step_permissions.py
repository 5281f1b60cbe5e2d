"""Prove that the policy permits each step with its arguments, and does not always replace it by another skill.

The clauses of a permit about arguments and zones must be true. Those about signals, the time and the vehicle's position
are decided on board.
"""

from collections.abc import Mapping
from typing import NamedTuple

from rtshcua.decision.decide import PASS, authority
from rtshcua.decision.evaluate import Environment, build
from rtshcua.decision.nearest import ChangeSearch, Offer, offer
from rtshcua.decision.prepare import PreparedInvocation, PreparedRule
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.analysis.condition_trees import conjuncts
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.lower.mission import argument_span
from rtshcua.ground.prove.proof_context import ProofContext, optimistic
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.model.flat.contract import SourceKind, TimingClass
from rtshcua.model.flat.policy import Rule, RuleKind
from rtshcua.model.ir.expression import Condition
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.outcome import Reason
from rtshcua.model.quantity import Dimension, display


class _FailedClause(NamedTuple):
    """A clause of a permit that cannot be true: its span, the parameters that it reads, and accepted values."""

    span: Span
    parameters: tuple[str, ...]
    accepted: tuple[Offer, ...]


def prove_authority(proof: ProofContext, mission: MissionDecl, step: MissionStep) -> bool:
    """Whether some state of the vehicle lets a step be permitted and flown. Reports the step otherwise."""
    at = proof.around(step.prepared)
    found = authority(step.prepared, at)
    if PASS in found or not found:
        return not _degraded(proof, step, at)
    # a forbid that some state makes false does not decide in the best case; a missing permit is the last reason
    forbids = (each.rule for each in step.prepared.candidates.forbids if not each.condition(at) & FALSE)
    forbid = None if found[0].reason is Reason.CLASS_NOT_PERMITTED else next(forbids, None)
    if forbid is not None:
        proof.report.add(
            codes.FORBIDDEN,
            step.span,
            f"the policy `{proof.policy.name}` forbids this step",
            help=_help_against(proof, step.prepared, at, forbid),
            labels=[(proof.span(forbid), "by this rule")],
        )
        return False
    match found[-1].reason:
        case Reason.CLASS_NOT_PERMITTED:
            _class(proof, mission, step)
        case Reason.NOT_PERMITTED:
            _not_permitted(proof, mission, step)
        case _:
            _out_of_scope(proof, step, at)
    return False


def _degraded(proof: ProofContext, step: MissionStep, at: Environment) -> bool:
    """Whether a degrade holds, or is unknown, in every state. Reports it."""
    always = (each.rule for each in step.prepared.candidates.degrades if not each.condition(at) & FALSE)
    rule = next(always, None)
    if rule is None or rule.target is None:
        return False
    policy = proof.policy
    proof.report.add(
        codes.DEGRADED,
        step.span,
        f"the policy `{policy.name}` replaces this step by `{policy.contracts[rule.target.skill].name}` in every state",
        help=_help_against(proof, step.prepared, at, rule),
        labels=[(proof.span(rule), "by this rule")],
    )
    return True


def _help_against(proof: ProofContext, invocation: PreparedInvocation, at: Environment, rule: Rule) -> str:
    """Return advice against a rule: the nearest arguments for which it does not hold, or another change."""
    node = proof.prepared.compiler.when(rule)
    changes = ChangeSearch(at, proof.prepared.tables)
    wanted = None if node is None else changes.find(optimistic(node, False), False)
    contract, policy = invocation.invocation.contract, proof.policy
    offers = [offer(change, contract, policy, at) for change in wanted or ()]
    if not offers or not all(each.change.argument and each.options for each in offers):
        return "narrow the condition of the rule, or remove the step"
    return _accepted({each.subject: "` or `".join(_values_text(each)) for each in offers})


def _accepted(values: Mapping[str, str]) -> str:
    return "nearest accepted: " + ", ".join(f"`{name} = {value}`" for name, value in values.items())


def _class(proof: ProofContext, mission: MissionDecl, step: MissionStep) -> None:
    skill = proof.skills[step.declared.skill.text]
    assert mission.source is not None
    assert skill.timing_class is not None
    timing = TimingClass(step.contract.timing_class).name.lower()
    proof.report.add(
        codes.SOURCE_CLASS,
        step.declared.skill.span,
        f"`{mission.source.text}` may not request a skill of the class `{timing}`",
        help="an agent or an operator may request `semantic` and `tactical` skills",
        labels=[
            (skill.timing_class.span, "the class is declared here"),
            (mission.source.span, "proposed by this source"),
        ],
    )


def _not_permitted(proof: ProofContext, mission: MissionDecl, step: MissionStep) -> None:
    policy, flat = proof.policy, step.flat
    assert mission.role is not None
    may: list[str] = []
    for rule in policy.rules:
        if rule.kind == RuleKind.PERMIT and flat.skill in rule.skills:
            roles = " or ".join(f"`{policy.roles[role]}`" for role in rule.roles) or "any role"
            through = " or ".join(f"`{SourceKind(source).name.lower()}`" for source in rule.sources) or "any source"
            may.append(f"{roles} through {through}")
    source = SourceKind(flat.source).name.lower()
    proof.report.add(
        codes.NOT_PERMITTED,
        step.declared.skill.span,
        f"no rule permits `{step.declared.skill.text}` to the role `{mission.role.text}` through `{source}`",
        help="it is permitted to " + "; to ".join(dict.fromkeys(may)) if may else "no rule permits it to anyone",
        labels=[(proof.lowered.declaration.name.span, "the policy is declared here")],
    )


def _out_of_scope(proof: ProofContext, step: MissionStep, at: Environment) -> None:
    """Report a step outside all permits, with the clauses of the permit that has the fewest failed ones."""
    permits = [_failed_clauses(proof, permit, step.prepared, at) for permit in step.prepared.candidates.permits]
    nearest = min(permits, key=len)
    name = next((each for unmet in nearest for each in unmet.parameters), None)
    accepted = {each.subject: "` or `".join(_values_text(each)) for unmet in nearest for each in unmet.accepted}
    labels = [(unmet.span, "this does not hold") for unmet in nearest]
    span, subject, fix = step.span, name or step.contract.name, None
    if name is not None:
        span = argument_span(proof.context, step.declared, name)
        written = _default(proof, step, name) if span == step.span else span
        if written is not None:
            subject += f" = {proof.report.text(written)}"
        if span == step.span:
            labels += [(written, "the step uses this default")] if written is not None else []
        elif len(nearest) == 1 and name in accepted:
            replacement = _values_text(nearest[0].accepted[0])[0]
            fix = (span, replacement, f"write `{replacement}`")
    proof.report.add(
        codes.OUT_OF_SCOPE,
        span,
        f"`{subject}` is not permitted by `{proof.policy.name}` for `{step.contract.name}`",
        help=_accepted(accepted) if accepted else None,
        labels=labels,
        fix=fix,
    )


def _default(proof: ProofContext, step: MissionStep, parameter: str) -> Span | None:
    """Return the span of a parameter's default, or None."""
    skill = proof.skills[step.declared.skill.text]
    return next((p.default.span for p in skill.parameters if p.name.text == parameter and p.default is not None), None)


def _values_text(offer: Offer) -> list[str]:
    """Format the accepted values as in sources."""
    return [name or display(value, Dimension(offer.dimension)) for value, name in offer.options]


def _failed_clauses(
    proof: ProofContext, permit: PreparedRule, invocation: PreparedInvocation, at: Environment
) -> list[_FailedClause]:
    """Return the clauses of a permit that cannot be true, in source order."""
    rule = permit.rule
    declared = _declaration(proof, rule)
    node = proof.prepared.compiler.when(rule)
    if declared is None or node is None:
        return []
    contract, policy = invocation.invocation.contract, proof.policy
    changes = ChangeSearch(at, proof.prepared.tables)
    parameters = {parameter.name for parameter in contract.parameters}
    found: list[_FailedClause] = []
    for clause, part in conjuncts(declared, node):
        if build(part, proof.prepared.tables)(at) & TRUE:
            continue
        wanted = changes.find(part, True) or ()
        offers = [offer(change, contract, policy, at) for change in wanted if change.argument]
        reads = dict.fromkeys(each.name for each in references(clause) if each.name in parameters)
        found.append(_FailedClause(clause.span, tuple(reads), tuple(each for each in offers if each.options)))
    return found


def _declaration(proof: ProofContext, rule: Rule) -> Condition | None:
    """Return the condition of the rule in the source."""
    return proof.lowered.written[rule].when
