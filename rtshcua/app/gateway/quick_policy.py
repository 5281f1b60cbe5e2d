"""Write the policy of `rtshcua gateway --allow ... --below ... --inside ...`, as an engineer would write it.

The text is a source like any other: it is shown, compiled, signed, and kept with `--save`. Only library skills occur.
The vehicle's figures are those of the library's vehicle, which stock PX4 and ArduCopter keep (docs/flying/speeds.md);
the home is the one that the vehicle reports.
"""

from collections.abc import Iterator, Sequence
from math import isqrt
from typing import Final, NamedTuple

from shapely import Point, Polygon

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.ground.checker.geojson import GeoPolygon
from rtshcua.ground.exchange.stock_policy import (
    CLIMB,
    CRUISE,
    ERROR_MM,
    LEAST_HIGHEST_MM,
    WITHIN_MM,
    GeoPoint,
    size_line,
    vehicle_lines,
)
from rtshcua.ground.exchange.zone_source import metres, place_text
from rtshcua.ground.format.format_text import format_text
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.model.flat.zone import Projection, project

#: names of the policy and its area
POLICY: Final = "gateway"
AREA: Final = "field"

#: skills that always remain permitted: a chain of fallbacks ends in them
SAFE: Final = ("hover", "return_home", "emergency_land")
#: skills that `--allow` can add, and other words for skills
SKILLS: Final = ("takeoff", "goto", *SAFE)
_OTHER_WORDS: Final = {
    "land": "emergency_land", "rtl": "return_home", "return": "return_home", "hold": "hover", "loiter": "hover",
    "take_off": "takeoff", "go_to": "goto", "reposition": "goto", "arm": "takeoff",
}  # fmt: skip

#: the accepted limits of `--below`, in mm; of the library's skills, whose altitudes begin at 5 m
LOWEST_MM, HIGHEST_MM = 5_000, 500_000
#: the radius of the area around home without `--inside`, in mm
RADIUS_MM: Final = 100_000
#: how far the ceiling of the area is above the highest permitted altitude, in mm: room to overshoot
_HEADROOM_MM: Final = 10_000
#: the least `within` of home, in mm
_LEAST_WITHIN_MM: Final = 2_000
#: the longest leg and way home, in seconds. A step needs the charge for the longest that its skill permits: in a large
#: area a longer leg is refused, instead of every leg with less charge
_LONGEST_LEG_S, _LONGEST_HOME_S = 225, 320


class QuickRules(NamedTuple):
    """What the one-minute policy permits: skills, the highest altitude above home in mm, and the area (empty: a circle
    around home). `identity` is that of the vehicle.
    """

    allow: tuple[str, ...]
    below_mm: int
    area: tuple[GeoPolygon, ...]
    identity: str


def allowed_skills(text: str) -> tuple[str, ...] | Refusal:
    """Return the skills that a list such as `takeoff,goto,land` names, in the library's order."""
    found: set[str] = set()
    for word in text.split(","):
        name = word.strip().lower().replace("-", "_").replace(" ", "_")
        skill = _OTHER_WORDS.get(name, name)
        if skill not in SKILLS:
            near = nearest(name, (*SKILLS, *_OTHER_WORDS))
            help = f"did you mean `{near}`?" if near else f"accepted: {listed((*SKILLS, 'land', 'rtl', 'hold'))}."
            text = f"`{word.strip()}` is not a skill of `--allow`" if word.strip() else "`--allow` has an empty name"
            return Refusal("usage", text, f"{help} Other skills need a policy of your own: `--policy FILE`")
        found.add(skill)
    if "takeoff" not in found:
        return Refusal("usage", "`--allow` has no `takeoff`: nothing could fly", f"as in `--allow takeoff,{text}`")
    return tuple(skill for skill in SKILLS if skill in found)


def start_inside(area: Sequence[GeoPolygon]) -> GeoPoint:
    """Return a place well inside an area, for the simulated vehicle."""
    largest = max((Polygon(each.outer, each.holes) for each in area), key=lambda shape: float(shape.area))
    point = largest.representative_point()
    return GeoPoint(round(point.y), round(point.x))


def policy_text(rules: QuickRules, home: GeoPoint, return_mm: int, version: int = 1) -> str | Refusal:
    """Return the source of the policy for a vehicle at `home`, whose autopilot returns at `return_mm` above home."""
    plane = projection_at(home.latitude, home.longitude)
    within_mm = _within(rules.area, plane)
    if within_mm < _LEAST_WITHIN_MM:
        return _outside(rules.area, plane, within_mm)
    parts = (
        _introduction(rules),
        *_imports(rules),
        "",
        *_sizes(rules, _across(rules.area, plane)),
        *_vehicle(rules, home, within_mm, return_mm),
        "",
        *_area(rules, home),
        "",
        *_policy(rules, version),
    )
    text = "\n".join(parts) + "\n"
    formatted = format_text(text)
    return formatted if isinstance(formatted, str) else text


# ---------------------------------------------------------------------------------------------------- the parts


def _introduction(rules: QuickRules) -> str:
    typed = ",".join("land" if skill == "emergency_land" else skill for skill in rules.allow)
    return (
        f"// What `rtshcua gateway --allow {typed} --below {metres(rules.below_mm)}` permits.\n"
        "// Whatever no rule permits is denied. Change it as you need, and raise the version with every change."
    )


def _imports(rules: QuickRules) -> Iterator[str]:
    for skill in ("signals", *(each for each in SKILLS if each in (*rules.allow, *SAFE))):
        yield f'import "lib:skills/{skill}.rts"'


def _sizes(rules: QuickRules, across_mm: int) -> Iterator[str]:
    """The sizes of the library's skills for this height and this area."""
    highest = metres(max(rules.below_mm, LEAST_HIGHEST_MM))
    climb_s = -(-rules.below_mm // CLIMB)
    leg_s = min(-(-across_mm // CRUISE) + climb_s + 15, _LONGEST_LEG_S)
    home_s = min(-(-across_mm // CRUISE) + 2 * climb_s + 45, _LONGEST_HOME_S)
    if "takeoff" in rules.allow:
        yield size_line("takeoff", f"highest = {highest}, ", climb_s + 15, 60, 4)
    if "goto" in rules.allow:
        yield size_line("goto", f"highest = {highest}, ", leg_s, 120, 7)
    yield size_line("return_home", "", home_s, 240, 17)
    yield size_line("emergency_land", "", climb_s + 30, 120, 8)
    yield ""


def _vehicle(rules: QuickRules, home: GeoPoint, within_mm: int, return_mm: int) -> Iterator[str]:
    yield "// The vehicle, where it stands now. The figures are those that stock PX4 and ArduCopter keep: use your own."
    yield from vehicle_lines(rules.identity, home, within_mm, return_mm)


def _area(rules: QuickRules, home: GeoPoint) -> Iterator[str]:
    ceiling = f"ceiling {metres(rules.below_mm + _HEADROOM_MM)} above home"
    if not rules.area:
        yield f"// No `--inside` was given: the area is a circle of {metres(RADIUS_MM)} around home."
        yield f"zone {AREA} = circle({place_text(*home)}, {metres(RADIUS_MM)}) {ceiling}"
        return
    names = [AREA] if len(rules.area) == 1 else [f"{AREA}_{number}" for number in range(1, len(rules.area) + 1)]
    for name, polygon in zip(names, rules.area, strict=True):
        yield f"zone {name} = polygon("
        yield from _corners(polygon.outer)
        for hole in polygon.holes:
            yield ") hole ("
            yield from _corners(hole)
        yield f") {ceiling}"
    if len(names) > 1:
        yield f"zone {AREA} = union({', '.join(names)}) {ceiling}"


def _policy(rules: QuickRules, version: int) -> Iterator[str]:
    top = f"altitude <= {metres(rules.below_mm)}"
    yield f"policy {POLICY} version {version} {{"
    if "takeoff" in rules.allow:
        yield f"  permit  takeoff by role operator through agent  when {top}"
    if "goto" in rules.allow:
        yield f"  permit  goto by role operator through agent  when target inside {AREA} and {top}"
    yield ""
    yield "  // What makes a flight safer, anyone may ask for. Fallbacks end in these."
    yield f"  permit  {', '.join(SAFE)} by any"
    yield ""
    moving = ", ".join(skill for skill in SKILLS if skill in (*rules.allow, "hover") and skill not in SAFE[1:])
    yield f"  degrade {moving} when battery < 25 % to return_home"
    yield f"  airspace inside {AREA}"
    yield "  contingency hover for 10 s, return_home, emergency_land"
    yield "}"


# ---------------------------------------------------------------------------------------------------- geometry


def _within(area: Sequence[GeoPolygon], plane: Projection) -> int:
    """How far the real home may be from the declared one, in mm, so that a landing there stays in the area. Less than
    `_LEAST_WITHIN_MM` if home is outside the area or too near to its edge.
    """
    inside = [shape for shape in _shapes(area, plane) if shape.contains(Point(0, 0))]
    if area and not inside:
        return -1
    room = min((int(shape.boundary.distance(Point(0, 0))) for shape in inside), default=WITHIN_MM * 2)
    return max(0, min(WITHIN_MM, (room - ERROR_MM - 1_000) // 1_000 * 1_000))


def _outside(area: Sequence[GeoPolygon], plane: Projection, within_mm: int) -> Refusal:
    away = min(int(shape.boundary.distance(Point(0, 0))) for shape in _shapes(area, plane))
    where = "outside the area" if within_mm < 0 else "too near to the edge of the area"
    text = f"the vehicle is {where}: {metres(away // 100 * 100)} from its edge"
    least = ERROR_MM + _LEAST_WITHIN_MM + 1_000
    help = f"it must start inside, at least {metres(least)} from the edge: move it, or use another `--inside`"
    return Refusal("outside-area", text, help, ExitCode.REFUSED)


def _across(area: Sequence[GeoPolygon], plane: Projection) -> int:
    """The greatest distance between two places of the area, at most, in mm: the diagonal of its bounding box."""
    if not area:
        return 2 * RADIUS_MM
    boxes = [shape.bounds for shape in _shapes(area, plane)]
    wide = int(max(box[2] for box in boxes) - min(box[0] for box in boxes))
    high = int(max(box[3] for box in boxes) - min(box[1] for box in boxes))
    return isqrt(wide * wide + high * high) + 1


def _shapes(area: Sequence[GeoPolygon], plane: Projection) -> list[Polygon]:
    """The polygons in local mm; GeoJSON has the longitude first."""

    def ring(corners: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
        return [project(plane, latitude, longitude) for longitude, latitude in corners]

    return [Polygon(ring(each.outer), [ring(hole) for hole in each.holes]) for each in area]


# ---------------------------------------------------------------------------------------------------- text


def _corners(ring: Sequence[tuple[int, int]]) -> Iterator[str]:
    for longitude, latitude in ring:
        yield f"  {place_text(latitude, longitude)},"
