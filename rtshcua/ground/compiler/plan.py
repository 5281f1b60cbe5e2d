"""Where a step will take the vehicle: the planned path, its altitude and its speed."""

from collections.abc import Sequence

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Bound, Context
from rtshcua.ground.compiler.policy import LoweredPolicy
from rtshcua.ground.compiler.shapes import Area, parts
from rtshcua.ground.compiler.survey import DEFAULT_PATTERN, survey
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.limits import MAX_PATH
from rtshcua.model.flat.mission import Plan
from rtshcua.model.ir.missions import Step
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.skills import SkillDecl

HOME = (0, 0)


def plan_of(
    context: Context, step: Step, bound: Sequence[Bound], arguments: Sequence[int], under: LoweredPolicy
) -> Plan | None:
    """The plan of a step with its arguments (`bound`, and as cells); None after a finding."""
    skill = context.symbols.skills[step.skill.text]
    contract = under.policy.contracts[under.skills[step.skill.text]]
    motion = contract.motion
    altitude = 0 if motion.altitude < 0 else arguments[motion.altitude]
    speed = 0 if motion.speed < 0 else arguments[motion.speed]
    path: tuple[int, ...] = ()
    if motion.kind == MotionKind.HOME:
        path = HOME
    elif motion.kind == MotionKind.FLY:
        cell = next(each.cell for each in contract.parameters if each.name == _target(skill))
        path = tuple(arguments[cell : cell + 2])
    elif motion.kind == MotionKind.COVER:
        covered = _covered(context, step, skill, bound, altitude, under)
        if covered is None:
            return None
        path = covered
    return Plan(kind=motion.kind, path=path, altitude=altitude, speed=speed)


def _target(skill: SkillDecl) -> str:
    assert skill.motion is not None
    assert skill.motion.target is not None
    return skill.motion.target.text


def _covered(
    context: Context, step: Step, skill: SkillDecl, bound: Sequence[Bound], altitude: int, under: LoweredPolicy
) -> tuple[int, ...] | None:
    """The survey path of a `cover` motion."""
    assert skill.motion is not None
    names = [parameter.name.text for parameter in skill.parameters]
    zone = bound[names.index(_target(skill))]
    assert isinstance(zone, ZoneDecl)
    pattern = DEFAULT_PATTERN
    if skill.motion.pattern is not None:
        at = names.index(skill.motion.pattern.text)
        ordinal = bound[at]
        assert isinstance(ordinal, int)
        pattern = skill.parameters[at].choices[ordinal].text
    region = under.zones.regions[under.zones.index[zone.name.text]]
    start = None if zone.entry is None else under.zones.place(zone.entry)
    points = survey(region.shape, pattern, altitude, under.policy.vehicle.position_error, start)
    if points is None:
        shape = region.shape
        several = len(parts(shape)) if isinstance(shape, Area) else 1
        context.report.add(
            codes.AREA_TOO_SMALL,
            step.span,
            f"`{zone.name.text}` is in {several} parts, and a path lies in one"
            if several > 1
            else f"`{zone.name.text}` is too small or too bent for the pattern `{pattern}`",
            help="declare each part as a zone, and fly over one after the other"
            if several > 1
            else "the path keeps the vehicle's position error away from the edge; a `perimeter` needs the least room",
            labels=[(zone.name.span, "declared here")],
        )
        return None
    if len(points) > MAX_PATH:
        context.report.add(
            codes.TOO_MANY,
            step.span,
            f"the path over `{zone.name.text}` has {len(points)} points, and at most {MAX_PATH} fit on board",
            labels=[(zone.name.span, "declared here")],
        )
        return None
    return tuple(coordinate for point in points for coordinate in point)
