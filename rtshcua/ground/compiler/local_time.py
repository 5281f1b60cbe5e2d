"""E0517: what reads the local time of a vehicle that does not say what its local time is.

Without its `clock` it would be UTC in silence, hours from what the author meant.
"""

from collections.abc import Iterable, Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.parts import walk
from rtshcua.ground.checker.uses import brought_about
from rtshcua.model.ir.expression import Comparison, Condition, TimeOfDay, Within
from rtshcua.model.ir.missions import Step
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl
from rtshcua.model.ir.skills import Clause, SkillDecl


def check_policy(
    context: Context, policy: PolicyDecl, vehicle: VehicleDecl, skills: Iterable[SkillDecl], zones: Iterable[ZoneDecl]
) -> None:
    """Report the conditions of a policy, and its zones, that read a local time that nothing is known of."""
    if _has_clock(vehicle):
        return
    for rule in policy.rules:
        if rule.when is not None:
            with context.report.within(brought_about(rule)):
                _report(context, vehicle, _timed(rule.when), "this reads the local time")
    for skill in skills:
        _clauses(context, vehicle, (*skill.require, *skill.assume, *skill.maintain))
    for zone in zones:
        if zone.daily is not None:
            words = f"`{zone.name.text}` is active at times of the local day"
            _report(context, vehicle, [zone.daily.span], words)


def check_step(context: Context, vehicle: VehicleDecl, step: Step) -> None:
    """Report the same of a step's own clauses."""
    own = step.overrides
    if own is not None and not _has_clock(vehicle):
        _clauses(context, vehicle, (*own.require, *own.assume, *own.maintain))


def _has_clock(vehicle: VehicleDecl) -> bool:
    return vehicle.utc_offset is not None or vehicle.time_zone is not None


def _clauses(context: Context, vehicle: VehicleDecl, clauses: Iterable[Clause]) -> None:
    for clause in clauses:
        _report(context, vehicle, _timed(clause.condition), "this reads the local time")


def _timed(condition: Condition) -> Iterator[Span]:
    """Where a condition compares with a time of day."""
    for part in walk(condition):
        if isinstance(part, Comparison | Within) and any(isinstance(each, TimeOfDay) for each in walk(part)):
            yield part.span


def _report(context: Context, vehicle: VehicleDecl, spans: Iterable[Span], words: str) -> None:
    for span in spans:
        context.report.add(
            codes.NO_CLOCK,
            span,
            f"{words}, and `{vehicle.name.text}` does not say how far that is from UTC",
            help='say so in the vehicle, as in `clock "Europe/Berlin"` or `clock utc +02:00`',
            labels=[(vehicle.name.span, "the vehicle, without `clock`")],
        )
