"""What a `cover` step flies: its area, its pattern, and the spacing of its lines by the overlap of its pictures."""

from collections.abc import Sequence
from typing import NamedTuple

from rtshcua.ground.checker.context import Bound
from rtshcua.ground.geometry.cameras import SurveyCamera, apart
from rtshcua.ground.geometry.inspection import CentreLine, face_heading
from rtshcua.ground.geometry.levels import inward
from rtshcua.ground.geometry.polygons import Point
from rtshcua.ground.geometry.shapes import Shape
from rtshcua.ground.geometry.survey import (
    AROUND,
    DEFAULT_PATTERN,
    LINE_PATTERNS,
    SIDEWAYS,
    PathAim,
    structure_of,
    survey,
)
from rtshcua.ground.lower.zones import ZoneTable
from rtshcua.model.ir.places import CameraDecl, Corridor, VehicleDecl, ZoneDecl
from rtshcua.model.ir.skills import PicturesDecl, SkillDecl


def camera_named(vehicle: VehicleDecl, pictures: PicturesDecl | None) -> CameraDecl | None:
    """Return the camera of a vehicle that takes these pictures; None if there is none."""
    name = "" if pictures is None else pictures.camera.text
    return next((each for each in vehicle.cameras if each.name.text == name), None)


def survey_camera(declared: CameraDecl, pattern: str) -> SurveyCamera:
    """Return a camera as it is carried along a pattern.

    The width of the sensor is across the flight of a camera that looks down, and along it of one that looks sideways;
    the other way round if the camera is mounted portrait.
    """
    width = declared.width.value, declared.columns.value
    height = declared.height.value, declared.rows.value
    along, across = (width, height) if (pattern in SIDEWAYS) != declared.portrait else (height, width)
    return SurveyCamera(
        along[0], across[0], along[1], across[1],
        declared.focal.value, declared.interval.value, declared.exposure.value,
    )  # fmt: skip


class SurveyPlan(NamedTuple):
    """A survey with its arguments: heights and distances in mm. `missing` is what the area lacks for the pattern.

    `levels_apart` is the greatest distance of two heights at which the pictures of a face or a structure overlap to the
    side as stated; None if nothing is stated.
    """

    zone: ZoneDecl
    shape: Shape
    pattern: str
    height: int
    aim: PathAim
    start: Point | None
    camera: SurveyCamera | None
    missing: str
    levels_apart: int | None

    def path(self, inset: int) -> tuple[Point, ...] | None:
        """Return the points of the path; None if the area is too small."""
        return survey(self.shape, self.pattern, self.height, inset, self.start, self.aim)

    def facing(self, points: Sequence[Point]) -> tuple[int, ...]:
        """Return the heading at each point of the path to what it looks at, in 1/100 degree: to the face beside it, or
        to its middle.
        """
        line = self.aim.line
        if self.pattern == "face" and line is not None:
            return (face_heading(line.points[0], line.points[-1]),) * len(points)
        return inward(points)


def survey_plan(
    skill: SkillDecl, bound: Sequence[Bound], height: int, zones: ZoneTable, vehicle: VehicleDecl
) -> SurveyPlan:
    """Return the survey of a call of a `cover` skill, at a height in mm above home."""
    motion, pictures = skill.motion, skill.pictures
    assert motion is not None
    assert motion.target is not None
    given = {parameter.name.text: value for parameter, value in zip(skill.parameters, bound, strict=True)}
    zone = given[motion.target.text]
    assert isinstance(zone, ZoneDecl)
    pattern = DEFAULT_PATTERN if motion.pattern is None else chosen(skill, motion.pattern.text, given)
    away = 0 if motion.distance is None else given[motion.distance.text]
    assert isinstance(away, int)
    shape = zones.regions[zones.index[zone.name.text]].shape
    line = _line(zone, pattern, zones)
    declared = camera_named(vehicle, pictures)
    camera = None if declared is None else survey_camera(declared, pattern)
    aim = PathAim(line, away, 0 if camera is None or pictures is None else _spacing(camera, pictures, pattern, height))
    start = None if zone.entry is None else zones.place(zone.entry)
    return SurveyPlan(
        zone,
        shape,
        pattern,
        height,
        aim,
        start,
        camera,
        _missing(pattern, line, shape),
        _levels_apart(camera, pictures, pattern, away),
    )


def _missing(pattern: str, line: CentreLine | None, shape: Shape) -> str:
    """Return what an area lacks for a pattern, in words; empty if nothing."""
    if pattern in LINE_PATTERNS and line is None:
        return "is not a `corridor`, so it has no centre line"
    if pattern == "face" and line is not None and len(line.points) != 2:
        return "has a bend, and a face is straight"
    if pattern == AROUND and structure_of(shape) is None:
        return "has no single hole, in which the structure is"
    return ""


def _spacing(camera: SurveyCamera, pictures: PicturesDecl, pattern: str, height: int) -> int:
    """Return the greatest distance of lines in mm that keeps the overlap to the side; 0 if none is stated."""
    if pictures.side is None or pattern in SIDEWAYS:
        return 0
    return max(apart(camera.shows_across(height - relief_of(pictures)), pictures.side.value), 1)


def _levels_apart(
    camera: SurveyCamera | None, pictures: PicturesDecl | None, pattern: str, distance: int
) -> int | None:
    """Return the greatest distance of heights in mm that keeps the overlap to the side; None if none is stated."""
    if camera is None or pictures is None or pictures.side is None or pattern not in SIDEWAYS:
        return None
    return apart(camera.shows_across(distance), pictures.side.value)


def relief_of(pictures: PicturesDecl) -> int:
    """Return how far the ground may lie above or below home, in mm."""
    return 0 if pictures.relief is None else pictures.relief.value


def chosen(skill: SkillDecl, parameter: str, given: dict[str, Bound]) -> str:
    """Return the name of a choice."""
    ordinal = given[parameter]
    assert isinstance(ordinal, int)
    return next(each for each in skill.parameters if each.name.text == parameter).choices[ordinal].text


def _line(zone: ZoneDecl, pattern: str, zones: ZoneTable) -> CentreLine | None:
    """Return the centre line of a corridor for the patterns that follow one."""
    if pattern not in LINE_PATTERNS or not isinstance(zone.shape, Corridor):
        return None
    places = [zones.place(each) for each in zone.shape.points]
    return CentreLine(tuple(each for each in places if each is not None), zone.shape.width.value // 2)
