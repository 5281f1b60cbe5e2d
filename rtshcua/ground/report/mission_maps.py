"""Drawings of checked missions: the zones, the planned way, its heights, and the places where it fails.

`mission_map_page` is the page of `rtshcua check --map`, and `mission_picture` the picture of `--picture`. Both include
refused missions if their path is planned.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from rtshcua.decision.values import AND, FALSE, TRUE, Truth
from rtshcua.decision.zones import PreparedZone
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.drawing.drawn_site import LeftAirspace, PlannedLeg, RefusedParts, planned_legs
from rtshcua.ground.drawing.flat_site import site_of, way_of
from rtshcua.ground.drawing.height_profile import HeightProfile, planned_heights
from rtshcua.ground.drawing.html import rendered
from rtshcua.ground.drawing.picture import PictureSheet, picture
from rtshcua.ground.drawing.zone_map import ZoneMap, mission_map
from rtshcua.ground.pipeline.program import PlannedMission
from rtshcua.ground.report.chapter import elevation_of, mission_view
from rtshcua.ground.report.html_page import PACKAGE
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Node

#: the number of places of a leg that are checked
_PLACES = 400

Point = tuple[int, int]


@dataclass(frozen=True, slots=True)
class StepFindings:
    """The description of a step, and its findings."""

    number: int
    told: str
    found: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class MissionDrawing:
    """A mission with its map and its side view."""

    name: str
    intent: str
    under: str
    refused: bool
    plan: ZoneMap
    side: HeightProfile
    steps: tuple[StepFindings, ...]


class CheckedMissions:
    """The planned missions of a program, with all its findings and its sources."""

    def __init__(
        self, sources: Mapping[str, Source], planned: Sequence[PlannedMission], found: Sequence[Diagnostic]
    ) -> None:
        self._sources, self._planned, self._found = sources, planned, found

    @property
    def count(self) -> int:
        """The number of missions."""
        return len(self._planned)

    def drawings(self) -> Iterator[MissionDrawing]:
        """Yield the drawings of each mission."""
        for under, mission, declaration in self._planned:
            policy = under.policy
            view = mission_view(mission, policy, None, {})
            written = [step for phase in declaration.phases for step in phase.steps]
            of = [[each for each in self._found if _is_within(each, step)] for step in written]
            wrong = frozenset(number for number, some in enumerate(of, 1) if any(map(_is_error, some)))
            site, way = site_of(policy, elevation_of(under)), way_of(mission)
            legs = tuple(planned_legs(way, site))
            refused = RefusedParts(wrong, tuple(_left(policy, [leg for leg in legs if leg.step.number in wrong])))
            yield MissionDrawing(
                name=mission.name,
                intent=mission.intent,
                under=f"{policy.name}@{policy.version} for {policy.vehicle.identity}",
                refused=any(_is_error(each) for each in self._found if not self._is_of_another(each, declaration)),
                plan=mission_map(site, way, refused),
                side=planned_heights(site, way, refused),
                steps=tuple(
                    StepFindings(step.number, step.told, tuple(map(self._words, some)))
                    for step, some in zip(view.steps, of, strict=True)
                ),
            )

    def _is_of_another(self, found: Diagnostic, declaration: MissionDecl) -> bool:
        """Whether a finding is within another mission."""
        others = (each.declaration for each in self._planned if each.declaration is not declaration)
        return any(_is_within(found, other) for other in others)

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


def mission_map_page(checked: Sequence[CheckedMissions]) -> str:
    """Render the page. The same sources give the same bytes."""
    drawings = [each for one in checked for each in one.drawings()]
    refused = sum(each.refused for each in drawings)
    return rendered(
        PACKAGE,
        "checked.html",
        drawings=drawings,
        others=_others(checked),
        summary=f"Missions that are drawn: {len(drawings)}; of these refused: {refused}",
    )


def mission_picture(checked: Sequence[CheckedMissions]) -> str:
    """Write the picture: the missions one below the other, and then the findings outside of their steps."""
    drawings = [each for one in checked for each in one.drawings()]
    sheets = [_sheet(each) for each in drawings]
    others = tuple(_others(checked))
    if not sheets:
        sheets.append(PictureSheet("No mission is drawn", ("No way of a mission could be planned.",), below=others))
    elif others:
        sheets.append(PictureSheet("What else was found", others))
    return picture(", ".join(each.name for each in drawings) or "No mission is drawn", sheets)


def _sheet(drawing: MissionDrawing) -> PictureSheet:
    found = (f"Step {step.number}: {text}" for step in drawing.steps for text in step.found)
    return PictureSheet(
        title=f"{drawing.name}: {'refused' if drawing.refused else 'no errors'}",
        above=(f"Under {drawing.under}.", *([drawing.intent] if drawing.intent else [])),
        plan=drawing.plan,
        side=drawing.side,
        below=tuple(found),
    )


def _others(checked: Sequence[CheckedMissions]) -> list[str]:
    return list(dict.fromkeys(text for one in checked for text in one.others()))


def _is_within(found: Diagnostic, node: Node) -> bool:
    span = found.span
    return (
        span is not None and span.file == node.span.file and node.span.start <= span.start and span.end <= node.span.end
    )


def _is_error(found: Diagnostic) -> bool:
    return found.severity is Severity.ERROR


def _left(policy: Policy, legs: Sequence[PlannedLeg]) -> Iterator[LeftAirspace]:
    """The first place outside the airspace of each step that has one."""
    keeps = _Airspace(policy)
    seen: set[int] = set()
    for leg in legs:
        number = leg.step.number
        if number in seen:
            continue
        left = next((place for place in _points_along(leg.begin[:2], leg.end[:2]) if not keeps(place, leg)), None)
        if left is not None:
            seen.add(number)
            yield LeftAirspace(number, *left)


def _points_along(one: Point, other: Point) -> Iterator[Point]:
    for part in range(_PLACES + 1):
        yield (
            one[0] + (other[0] - one[0]) * part // _PLACES,
            one[1] + (other[1] - one[1]) * part // _PLACES,
        )


class _Airspace:
    """Whether a place of a leg is within the airspace at all times and at all its heights, including the vehicle's
    position error.
    """

    def __init__(self, policy: Policy) -> None:
        stated, error = policy.airspace, policy.vehicle.position_error
        self._box = (-error, -error, error, error)
        self._inside, self._outside = (
            tuple(PreparedZone(number, policy.zones[number]) for number in numbers)
            for numbers in (((), ()) if stated is None else (stated.inside, stated.outside))
        )

    def __call__(self, place: Point, leg: PlannedLeg) -> bool:
        inside = (self._there(zone, place, leg) for zone in self._inside)
        outside = (self._there(zone, place, leg) for zone in self._outside)
        return all(truth == TRUE for truth in inside) and all(truth == FALSE for truth in outside)

    def _there(self, zone: PreparedZone, place: Point, leg: PlannedLeg) -> Truth:
        return AND[zone.between(leg.low, leg.high)][zone.along(place, self._box)]
