"""A program near longitude 180 is lowered like the same program at any other longitude."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference.sources import LIBRARY
from rtshcua.adapters.vehicle.effects import arrived
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.diagnostics.render import render
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import HALF_TURN, TURN, project, unproject
from rtshcua.simulation.place import HomePosition

DATE_LINE, ELSEWHERE = 180 * 10**7, 85 * 10**6
KM = 1_000_000


@given(
    st.integers(-80 * 10**7, 80 * 10**7),
    st.integers(-HALF_TURN, HALF_TURN),
    st.integers(-500 * KM, 500 * KM),
    st.integers(-500 * KM, 500 * KM),
)
def test_projection_round_trip_across_longitude_180(latitude: int, longitude: int, x: int, y: int) -> None:
    here = projection_at(latitude, longitude)
    place = unproject(here, x, y)
    assert abs(place[1]) <= HALF_TURN
    assert max(abs(a - b) for a, b in zip(project(here, *place), (x, y), strict=True)) <= 12, "mm: 1e-7 degree is 11"
    other = replace(here, longitude=0)
    moved = (place[0], (place[1] - longitude + HALF_TURN) % TURN - HALF_TURN)
    assert project(here, *place) == project(other, *moved)


def degrees(longitude: int) -> str:
    """Format a longitude as in sources; 180 degrees are written as west."""
    wrapped = (longitude + HALF_TURN) % TURN - HALF_TURN
    return f"{abs(wrapped) // 10**7}.{abs(wrapped) % 10**7:07d} {'E' if wrapped >= 0 else 'W'}"


TEXT = """
import "lib:skills/signals.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/goto.rts"
import "lib:skills/inspect_area.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
vehicle quad {
  identity "quad-01"  home 47.39774 N, {0} within 5 m  speed at most 12 m/s  climb at most 3 m/s
  position error 2 m  energy 100 % = 24 min hover  reserve 20 %
}
zone sky   = polygon(47.3950 N, {-30000}, 47.3950 N, {30000}, 47.4000 N, {30000}, 47.4000 N, {-30000})
             hole (47.3955 N, {-5000}, 47.3955 N, {4000}, 47.3960 N, {4000}, 47.3960 N, {-5000}) ceiling 60 m
zone bay   = polygon(47.3985 N, {-9000}, 47.3985 N, {-1000}, 47.3990 N, {-1000}, 47.3990 N, {-9000})
             entry 47.3986 N, {-8000}
zone cove  = circle(47.39774 N, {3500}, 20 m) entry 47.39774 N, {3600}
zone way   = corridor(47.39774 N, {0}, 47.3986 N, {-4000}, 47.3986 N, {4000}, width 40 m)
zone water = union(cove, way, difference(bay, circle(47.3988 N, {-2000}, 8 m)))
zone reef  from "reef.geojson"
role pilot
policy p version 1 {
  permit takeoff, goto by role pilot through operator when altitude <= 30 m
  permit inspect_area by role pilot through operator when area inside grow(bay, 1 m)
  permit hover, return_home, emergency_land by any
  airspace inside sky
  contingency hover for 5 s, return_home, emergency_land
}
mission m under p@1 on quad {
  proposed by operator mere for role pilot
  phase departure { takeoff(20 m) }
  phase inspection { goto(cove.entry, 20 m)  goto(47.3990 N, {-7000}, 20 m)  inspect_area(bay, 20 m) }
  phase recovery { return_home() }
}
"""


def reef(home: int, middle: int) -> bytes:
    """Return an area in two parts with a common edge, one on each side of longitude 180."""

    def ring(west: int, east: int) -> list[list[list[float]]]:
        def written(offset: int, other: int) -> float:
            at = home + offset
            return (at - TURN if at > HALF_TURN or (at == HALF_TURN and home + other > HALF_TURN) else at) / 1e7

        low, high = written(west, east), written(east, west)
        return [[[low, 47.397], [high, 47.397], [high, 47.398], [low, 47.398], [low, 47.397]]]

    parts = [ring(-6000, middle), ring(middle, 7000)]
    return json.dumps({"type": "MultiPolygon", "coordinates": parts}).encode()


def compiled(home: int, middle: int) -> tuple[Policy, Mission]:
    text = TEXT
    for part in {piece.split("}")[0] for piece in TEXT.split("{")[1:]}:
        if part.lstrip("-").isdigit():
            text = text.replace(f"{{{part}}}", degrees(home + int(part)))
    files = {"probe.rts": text.encode(), "reef.geojson": reef(home, middle)}

    def read(path: str) -> bytes:
        return files[path] if path in files else Path(path).read_bytes()

    loaded = load(["probe.rts"], read, LIBRARY)
    made = compile_program(loaded, dialect.load(), mission=None, issued_at_us=0)
    assert made.policy is not None, render(made.diagnostics, loaded.sources)
    assert made.mission is not None
    return made.policy, made.mission


@pytest.mark.parametrize("home", [DATE_LINE - 2500, -DATE_LINE + 1500])
def test_program_at_longitude_180_equals_one_at_any_other_longitude(home: int) -> None:
    east = home % TURN  # within 0 .. 360 degrees
    there, flown = compiled(east, DATE_LINE - east)
    here, expected = compiled(ELSEWHERE, DATE_LINE - east)
    assert there.zones == here.zones
    assert there.projection == replace(here.projection, longitude=home)
    assert [one.plan for one in flown.invocations] == [one.plan for one in expected.invocations]
    assert [one.arguments for one in flown.invocations] == [one.arguments for one in expected.invocations]
    seam = next(zone for zone in there.zones if zone.name == "reef")
    assert len(seam.data) == 8, "the two parts are joined, without a seam"


def test_place_beyond_longitude_180_is_reached_and_simulated() -> None:
    near = arrived(-168_500_000, -HALF_TURN + 10, 20_000)
    there = {"latitude": -168_500_000, "height": 20_000, "located": True, "levelled": True}
    assert near(ObservedVehicle(longitude=HALF_TURN - 10, **there))
    assert not near(ObservedVehicle(longitude=HALF_TURN - 10_000, **there))
    for side in (1, -1):
        home = HomePosition(-168_500_000, side * (HALF_TURN - 1000), 0)
        latitude, longitude = home.globe(30.0, side * 200.0)
        assert longitude * side < 0
        assert home.local(latitude, longitude) == pytest.approx((30.0, side * 200.0), abs=0.02)
        assert home.local(*home.globe(30.0, -side * 200.0)) == pytest.approx((30.0, -side * 200.0), abs=0.02)
