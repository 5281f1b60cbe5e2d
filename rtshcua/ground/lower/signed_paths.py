"""Compare the signed survey path of a step with the path that the planner computes.

On board, only the containment of the path in its zone is checked, so the signer of a mission may choose any path there.
The planner computes one path from skill, zone and arguments. Its start does not count, because a bundle does not carry
the zone's entry: the reversed path is the same path.
"""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.contracts import first_cell
from rtshcua.ground.geometry.levels import LevelledPath, inward, levelled
from rtshcua.ground.geometry.polygons import Point, path_length
from rtshcua.ground.geometry.shapes import shape_of
from rtshcua.ground.geometry.survey import DEFAULT_PATTERN, PATTERNS, survey
from rtshcua.model.flat.contract import CHOICE, ZONE, Facing, MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy


class PlannedPath(NamedTuple):
    """The path that the planner computes instead of a signed one.

    `points` is the number of its corners (0: no path), `length` its length in mm, and `apart` the Hausdorff distance of
    the two paths in mm. `levels`: the signed path has the same places in the same order, at other heights or headings.
    """

    points: int
    length: int
    apart: int
    levels: bool = False


def path_planned_otherwise(policy: Policy, one: Invocation) -> PlannedPath | None:
    """Return the planner's path for a step of a well-formed mission if it differs from the signed path, else None."""
    if one.plan.kind != MotionKind.COVER:
        return None
    signed = tuple(zip(one.plan.path[::2], one.plan.path[1::2], strict=True))
    its = LevelledPath(signed, one.plan.heights, one.plan.headings)
    heights, faces = tuple(dict.fromkeys(one.plan.heights)), one.contract.motion.facing == Facing.INWARD
    found: tuple[Point, ...] | None = None
    for pattern in _patterns(policy, one):
        once = _survey(policy, one, pattern)
        rounds = (once, once[::-1]) if once else ()
        ways = [levelled(each, heights, inward(each) if faces else ()) for each in rounds]
        if its in ways:
            return None
        if signed in (way.points for way in ways):
            return PlannedPath(len(signed), path_length(signed), 0, levels=True)
        found = ways[0].points if ways else None
    return PlannedPath(0, 0, 0) if found is None else PlannedPath(len(found), path_length(found), _apart(signed, found))


def _patterns(policy: Policy, one: Invocation) -> Iterator[str]:
    """Yield the possible patterns of a step.

    The flat form does not mark the parameter of the pattern, so each choice among only patterns counts. Without such a
    parameter, the pattern is the default.
    """
    choices = [
        parameter
        for parameter in policy.contracts[one.skill].parameters
        if parameter.kind == CHOICE and set(parameter.labels) <= PATTERNS.keys()
    ]
    if not choices:
        yield DEFAULT_PATTERN
    for parameter in choices:
        value = one.arguments[parameter.cell]
        if parameter.low <= value <= parameter.high:
            yield parameter.labels[value]


def _survey(policy: Policy, one: Invocation, pattern: str) -> tuple[Point, ...] | None:
    number = one.arguments[first_cell(one.contract, ZONE)]
    shape = shape_of(policy.zones[number]) if 0 <= number < policy.declared else None
    if shape is None:
        return None
    return survey(shape, pattern, one.plan.lowest, policy.vehicle.position_error, None)


def _apart(one: tuple[Point, ...], other: tuple[Point, ...]) -> int:
    import shapely  # noqa: PLC0415  it is slow to import

    lines = [shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0]) for points in (one, other)]
    return round(float(shapely.hausdorff_distance(*lines)))
