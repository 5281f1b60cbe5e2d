"""E0413, E0517: what reads something that the vehicle is without: the signal of a sensor, or its local time.

A signal that is declared is required: one that never comes is unknown, and nothing that reads it is ever permitted. So
a vehicle says which sensors it is without, a clause or a rule says whether it applies only `where fitted`, and what
reads such a signal all the same is refused. What is left out is kept in the policy, for people to read. A `permit` has
no `where fitted`: without its condition it would permit more, and without itself nothing that a reader expects.

The local time of a vehicle without a `clock` would be UTC in silence, hours from what the author meant.
"""

from collections.abc import Iterable, Iterator, Sequence

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.parts import walk
from rtshcua.ground.checker.uses import brought_about
from rtshcua.model.ir.expression import Comparison, Condition, TimeOfDay, Within
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
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


def check_policy(
    context: Context, policy: PolicyDecl, vehicle: VehicleDecl, skills: Iterable[SkillDecl], zones: Iterable[ZoneDecl]
) -> None:
    """Report the rules and clauses of a policy, and its zones, that read what the vehicle is without."""
    for rule in policy.rules:
        if rule.when is not None and not rule.where_fitted:
            help = "leave the signal out of the rule" if rule.kind == "permit" else "end the rule in `where fitted`"
            with context.report.within(brought_about(rule)):
                _sensors(context, vehicle, rule.when, help)
    clauses = [clause for skill in skills for clause in (*skill.require, *skill.assume, *skill.maintain)]
    for clause in clauses:
        if not clause.where_fitted:
            _sensors(context, vehicle, clause.condition, "write the clause on a line of its own, with `where fitted`")
    for rule in policy.rules:
        if rule.when is not None:
            with context.report.within(brought_about(rule)):
                _clock(context, vehicle, _timed(rule.when))
    for clause in clauses:
        _clock(context, vehicle, _timed(clause.condition))
    for zone in zones:
        if zone.daily is not None:
            _clock(context, vehicle, [zone.daily.span], f"`{zone.name.text}` is active at times of the local day")


def check_step(context: Context, vehicle: VehicleDecl, own: Sequence[Clause]) -> bool:
    """Whether a step's own clauses read only sensors that the vehicle has; reports what else they read."""
    for clause in own:
        _clock(context, vehicle, _timed(clause.condition))
    before = len(context.report.found)
    for clause in own:
        _sensors(context, vehicle, clause.condition, "leave the clause out")
    return len(context.report.found) == before


def _sensors(context: Context, vehicle: VehicleDecl, condition: Condition, help: str) -> None:
    listed = {name.text: name.span for name in vehicle.without}
    for name, span in lacking(condition, frozenset(listed)).items():
        context.report.add(
            codes.NOT_FITTED,
            span,
            f"this reads the signal `{name}`, which the vehicle `{vehicle.name.text}` is without",
            help=f"{help}; or, if the vehicle has the sensor, take `{name}` out of its `without`",
            labels=[(listed[name], "the vehicle is without it")],
        )


def _timed(condition: Condition) -> Iterator[Span]:
    """Where a condition compares with a time of day."""
    for part in walk(condition):
        if isinstance(part, Comparison | Within) and any(isinstance(each, TimeOfDay) for each in walk(part)):
            yield part.span


def _clock(
    context: Context, vehicle: VehicleDecl, spans: Iterable[Span], words: str = "this reads the local time"
) -> None:
    if vehicle.utc_offset is not None or vehicle.time_zone is not None:
        return
    for span in spans:
        context.report.add(
            codes.NO_CLOCK,
            span,
            f"{words}, and `{vehicle.name.text}` does not say how far that is from UTC",
            help='say so in the vehicle, as in `clock "Europe/Berlin"` or `clock utc +02:00`',
            labels=[(vehicle.name.span, "the vehicle, without `clock`")],
        )
