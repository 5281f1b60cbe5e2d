"""E0413: what reads a signal of a sensor that the vehicle is without.

A signal that is declared is required: one that never comes is unknown, and nothing that reads it is ever permitted. So
a vehicle says which sensors it is without, a clause or a rule says whether it applies only `where fitted`, and what
reads such a signal all the same is refused. What is left out is kept in the policy, for people to read. A `permit` has
no `where fitted`: without its condition it would permit more, and without itself nothing that a reader expects.
"""

from collections.abc import Iterable

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.uses import brought_about
from rtshcua.model.ir.expression import Condition
from rtshcua.model.ir.missions import Step
from rtshcua.model.ir.places import VehicleDecl
from rtshcua.model.ir.policies import PolicyDecl, Rule
from rtshcua.model.ir.skills import Clause, SkillDecl


def lacking(condition: Condition, without: frozenset[str]) -> dict[str, Span]:
    """The signals that a condition reads and a vehicle is without, and where each is read first."""
    found: dict[str, Span] = {}
    for reference in references(condition):
        if reference.name in without:
            found.setdefault(reference.name, reference.span)
    return found


def applies(clause: Clause, without: frozenset[str]) -> bool:
    """Whether a clause counts for a vehicle that is without these signals."""
    return not (clause.where_fitted and lacking(clause.condition, without))


def rule_applies(rule: Rule, without: frozenset[str]) -> bool:
    """Whether a rule counts for a vehicle that is without these signals."""
    return not (rule.where_fitted and rule.when is not None and lacking(rule.when, without))


def check_policy(context: Context, policy: PolicyDecl, vehicle: VehicleDecl, skills: Iterable[SkillDecl]) -> None:
    """Report the rules and clauses of a policy that read what the vehicle is without."""
    if not vehicle.without:
        return
    for rule in policy.rules:
        if rule.when is not None and not rule.where_fitted:
            help = "leave the signal out of the rule" if rule.kind == "permit" else "end the rule in `where fitted`"
            with context.report.within(brought_about(rule)):
                _check(context, vehicle, rule.when, help)
    for skill in skills:
        for clause in (*skill.require, *skill.assume, *skill.maintain):
            if not clause.where_fitted:
                _check(context, vehicle, clause.condition, "write the clause on a line of its own, with `where fitted`")


def check_step(context: Context, vehicle: VehicleDecl, step: Step) -> bool:
    """Whether a step's own clauses read only what the vehicle has; reports what they read else."""
    before, own = len(context.report.found), step.overrides
    for clause in () if own is None else (*own.require, *own.assume, *own.maintain):
        _check(context, vehicle, clause.condition, "leave the clause out")
    return len(context.report.found) == before


def _check(context: Context, vehicle: VehicleDecl, condition: Condition, help: str) -> None:
    listed = {name.text: name.span for name in vehicle.without}
    for name, span in lacking(condition, frozenset(listed)).items():
        context.report.add(
            codes.NOT_FITTED,
            span,
            f"this reads the signal `{name}`, which the vehicle `{vehicle.name.text}` is without",
            help=f"{help}; or, if the vehicle has the sensor, take `{name}` out of its `without`",
            labels=[(listed[name], "the vehicle is without it")],
        )
