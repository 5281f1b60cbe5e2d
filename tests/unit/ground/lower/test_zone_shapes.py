"""Lowering of declared zones: shapes, altitudes above sea, times, and GeoJSON files."""

import subprocess
import sys
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

import pytest

from reference.sources import CHECKOUT, LIBRARY, found, mission, policy, program, skill
from rtshcua.decision.checks.zones import zones as problems
from rtshcua.decision.values import TRUE
from rtshcua.decision.zones import PreparedZone
from rtshcua.diagnostics.render import render
from rtshcua.ground.checker.report import Report
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.language.load import load
from rtshcua.ground.lower.tables import ValueSets
from rtshcua.ground.lower.zones import ZoneTable
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, POLYGON, Zone, project
from virtual.rows import rows

#: 400 m by 222 m, with a courtyard
YARD = """zone yard = polygon(47.3970 N, 8.5440 E, 47.3970 N, 8.5493 E, 47.3990 N, 8.5493 E, 47.3990 N, 8.5440 E)
  hole (47.3975 N, 8.5450 E, 47.3975 N, 8.5460 E, 47.3980 N, 8.5460 E, 47.3980 N, 8.5450 E)"""
INSIDE, COURTYARD, OUTSIDE = (473985000, 85470000), (473978000, 85455000), (474000000, 85470000)
TALL = """vehicle tall {
  identity "tall-01"
  home 47.39774 N, 8.54559 E within 50 m
  speed at most 12 m/s
  climb at most 3 m/s
  position error 3 m
  energy 100 % = 18 min hover
  reserve 15 %
  ELEVATION
}
"""


def compiled(*parts: str, files: Mapping[str, bytes] | None = None) -> Compiled:
    """Compile a mission of one step under a policy, after some parts."""
    text = program(*parts, policy(), mission("takeoff(10 m)")) if "policy " not in "".join(parts) else program(*parts)
    inside = {"probe.rts": text.encode(), **(files or {})}

    def read(path: str) -> bytes:
        return inside[path] if path in inside else Path(path).read_bytes()

    loaded = load(["probe.rts"], read, LIBRARY)
    made = compile_program(loaded, dialect.load(), mission=None, issued_at_us=0)
    assert made.policy is not None, render(made.diagnostics, loaded.sources)
    assert not list(problems(made.policy))
    return made


def lowered(*parts: str, files: Mapping[str, bytes] | None = None) -> Policy:
    made = compiled(*parts, files=files).policy
    assert made is not None
    return made


def zone(policy: Policy, name: str) -> Zone:
    return next(each for each in policy.zones if each.name == name)


def holds(policy: Policy, name: str, place: tuple[int, int]) -> bool:
    """Whether a place in 1e-7 degree is inside a zone, at any height."""
    prepared = PreparedZone(0, zone(policy, name))
    return prepared.along(project(policy.projection, *place), (0, 0, 0, 0)) == TRUE


def test_polygon_with_a_hole_is_an_area() -> None:
    made = lowered(f"{YARD}\n")
    assert zone(made, "yard").shape == AREA
    assert zone(made, "yard").data[:3] == (2, 4, 4)
    assert [holds(made, "yard", each) for each in (INSIDE, COURTYARD, OUTSIDE)] == [True, False, False]
    edge = (473975000, 85455000)
    assert not holds(made, "yard", edge)


def test_corridor_contains_all_points_near_its_line() -> None:
    made = lowered("zone way = corridor(47.397 N, 8.544 E, 47.397 N, 8.548 E, 47.399 N, 8.548 E, width 40 m)\n")
    assert zone(made, "way").shape == POLYGON
    one, bend = project(made.projection, 473970000, 85440000), project(made.projection, 473970000, 85480000)
    prepared = PreparedZone(0, zone(made, "way"))

    def near(x: int, y: int) -> bool:
        return prepared.along((x, y), (0, 0, 0, 0)) == TRUE

    assert near(one[0] - 19_990, one[1])
    assert not near(one[0] - 20_001, one[1])
    assert near(one[0] + 1_000, one[1] + 19_998)
    assert not near(one[0] + 1_000, one[1] + 20_001)
    assert near(bend[0] + 14_130, bend[1] - 14_130)  # the outside of the bend is round
    assert not near(bend[0] + 14_160, bend[1] - 14_160)


def test_corridor_that_crosses_itself_has_a_hole() -> None:
    made = lowered(
        "zone loop = corridor(47.397 N, 8.544 E, 47.397 N, 8.548 E, 47.399 N, 8.548 E, 47.396 N, 8.545 E, width 10 m)\n"
    )
    assert zone(made, "loop").shape == AREA


COMBINED = """zone tower = circle(47.3985 N, 8.5470 E, 30 m)
zone open = difference(yard, tower)
zone all = union(open, tower, circle(47.4000 N, 8.5470 E, 20 m))
zone nest = difference(union(yard, tower), circle(47.3985 N, 8.5470 E, 20 m), tower)
"""


def test_unions_and_differences_combine_other_zones() -> None:
    made = lowered(f"{YARD}\n{COMBINED}")
    assert zone(made, "tower").shape == CIRCLE
    assert not holds(made, "open", INSIDE)
    assert holds(made, "open", (473985000, 85445000))
    assert holds(made, "all", INSIDE)
    assert holds(made, "all", OUTSIDE)
    assert not holds(made, "all", COURTYARD)
    assert zone(made, "nest").data == zone(made, "open").data


def test_parts_of_a_zone_may_be_declared_after_it() -> None:
    assert lowered(f"zone rest = difference(yard, circle(47.3985 N, 8.5470 E, 30 m))\n{YARD}\n")


NEARLY = skill("probe()", maintain="position inside grow(yard, -4 m) or position outside grow(yard, 600 m)")


def test_grown_areas_keep_their_holes_or_close_them() -> None:
    made = lowered(f"{YARD}\n", NEARLY)
    assert zone(made, "grow(yard, -4 m)").shape == AREA
    assert zone(made, "grow(yard, 600 m)").shape == POLYGON


def test_derived_zones_inherit_times() -> None:
    text = f'{YARD} active 08:00 .. 18:00 active "2026-05-01T08:00Z" .. "2026-05-02T18:00Z"\n'
    made = lowered(text, skill("probe()", maintain="position inside grow(yard, -4 m)"))
    for name in ("yard", "grow(yard, -4 m)"):
        assert zone(made, name).daily == (8 * 3_600_000_000, 18 * 3_600_000_000)
        assert zone(made, name).dates == (1_777_622_400_000_000, 1_777_744_800_000_000)


def tall(elevation: str) -> str:
    return TALL.replace("ELEVATION", elevation).replace("within 50 m", "within 10 m")  # within the courtyard


def flown(*parts: str) -> list[str]:
    """Return the parts of a program that flies the vehicle `tall`."""
    return [*parts, policy(), mission("takeoff(10 m)").replace("on quad", "on tall")]


BAND = f"{YARD} floor 420 m above sea ceiling 468 m above sea\n"


def test_altitudes_above_sea_are_converted_by_the_elevation_of_home() -> None:
    made = lowered(*flown(BAND, tall("elevation 408 m above sea")))
    assert (zone(made, "yard").floor, zone(made, "yard").ceiling) == (12_000, 60_000)
    assert len([each for each in made.zones if "yard" in each.name]) == 1


def test_uncertain_band_is_rounded_to_the_safe_side() -> None:
    probe = skill("probe()", maintain="position inside yard or position outside grow(yard, 5 m)")
    text = flown(BAND, tall("elevation 408 m above sea within 5 m"), probe)
    text[-2] = policy("airspace outside yard")
    made = lowered(*text)
    assert (zone(made, "yard").floor, zone(made, "yard").ceiling) == (12_000, 60_000)
    assert (zone(made, "surely(yard)").floor, zone(made, "surely(yard)").ceiling) == (17_000, 55_000)
    assert (zone(made, "possibly(yard)").floor, zone(made, "possibly(yard)").ceiling) == (7_000, 65_000)
    assert (zone(made, "grow(yard, 5 m)").floor, zone(made, "grow(yard, 5 m)").ceiling) == (7_000, 65_000)
    assert made.airspace is not None
    assert [made.zones[each].name for each in made.airspace.outside] == ["possibly(yard)"]


def test_uncertain_band_is_rounded_for_zone_arguments() -> None:
    probe = skill("probe(area: zone)", maintain="position inside area")
    made = lowered(*flown(BAND, tall("elevation 408 m above sea within 5 m"), probe))
    (table,) = made.tables
    names = [each.name for each in made.zones]
    assert names[table[names.index("yard")]] == "surely(yard)"


def test_zone_is_within_a_timed_zone_only_while_it_exists() -> None:
    others = "zone part = circle(47.3985 N, 8.5470 E, 30 m)\nzone gone = circle(47.40 N, 8.54 E, 30 m)\n"
    hours, dates = "active 08:00 .. 18:00", 'active "2026-05-01T08:00Z" .. "2026-05-02T18:00Z"'
    for times, ops in (
        ("", []),
        (hours, [Op.TIME_IN]),
        (f"{hours} {dates}", [Op.TIME_IN, Op.POSITION_IN]),
        (f"{hours} on monday", [Op.WEEK_IN]),
    ):
        text = f"{YARD} {times}\n{others}".encode()
        loaded = load(["probe.rts"], lambda _, text=text: text, LIBRARY)
        declared = loaded.units[0].zones
        table = ZoneTable(projection_at(473977400, 85455900), declared, Report(loaded.sources))
        span = declared[0].span
        for smaller in (True, False):
            assert table.within("yard", 0, smaller=smaller, span=span) == (0, 1)
            assert table.disjoint("yard", 0, smaller=smaller, span=span) == (2,)
        assert [op for op, _, _ in table.times("yard", ValueSets())] == ops
        assert list(table.times("yard", ValueSets())) == list(table.times("yard", ValueSets()))


def test_rule_about_a_timed_zone_tests_its_existence() -> None:
    rules = policy(
        "permit probe by role operator through agent when area inside market",
        "forbid probe by any when area outside market",
    )
    market = "zone market = circle(47.39882 N, 8.54725 E, 100 m) active 08:00 .. 18:00\n"
    made = lowered(market, skill("probe(area: zone)"), rules, mission("takeoff(10 m)"))
    codes = [rule.when.code[3:] for rule in made.rules if rule.when is not None]
    window = (Op.TIME_IN, 8 * 3_600_000_000, 18 * 3_600_000_000)
    assert codes == [(*window, Op.AND, 0, 0), (*window, Op.NOT, 0, 0, Op.OR, 0, 0)]


def test_policy_must_import_the_parts_of_its_zones() -> None:
    rules = program("zone rest = union(city, other)\n", policy())
    text = 'import "rules.rts"\nzone other = circle(47.40 N, 8.54 E, 30 m)\n' + mission("takeoff(10 m)")

    def read(path: str) -> bytes:
        inside = {"probe.rts": text, "rules.rts": rules}
        return inside[path].encode() if path in inside else Path(path).read_bytes()

    loaded = load(["probe.rts"], read, LIBRARY)
    told = compile_program(loaded, dialect.load(), mission=None, issued_at_us=0).diagnostics
    assert [each.code.id for each in told if each.code.severity.value == "error"] == ["E0207"]


SITE = b"""{"type": "FeatureCollection", "features": [
 {"type": "Feature", "id": "yard", "properties": {}, "geometry": {"type": "MultiPolygon", "coordinates": [
  [[[8.544, 47.397, 0], [8.549, 47.397, 0.0], [8.549, 47.399, -0], [8.544, 47.399, 0], [8.544, 47.397, 0]],
   [[8.545, 47.398], [8.546, 47.398], [8.546, 47.3975], [8.545, 47.3975], [8.545, 47.398]]],
  [[[8.549, 47.399], [8.550000000000123, 47.399], [8.55, 47.4], [8.549, 47.399]]]]}},
 {"type": "Feature", "properties": {"name": "mast"}, "geometry": {"type": "Point", "coordinates": [8.5455, 47.3978]}}
]}\r\n"""


@pytest.mark.parametrize("feature", ["", ' feature "yard"'])
def test_zone_is_read_from_geojson(feature: str) -> None:
    """Its two parts touch at a corner and are moved apart; the policy is signed with the file."""
    made = lowered(f'zone site from "maps/site.geojson"{feature} ceiling 60 m\n', files={"maps/site.geojson": SITE})
    assert zone(made, "site").shape == AREA
    assert zone(made, "site").data[0] == 3
    assert [holds(made, "site", each) for each in (INSIDE, COURTYARD, (473992000, 85495000))] == [True, False, True]
    assert not holds(made, "site", (473990000, 85490000))
    assert dict(zip(made.sources, made.source_digests, strict=True))["maps/site.geojson"] == sha256(SITE).digest()
    assert (zone(made, "site").floor, zone(made, "site").ceiling) == (LOWEST, 60_000)


def test_zone_without_a_ceiling_extends_to_the_highest_altitude() -> None:
    assert zone(lowered(f"{YARD} floor 5 m\n"), "yard").ceiling == HIGHEST


@rows(
    ("text", "code", "words"),
    [
        ("zone way = corridor(47.39 N, 8.54 E, width 40 m)", "E0516", "has 1 point; it needs two"),
        ("zone way = corridor(47.39 N, 8.54 E, 47.39 N, 8.54 E, width 4 m)", "E0516", "repeats a point"),
        ("zone way = corridor(47.39 N, 8.54 E, 47.40 N, 8.54 E, width 4 cm)", "E0516", "too narrow"),
        ("zone way = corridor(47.39 N, 8.54 E, 47.40 N, 8.54 E, width 0 m)", "E0516", ""),
        (
            "zone way = corridor(87.39 N, 8.54 E, 47.40 N, 8.54 E, width 4 m)",
            "E0502",
            "outside the supported coordinates",
        ),
        ("zone one = union(one, circle(47.39 N, 8.54 E, 5 m))", "E0510", "`one` is defined by itself"),
        ("zone one = union(two, city)\nzone two = difference(city, one)", "E0510", "`one` -> `two`"),
        ("zone one = union(yrd, city)", "E0201", "`yrd` is not declared; expected a zone"),
        ("zone one = union(quad, city)", "E0204", "`quad` is a vehicle"),
        ("zone none = difference(school, city)", "E0512", "`none` is empty"),
        (f"{YARD} floor 420 m above sea", "E0511", "the elevation of home is not declared"),
        (f"{YARD} entry 47.3978 N, 8.5455 E", "E0504", "the entry of `yard` is not inside the zone"),
        ("zone one = union(school, meadow) entry 47.38 N, 8.54 E", "E0504", "the entry of `one`"),
        ("zone one = circle(47.397 N, 8.544 E, 20 m) entry 47.38 N, 8.54 E", "E0504", "the entry of `one`"),
        (YARD.replace("47.3980 N, 8.5460 E", "47.3995 N, 8.5460 E"), "E0501", "a hole in `yard` crosses or touches"),
        (YARD.replace("47.3975 N, 8.5450 E, ", "47.3970 N, 8.5440 E, ", 1), "E0501", "a hole in `yard` crosses"),
        (YARD.replace("47.3975", "47.4005").replace("47.3980", "47.4010"), "E0501", "is outside its polygon"),
        (
            f"{YARD} hole (47.3977 N, 8.5452 E, 47.3977 N, 8.5455 E, 47.3978 N, 8.5455 E)",
            "E0501",
            "inside another hole",
        ),
        (f"{YARD} hole (47.3982 N, 8.5452 E, 47.3982 N, 8.5455 E)", "E0501", "the hole has 2 corners"),
        ("zone one = union(circle(10 N, 10 E, 5 m), city)", "E0507", "more than 500 km"),
        ('zone one from "nothing.geojson"', "E0108", "cannot read `nothing.geojson`"),
    ],
)  # fmt: skip
def test_fault_of_a_shape_is_reported_once(text: str, code: str, words: str) -> None:
    told = found(program(f"{text}\n", policy()))
    assert {each for each, _ in told} == {code}
    assert words in told[0][1]
    assert len(told) == 1


@pytest.mark.parametrize(
    ("band", "elevation", "code", "words"),
    [
        ("floor 420 m above sea ceiling 425 m above sea", "elevation 408 m above sea within 5 m", "E0512", "5 m high"),
        ("floor 20 m ceiling 425 m above sea", "elevation 408 m above sea", "E0503", "is not above its floor"),
        ("floor 20 m ceiling 425 m above sea", "elevation 408 m", "E0311", "is above home"),
        ("floor 20 m ceiling 425 m above sea", "elevation 40800 m above sea", "E1003", "is too large"),
    ],
)
def test_fault_of_a_height_band_is_reported(band: str, elevation: str, code: str, words: str) -> None:
    told = found(program(*flown(f"{YARD} {band}\n", tall(elevation))))
    assert {each for each, _ in told} == {code}, told
    assert words in told[0][1]


def test_survey_of_an_area_in_parts_is_refused() -> None:
    text = program(
        'import "lib:skills/inspect_area.rts"\n',
        "zone both = union(circle(47.3985 N, 8.5457 E, 30 m), circle(47.3975 N, 8.5444 E, 30 m))\n",
        policy(),
        mission("takeoff(10 m)", "inspect_area(both, altitude = 20 m)"),
    )
    assert ("E0509", "`both` has 2 parts, but a survey path covers only one") in found(text)


def test_invalid_geojson_is_reported_at_its_reference() -> None:
    text = program('zone site from "site.geojson"\n', policy())
    for data, code in ((b"{}", "E0112"), (b'{"type": "Point", "coordinates": [1, 2]}', "E0113")):

        def read(path: str, data: bytes = data) -> bytes:
            return {"probe.rts": text.encode(), "site.geojson": data}.get(path) or Path(path).read_bytes()

        loaded = load(["probe.rts"], read, LIBRARY)
        made = compile_program(loaded, dialect.load(), mission=None, issued_at_us=0)
        (told,) = [each for each in made.diagnostics if each.code.id != "E0206"]
        assert told.code.id == code
        assert told.span is not None
        assert loaded.sources["probe.rts"].slice(told.span).startswith('from "site.geojson"')


@pytest.mark.slow
def test_compiling_zones_does_not_import_shapely() -> None:
    """Importing it takes a third of a second, and its floats differ between machines."""
    script = (
        "import sys\n"
        f"sys.path[:0] = [{str(CHECKOUT / 'tests')!r}, {str(Path(__file__).parent)!r}]\n"
        "from test_zone_shapes import COMBINED, NEARLY, YARD, lowered\n"
        "lowered(YARD + '\\n' + COMBINED, NEARLY)\n"
        "assert not any(name.partition('.')[0] in ('shapely', 'numpy') for name in sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, cwd=CHECKOUT)
