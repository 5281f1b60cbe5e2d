"""Read the surveys of a plan of QGroundControl: the area, the camera, the overlap and the options of a survey, a
corridor scan or a structure scan.

https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. What is not read here is no error: then
the legs that the planner saved are all that is known of a survey, and `NoSurvey` says why.
"""

from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import Any, Final, NamedTuple

from rtshcua.ground.checker.geojson import Number

SURVEY, CORRIDOR, STRUCTURE = "survey", "CorridorScan", "StructureScan"
#: the complex items whose planned legs are in the file
TRANSECTS: Final = (SURVEY, CORRIDOR)
_STRUCTURE_VERSION: Final = 3
#: the most corners of an area, and the most surveys of a plan, that are written as steps
MOST_CORNERS, MOST_SURVEYS = 200, 16
_FEWEST: Final = {SURVEY: 3, CORRIDOR: 2, STRUCTURE: 3}
#: what a length in m and a length on a sensor in um may be at most; the most pixels of a side; the longest interval, s
_MOST_M, _MOST_UM, _MOST_PIXELS, _LONGEST_S = 10_000, 1_000_000, 1_000_000, 60


class NoSurvey(Exception):
    """Why a survey is known by its legs alone."""


class PlannedCamera(NamedTuple):
    """A camera: its name, the extents of its sensor and the focal length in um, its pixels, whether it is turned by a
    quarter, and its shortest interval in ms; 0 if none is stated.
    """

    name: str
    width: int
    height: int
    focal: int
    pixels_wide: int
    pixels_high: int
    portrait: bool
    interval_ms: int


class QgcSurvey(NamedTuple):
    """A survey: its kind, its place in the file, the corners of the area, or the line of a corridor with its width (in
    1e-7 degree, latitude first; mm), and its camera. `distance` is that to what is seen, `side` and `frontal` the
    distances of lines and of pictures (of layers and of pictures for a structure), mm; the overlaps are in 1/10000.
    `options` are those that the planner's legs have.
    """

    kind: str
    place: str
    corners: tuple[tuple[int, int], ...]
    width: int
    camera: PlannedCamera
    distance: int
    side: int
    frontal: int
    side_overlap: int
    frontal_overlap: int
    angle: Decimal
    turnaround: Decimal
    stops: bool
    #: of a structure: the lowest height and the top of the scan, the height of the way to it, in mm; and the layers
    bottom: int = 0
    top: int = 0
    entrance: int = 0
    layers: int = 1
    from_top: bool = False
    pitch: Decimal = Decimal(0)


def read_survey(item: Mapping[str, Any], place: str) -> QgcSurvey:
    """Read a complex item. Raises `NoSurvey`."""
    kind = str(item["complexItemType"])
    if kind not in _FEWEST:
        raise NoSurvey("no skill flies it")
    transects = item.get("TransectStyleComplexItem")
    legs = transects if isinstance(transects, dict) else {}
    figures = legs.get("CameraCalc", item.get("CameraCalc"))
    if not isinstance(figures, dict):
        raise NoSurvey("its camera is not in the file")
    _only_what_is_covered(item, legs)
    corners = tuple(_corner(each) for each in _list(item.get("polyline" if kind == CORRIDOR else "polygon")))
    if len(corners) < _FEWEST[kind]:
        raise NoSurvey("its area is not in the file")
    if len(corners) > MOST_CORNERS:
        raise NoSurvey(f"its area has more than {MOST_CORNERS} corners")
    found = QgcSurvey(
        kind, place, corners, _mm(item, "CorridorWidth") if kind == CORRIDOR else 0, _camera(figures),
        _mm(figures, "DistanceToSurface"), _mm(figures, "AdjustedFootprintSide"),
        _mm(figures, "AdjustedFootprintFrontal"), _share(figures, "SideOverlap"), _share(figures, "FrontalOverlap"),
        _told(item, "angle"), _told(legs, "TurnAroundDistance"), legs.get("HoverAndCapture") is True,
    )  # fmt: skip
    return _structure(found, item) if kind == STRUCTURE else found


def _only_what_is_covered(item: Mapping[str, Any], legs: Mapping[str, Any]) -> None:
    """Refuse what no path over an area at one height does."""
    if legs.get("FollowTerrain") is True:
        raise NoSurvey("it follows terrain")
    if legs.get("Refly90Degrees") is True:
        raise NoSurvey("it is flown a second time, across the first lines")
    if item["complexItemType"] == STRUCTURE and item.get("version") != Number(str(_STRUCTURE_VERSION)):
        raise NoSurvey(f"its version is not {_STRUCTURE_VERSION}")


def _structure(survey: QgcSurvey, item: Mapping[str, Any]) -> QgcSurvey:
    layers = _figure(item, "Layers", 256)
    if layers != layers.to_integral_value():
        raise NoSurvey("`Layers` is not a whole number")
    bottom = _optional(item, "ScanBottomAlt")
    if not 0 <= bottom <= _MOST_M:
        raise NoSurvey("`ScanBottomAlt` is out of range")
    return survey._replace(
        bottom=round(bottom * 1000), top=_mm(item, "StructureHeight"), entrance=_mm(item, "EntranceAltitude"),
        layers=int(layers), from_top=item.get("StartFromTop") is True, pitch=_told(item, "GimbalPitch"),
    )  # fmt: skip


def _camera(figures: Mapping[str, Any]) -> PlannedCamera:
    name = figures.get("CameraName")
    if not isinstance(name, str) or "SensorWidth" not in figures:
        raise NoSurvey("its camera has no figures")
    wide, high, focal = (
        round(_figure(figures, each, _MOST_UM // 1000) * 1000)
        for each in ("SensorWidth", "SensorHeight", "FocalLength")
    )
    pixels = [_figure(figures, each, _MOST_PIXELS) for each in ("ImageWidth", "ImageHeight")]
    if min(wide, high, focal) < 1 or any(each != each.to_integral_value() for each in pixels):
        raise NoSurvey("its camera has no figures")
    interval = _optional(figures, "MinTriggerInterval")
    if not 0 <= interval <= _LONGEST_S:
        raise NoSurvey("`MinTriggerInterval` is out of range")
    portrait = figures.get("Landscape") is False
    return PlannedCamera(name, wide, high, focal, int(pixels[0]), int(pixels[1]), portrait, -round(-interval * 1000))


def _corner(written: Any) -> tuple[int, int]:
    pair = _list(written)
    if len(pair) < 2 or not all(isinstance(each, Number) for each in pair[:2]):
        raise NoSurvey("its area is not in the file")
    latitude, longitude = (Decimal(each.text) for each in pair[:2])
    if abs(latitude) > 90 or abs(longitude) > 180:
        raise NoSurvey("its area is not on the globe")
    return round(latitude * 10_000_000), round(longitude * 10_000_000)


def _list(value: Any) -> Sequence[Any]:
    return value if isinstance(value, list) else ()


def _mm(of: Mapping[str, Any], name: str) -> int:
    """A length of at least 1 mm, in mm."""
    length = int(_figure(of, name, _MOST_M) * 1000)
    if length < 1:
        raise NoSurvey(f"`{name}` is out of range")
    return length


def _share(of: Mapping[str, Any], name: str) -> int:
    """A percentage in 1/10000."""
    share = _optional(of, name)
    if name not in of or not 0 <= share < 100:
        raise NoSurvey(f"`{name}` is no share")
    return int(share * 100)


def _figure(of: Mapping[str, Any], name: str, most: int) -> Decimal:
    """A positive number."""
    figure = _optional(of, name)
    if not 0 < figure <= most:
        raise NoSurvey(f"`{name}` is out of range" if name in of else f"`{name}` is not in the file")
    return figure


def _told(of: Mapping[str, Any], name: str) -> Decimal:
    """A number that is only shown, to a hundredth."""
    value = _optional(of, name)
    if abs(value) > _MOST_M:
        raise NoSurvey(f"`{name}` is out of range")
    return round(value, 2).normalize()


def _optional(of: Mapping[str, Any], name: str) -> Decimal:
    """A number; 0 if there is none."""
    value = of.get(name)
    if value is None:
        return Decimal(0)
    if not isinstance(value, Number):
        raise NoSurvey(f"`{name}` is not a number")
    return Decimal(value.text)
