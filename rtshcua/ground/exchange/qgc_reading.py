"""Read a plan of QGroundControl (`.plan`): the items of its mission, its fence and its rally points.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. A survey or a corridor scan is
read from the items that the planner made of it. What each item means is the subject of `plan_steps`.
"""

from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any, Final, NamedTuple

from rtshcua.ground.checker.geojson import GeoPolygon, NoArea, Number, polygon_of, read_json
from rtshcua.ground.exchange.losses import Loss, NotKept, NotReadable
from rtshcua.ground.exchange.qgc_surveys import MOST_SURVEYS, TRANSECTS, NoSurvey, QgcSurvey, read_survey
from rtshcua.mavlink import dialect

ARDUPILOT_PLAN: Final = 3  # MAV_AUTOPILOT_ARDUPILOTMEGA
#: the versions of the parts of a plan that are read
_MISSION_VERSION: Final = 2
_FENCE_VERSIONS: Final = (1, 2)
#: what a number of a plan may be at most: more is no degree, metre or second
_MOST: Final = Decimal(10) ** 9
_PARAMETERS: Final = 7
_NO_LEGS: Final = "open the plan in QGroundControl and save it again, or fly the legs as waypoints"


class QgcItem(NamedTuple):
    """A simple item: its place in the file, the command and its seven parameters as written (None: null), the frame,
    the altitude mode (0: not given), the height that the planner shows, and whether the mission goes on by itself.
    `of` is the kind of the complex item that it belongs to, `jump_id` the number by which a jump names it (0: none).
    """

    place: str
    command: int
    frame: int
    params: tuple[Decimal | None, ...]
    mode: int = 0
    height: Decimal | None = None
    goes_on: bool = True
    of: str = ""
    jump_id: int = 0


class QgcFence(NamedTuple):
    """An area of the fence: a polygon, or a circle with its centre in 1e-7 degree (latitude first) and radius in mm."""

    place: str
    inclusion: bool
    polygon: GeoPolygon | None
    centre: tuple[int, int] = (0, 0)
    radius_mm: int = 0


class QgcPlan(NamedTuple):
    """A plan. `home` is in 1e-7 degree, latitude first, `home_above_sea` in mm; None without one. `speed` is the hover
    speed for which the planner computed times.
    """

    firmware: int
    vehicle_type: int
    home: tuple[int, int] | None
    home_above_sea: int | None
    speed: Decimal | None
    items: tuple[QgcItem, ...]
    fences: tuple[QgcFence, ...]
    losses: tuple[Loss, ...]
    not_kept: tuple[NotKept, ...]
    #: what is known of the surveys besides their legs, or why nothing is, by their places
    surveys: Mapping[str, QgcSurvey | str] = {}

    @property
    def is_ardupilot(self) -> bool:
        """Whether it is for ArduPilot, which reads an unset parameter as 0."""
        return self.firmware == ARDUPILOT_PLAN


def read_plan_file(data: bytes) -> QgcPlan:
    """Read a plan. Raises `NotReadable`."""
    try:
        tree = read_json(data)
    except NoArea as error:
        raise NotReadable(error.message, error.help or "") from None
    if not isinstance(tree, dict) or tree.get("fileType") != "Plan":
        raise NotReadable('it is no plan of QGroundControl: `/fileType` is not "Plan"')
    return _Reading(tree).plan()


def command_name(command: int) -> str:
    """The name of a MAV_CMD, without the prefix; its number if the dialect has none."""
    names = dialect.load().enums["MAV_CMD"]
    return next((name.removeprefix("MAV_CMD_") for name, value in names.items() if value == command), str(command))


class _Reading:
    """The reading of one plan."""

    def __init__(self, tree: dict[str, Any]) -> None:
        self._tree = tree
        self._losses: list[Loss] = []
        self._not_kept: list[NotKept] = []
        self._surveys: dict[str, QgcSurvey | str] = {}

    def plan(self) -> QgcPlan:
        version = _whole(self._tree.get("version", Number("1")), "/version")
        if version != 1:
            raise NotReadable(f"`/version` is {version}; only 1 is read")
        mission = _object(self._tree.get("mission", {}), "/mission")
        items: tuple[QgcItem, ...] = ()
        if mission:
            version = _whole(mission.get("version", Number("1")), "/mission/version")
            if version != _MISSION_VERSION:
                raise NotReadable(
                    f"`/mission/version` is {version}; only {_MISSION_VERSION} is read",
                    "open the plan in a current QGroundControl and save it again",
                )
            items = tuple(self._items(_array(mission.get("items", []), "/mission/items")))
        home = mission.get("plannedHomePosition")
        place, above_sea = (None, None) if home is None else _home(home)
        speed = mission.get("hoverSpeed")
        fences = tuple(self._fences())
        self._rally()
        return QgcPlan(
            _whole(mission.get("firmwareType", Number("0")), "/mission/firmwareType"),
            _whole(mission.get("vehicleType", Number("2")), "/mission/vehicleType"),
            place,
            above_sea,
            None if speed is None else _number(speed, "/mission/hoverSpeed"),
            items,
            fences,
            tuple(self._losses),
            tuple(self._not_kept),
            self._surveys,
        )

    # ---------------------------------------------------------------- mission

    def _items(self, written: Sequence[Any]) -> Iterator[QgcItem]:
        for number, each in enumerate(written):
            place = f"/mission/items/{number}"
            item = _object(each, place)
            kind = item.get("type")
            if kind == "SimpleItem":
                yield _simple(item, place)
            elif kind == "ComplexItem":
                yield from self._complex(item, place)
            else:
                raise NotReadable(f'`{place}/type` is neither "SimpleItem" nor "ComplexItem"')

    def _complex(self, item: dict[str, Any], place: str) -> Iterator[QgcItem]:
        kind = item.get("complexItemType")
        if not isinstance(kind, str) or not kind.strip():
            raise NotReadable(f"`{place}/complexItemType` is not a name")
        try:
            if len(self._surveys) >= MOST_SURVEYS:
                raise NoSurvey(f"the plan has more than {MOST_SURVEYS} surveys")
            self._surveys[place] = read_survey(item, place)
        except NoSurvey as error:
            self._surveys[place] = str(error)
        legs = item.get("TransectStyleComplexItem")
        made = legs.get("Items") if isinstance(legs, dict) else None
        if kind not in TRANSECTS or not made:
            why = "its legs are not in the file" if kind in TRANSECTS else "no skill flies it"
            self._not_kept.append(NotKept(kind, place, why, _NO_LEGS))
            return
        self._losses.append(Loss("survey-parameters", place, kind))
        below = f"{place}/TransectStyleComplexItem/Items"
        for number, each in enumerate(_array(made, below)):
            yield _simple(_object(each, f"{below}/{number}"), f"{below}/{number}")._replace(of=kind)

    # ---------------------------------------------------------------- fence and rally points

    def _fences(self) -> Iterator[QgcFence]:
        fence = _object(self._tree.get("geoFence") or {}, "/geoFence")
        if not fence:
            return
        version = _whole(fence.get("version", Number("1")), "/geoFence/version")
        if version not in _FENCE_VERSIONS:
            raise NotReadable(f"`/geoFence/version` is {version}; only 1 and 2 are read")
        if fence.get("breachReturn") is not None:
            self._losses.append(Loss("breach-return", "/geoFence/breachReturn", "a place to return to"))
        old = fence.get("polygon")
        if old:
            yield from self._polygon(old, "/geoFence/polygon", inclusion=True)
        for number, each in enumerate(_array(fence.get("polygons") or [], "/geoFence/polygons")):
            place = f"/geoFence/polygons/{number}"
            part = _object(each, place)
            yield from self._polygon(part.get("polygon"), f"{place}/polygon", inclusion=_inclusion(part, place))
        for number, each in enumerate(_array(fence.get("circles") or [], "/geoFence/circles")):
            place = f"/geoFence/circles/{number}"
            part = _object(each, place)
            circle = _object(part.get("circle"), f"{place}/circle")
            latitude, longitude = _place(circle.get("center"), f"{place}/circle/center")
            radius = _number(circle.get("radius"), f"{place}/circle/radius")
            if radius <= 0:
                raise NotReadable(f"`{place}/circle/radius` is not positive")
            yield QgcFence(place, _inclusion(part, place), None, (latitude, longitude), round(radius * 1000))

    def _polygon(self, corners: Any, place: str, *, inclusion: bool) -> Iterator[QgcFence]:
        """A polygon of the fence, whose positions have the latitude first and are not closed."""
        ring = [_pair(each, f"{place}/{number}") for number, each in enumerate(_array(corners, place))]
        turned = [[longitude, latitude] for latitude, longitude in ring]
        if len(ring) < 3:
            help = "draw it again in QGroundControl, with three corners or more"
            self._not_kept.append(NotKept("fence", place, f"it has {len(ring)} of at least 3 corners", help))
            return
        try:
            yield QgcFence(place, inclusion, polygon_of([[*turned, *turned[:1]]], place))
        except NoArea as error:
            self._not_kept.append(NotKept("fence", place, error.message, error.help or ""))

    def _rally(self) -> None:
        rally = _object(self._tree.get("rallyPoints") or {}, "/rallyPoints")
        points = _array(rally.get("points") or [], "/rallyPoints/points")
        if points:
            self._losses.append(Loss("rally-points", "/rallyPoints/points", f"{len(points)} of them"))


def _simple(item: dict[str, Any], place: str) -> QgcItem:
    """A simple item. Before 2018 the place stood in `coordinate`, beside four parameters."""
    written = _array(item.get("params"), f"{place}/params")
    if "coordinate" in item:
        written = [*written, *_array(item["coordinate"], f"{place}/coordinate")]
    if len(written) != _PARAMETERS:
        raise NotReadable(f"`{place}/params` has {len(written)} values; expected {_PARAMETERS}")
    params = tuple(
        None if each is None else _number(each, f"{place}/params/{number}") for number, each in enumerate(written)
    )
    height, goes_on = item.get("Altitude"), item.get("autoContinue", True)
    return QgcItem(
        place,
        _whole(item.get("command"), f"{place}/command"),
        _whole(item.get("frame"), f"{place}/frame"),
        params,
        _whole(item.get("AltitudeMode") or Number("0"), f"{place}/AltitudeMode"),
        None if height is None else _number(height, f"{place}/Altitude"),
        goes_on is not False,
        jump_id=_whole(item.get("doJumpId") or Number("0"), f"{place}/doJumpId"),
    )


def _home(written: Any) -> tuple[tuple[int, int], int | None]:
    place = "/mission/plannedHomePosition"
    values = _array(written, place)
    if not 2 <= len(values) <= 3:
        raise NotReadable(f"`{place}` is not a position")
    height = values[2] if len(values) == 3 else None
    return _place(values[:2], place), None if height is None else round(_number(height, f"{place}/2") * 1000)


def _inclusion(part: dict[str, Any], place: str) -> bool:
    inclusion = part.get("inclusion")
    if not isinstance(inclusion, bool):
        raise NotReadable(f"`{place}/inclusion` is neither true nor false")
    return inclusion


def _place(written: Any, place: str) -> tuple[int, int]:
    """A latitude and a longitude, in 1e-7 degree."""
    latitude, longitude = (_number(each, place) for each in _pair(written, place))
    if abs(latitude) > 90 or abs(longitude) > 180:
        raise NotReadable(f"`{place}` is not on the globe")
    return degrees_e7(latitude), degrees_e7(longitude)


def degrees_e7(degrees: Decimal) -> int:
    """Degrees in 1e-7 degree, rounded half to even, as those of a GeoJSON file."""
    return round(degrees * 10_000_000)


def _pair(written: Any, place: str) -> Sequence[Any]:
    pair = _array(written, place)
    if len(pair) < 2 or not all(isinstance(each, Number) for each in pair[:2]):
        raise NotReadable(f"`{place}` is not a latitude and a longitude")
    return pair[:2]


def _object(value: Any, place: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise NotReadable(f"`{place}` is not an object")
    return value


def _array(value: Any, place: str) -> Sequence[Any]:
    if not isinstance(value, list):
        raise NotReadable(f"`{place}` is not an array")
    return value


def _number(value: Any, place: str) -> Decimal:
    if not isinstance(value, Number):
        raise NotReadable(f"`{place}` is not a number")
    number = Decimal(value.text)
    if abs(number) > _MOST:
        raise NotReadable(f"`{place}` is {value.text[:20]}, which is out of range")
    return number


def _whole(value: Any, place: str) -> int:
    number = _number(value, place)
    if number != number.to_integral_value():
        raise NotReadable(f"`{place}` is not a whole number")
    return int(number)
