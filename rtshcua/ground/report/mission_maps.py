"""The HTML page of checked missions: the zones, the planned path, and the places where it fails.

The page includes refused missions if their path is planned.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from rtshcua.decision.values import AND, FALSE, TRUE, Truth
from rtshcua.decision.zones import PreparedZone
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.drawing.html import rendered
from rtshcua.ground.drawing.zone_map import ZoneMap, mission_map
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.program import PlannedMission
from rtshcua.ground.report.chapter import chapter, mission_view
from rtshcua.ground.report.html_page import PACKAGE
from rtshcua.ground.report.report_model import Chapter
from rtshcua.ground.report.reported_policy import ReportedPolicy
from rtshcua.model.flat import mission as flat
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.node import Node

#: the number of places of a leg that are checked
_PLACES = 400

Point = tuple[int, int]


@dataclass(frozen=True, slots=True)
class RefusedLegs:
    """The refused parts of a map: legs in mm, y to the south, as SVG paths; and marks on the page."""

    legs: tuple[str, ...]
    marks: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class StepFindings:
    """The description of a step, and its findings."""

    told: str
    found: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class MissionMap:
    """A mission with its map."""

    name: str
    intent: str
    refused: bool
    chapter: Chapter
    plan: ZoneMap
    failed: RefusedLegs
    steps: tuple[StepFindings, ...]


class CheckedProgram:
    """A program with its planned missions and all findings."""

    def __init__(self, program: Program, planned: Sequence[PlannedMission], found: Sequence[Diagnostic]) -> None:
        self._program, self._planned, self._found = program, planned, found
        self._sources: Mapping[str, Source] = program.sources

    def drawings(self) -> Iterator[MissionMap]:
        """Yield the map of each mission."""
        for under, mission, declaration in self._planned:
            subject = ReportedPolicy(self._program, under)
            view, about = mission_view(mission, under.policy, None, {}), chapter(subject)
            plan = mission_map(about.site, view.way)
            written = [step for phase in declaration.phases for step in phase.steps]
            of = [[each for each in self._found if _is_within(each, step)] for step in written]
            errors = [any(map(_is_error, some)) for some in of]
            failed = _failed(under.policy, [each.plan for each in mission.invocations], errors, plan)
            yield MissionMap(
                name=mission.name,
                intent=mission.intent,
                refused=any(errors) or any(_is_error(each) for each in self._found),
                chapter=about,
                plan=plan,
                failed=failed,
                steps=tuple(
                    StepFindings(step.told, tuple(map(self._words, some)))
                    for step, some in zip(view.steps, of, strict=True)
                ),
            )

    def others(self) -> list[str]:
        """The findings outside the drawn steps."""
        steps = [step for each in self._planned for phase in each.declaration.phases for step in phase.steps]
        return [self._words(each) for each in self._found if not any(_is_within(each, step) for step in steps)]

    def _words(self, found: Diagnostic) -> str:
        at = ""
        if found.span is not None and found.span.file in self._sources:
            at = f"{found.span.file}:{self._sources[found.span.file].position(found.span.start).line}: "
        help = f"; {found.help}" if found.help else ""
        return f"{at}{found.severity.value} {found.code.id}: {found.message}{help}"


def mission_map_page(checkings: Sequence[CheckedProgram]) -> str:
    """Render the page. The same sources give the same bytes."""
    drawings = [each for checking in checkings for each in checking.drawings()]
    others = list(dict.fromkeys(text for checking in checkings for text in checking.others()))
    refused = sum(each.refused for each in drawings)
    return rendered(
        PACKAGE,
        "checked.html",
        drawings=drawings,
        others=others,
        summary=f"Missions that are drawn: {len(drawings)}; of these refused: {refused}",
    )


def _is_within(found: Diagnostic, node: Node) -> bool:
    span = found.span
    return (
        span is not None and span.file == node.span.file and node.span.start <= span.start and span.end <= node.span.end
    )


def _is_error(found: Diagnostic) -> bool:
    return found.severity is Severity.ERROR


def _failed(policy: Policy, plans: Sequence[flat.Plan], errors: Sequence[bool], drawn: ZoneMap) -> RefusedLegs:
    """The legs of the refused steps, and the first place of each outside the airspace."""
    keeps = _Airspace(policy)
    legs: list[str] = []
    marks: list[tuple[float, float]] = []
    here, height = (0, 0), 0
    for plan, wrong in zip(plans, errors, strict=True):
        points = [here, *zip(plan.path[::2], plan.path[1::2], strict=True)]
        if plan.kind == MotionKind.CLIMB or plan.path:
            height = plan.altitude or height
        if wrong and len(points) > 1:
            legs.append("M" + "L".join(f"{x} {-y}" for x, y in points))
        left = next(
            (place for leg in pairwise(points) for place in _points_along(*leg) if not keeps(place, height)), None
        )
        if wrong and left is not None:
            marks.append(drawn.at(*left))
        here = points[-1]
    return RefusedLegs(tuple(legs), tuple(marks))


def _points_along(one: Point, other: Point) -> Iterator[Point]:
    for part in range(_PLACES + 1):
        yield (
            one[0] + (other[0] - one[0]) * part // _PLACES,
            one[1] + (other[1] - one[1]) * part // _PLACES,
        )


class _Airspace:
    """Whether a place is within the airspace at all times, including the vehicle's position error."""

    def __init__(self, policy: Policy) -> None:
        stated, error = policy.airspace, policy.vehicle.position_error
        self._box = (-error, -error, error, error)
        self._inside, self._outside = (
            tuple(PreparedZone(number, policy.zones[number]) for number in numbers)
            for numbers in (((), ()) if stated is None else (stated.inside, stated.outside))
        )

    def __call__(self, place: Point, height: int) -> bool:
        inside = (self._there(zone, place, height) for zone in self._inside)
        outside = (self._there(zone, place, height) for zone in self._outside)
        return all(truth == TRUE for truth in inside) and all(truth == FALSE for truth in outside)

    def _there(self, zone: PreparedZone, place: Point, height: int) -> Truth:
        return AND[zone.between(height, height)][zone.along(place, self._box)]
