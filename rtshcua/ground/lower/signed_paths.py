"""Compare the signed survey path of a step with the path that the planner computes.

On board, only the containment of the path in its zone is checked, so the signer of a mission may choose any path there.
The planner computes one path from skill, zone and arguments. Its start does not count, because a bundle does not carry
the zone's entry: the reversed path is the same path.

A bundle carries no camera either, so a grid with another spacing of its lines is the same path, and `other_spacing`
says which spacing it is. The centre line of a corridor is not in a bundle, so paths along it cannot be computed again.
"""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.contracts import first_cell
from rtshcua.ground.geometry.levels import LevelledPath, inward, levelled
from rtshcua.ground.geometry.polygons import Point, path_length
from rtshcua.ground.geometry.shapes import Shape, shape_of
from rtshcua.ground.geometry.survey import (
    ALL_PATTERNS,
    AROUND,
    DEFAULT_PATTERN,
    LINE_PATTERNS,
    NO_AIM,
    PathAim,
    likely_spacings,
    survey,
)
from rtshcua.model.flat.contract import CHOICE, QUANTITY, ZONE, Facing, MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.quantity import Dimension


class PlannedPath(NamedTuple):
    """The path that the planner computes instead of a signed one.

    `points` is the number of its corners (0: no path), `length` its length in mm, and `apart` the Hausdorff distance of
    the two paths in mm. `levels`: the signed path has the same places in the same order, at other heights or headings.
    `computable` is false for a path that a bundle does not suffice to compute.
    """

    points: int
    length: int
    apart: int
    levels: bool = False
    computable: bool = True


def path_planned_otherwise(policy: Policy, one: Invocation) -> PlannedPath | None:
    """Return the planner's path for a step of a well-formed mission if it differs from the signed path, else None."""
    if one.plan.kind != MotionKind.COVER:
        return None
    signed = LevelledPath(_signed(one), one.plan.heights, one.plan.headings)
    found: tuple[Point, ...] | None = None
    computable = True
    for pattern in _patterns(policy, one):
        computable = pattern not in LINE_PATTERNS
        for aim in _aims(policy, one, pattern) if computable else ():
            ways = _ways(policy, one, pattern, aim)
            if signed in ways:
                return None
            if signed.points in (way.points for way in ways):
                return PlannedPath(len(signed.points), path_length(signed.points), 0, levels=True)
            found = ways[0].points if ways and found is None else found
    if found is None:
        return PlannedPath(0, 0, 0, computable=computable)
    return PlannedPath(len(found), path_length(found), _apart(signed.points, found))


def other_spacing(policy: Policy, one: Invocation) -> int | None:
    """Return the distance of the lines of a signed grid in mm, if the height does not give it: then a camera may.

    For a single line it is the width of the area.
    """
    if one.plan.kind != MotionKind.COVER or DEFAULT_PATTERN not in _patterns(policy, one):
        return None
    for aim in _aims(policy, one, DEFAULT_PATTERN):
        if _signed(one) in (way.points for way in _ways(policy, one, DEFAULT_PATTERN, aim)):
            return aim.spacing or None
    return None


def _signed(one: Invocation) -> tuple[Point, ...]:
    return tuple(zip(one.plan.path[::2], one.plan.path[1::2], strict=True))


def _ways(policy: Policy, one: Invocation, pattern: str, aim: PathAim) -> list[LevelledPath]:
    """Return the planner's path at the signed heights, from each of its ends; empty if the area has none."""
    once = _survey(policy, one, pattern, aim)
    heights, faces = tuple(dict.fromkeys(one.plan.heights)), one.contract.motion.facing == Facing.INWARD
    rounds = (once, once[::-1]) if once else ()
    return [levelled(each, heights, inward(each) if faces else ()) for each in rounds]


def _patterns(policy: Policy, one: Invocation) -> Iterator[str]:
    """Yield the possible patterns of a step.

    The flat form does not mark the parameter of the pattern, so each choice among only patterns counts. Without such a
    parameter, the pattern is the default.
    """
    choices = [
        parameter
        for parameter in policy.contracts[one.skill].parameters
        if parameter.kind == CHOICE and set(parameter.labels) <= set(ALL_PATTERNS)
    ]
    if not choices:
        yield DEFAULT_PATTERN
    for parameter in choices:
        value = one.arguments[parameter.cell]
        if parameter.low <= value <= parameter.high:
            yield parameter.labels[value]


def _aims(policy: Policy, one: Invocation, pattern: str) -> Iterator[PathAim]:
    """Yield the possible aims of a step: the spacing by its height, those by a camera, or each length as a distance."""
    if pattern == AROUND:
        for parameter in policy.contracts[one.skill].parameters:
            if parameter.kind == QUANTITY and parameter.dimension == Dimension.LENGTH.value:
                yield PathAim(distance=one.arguments[parameter.cell])
        return
    yield NO_AIM
    shape = _shape(policy, one)
    if pattern == "grid" and shape is not None:
        begin = (one.plan.path[0], one.plan.path[1])
        for spacing in likely_spacings(shape, policy.vehicle.position_error, begin):
            yield PathAim(spacing=spacing)


def _shape(policy: Policy, one: Invocation) -> Shape | None:
    number = one.arguments[first_cell(one.contract, ZONE)]
    return shape_of(policy.zones[number]) if 0 <= number < policy.declared else None


def _survey(policy: Policy, one: Invocation, pattern: str, aim: PathAim) -> tuple[Point, ...] | None:
    shape = _shape(policy, one)
    if shape is None:
        return None
    return survey(shape, pattern, one.plan.lowest, policy.vehicle.position_error, None, aim)


def _apart(one: tuple[Point, ...], other: tuple[Point, ...]) -> int:
    import shapely  # noqa: PLC0415  it is slow to import

    lines = [shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0]) for points in (one, other)]
    return round(float(shapely.hausdorff_distance(*lines)))
