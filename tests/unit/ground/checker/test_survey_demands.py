"""Cameras and demands on pictures: units, dimensions, and what a motion can keep."""

import pytest

from reference.sources import found
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse
from rtshcua.model.quantity import micrometres
from virtual.rows import rows

VEHICLE = """
vehicle mapping_quad {
  identity "m-1"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %
  camera mapper sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 every at least 700 ms exposure at most 1 ms
}
"""
SKILL = """
skill look(area: zone, altitude: altitude in 5 m .. 50 m, away: length in 3 m .. 20 m,
           pattern: one of grid, face, around = grid) {
  motion cover area at altitude distance away pattern pattern
  class tactical  deadline 5 s  valid for 40 min  lasts at most 2 min  energy at most 5 %
  pictures by mapper every 8 m resolution 2.5 cm overlap 80 % forward 70 % side blur 50 % relief 2 m
  fallback land
}
skill land() { motion land  class tactical  deadline 5 s  valid for 40 min  lasts at most 2 min  energy at most 5 % }
"""


@rows(
    ("old", "new", "codes"),
    [
        ("", "", []),
        ("13.2 mm", "13_200 um", []),
        ("13.2 mm", "1.32 cm", []),
        ("13.2 mm", "13.2001 mm", ["E0302"]),
        ("13.2 mm", "0 mm", ["E0302"]),
        ("13.2 mm", "1.1 m", ["E0302"]),
        ("13.2 mm", "13.2 deg", ["E0301"]),
        ("13.2 mm", "13.2 inch", ["E0301"]),
        ("5472 by", "0 by", ["E0319"]),
        ("by 3648", "by 100_001", ["E1003"]),
        ("least 700 ms", "least 0 ms", ["E0319"]),
        ("least 700 ms", "least 700 m", ["E0310"]),
        ("most 1 ms", "most 2 h", ["E1003"]),
        ("most 1 ms", "most 1 ms portrait", []),
        ("camera mapper", "camera map.per", ["E0101"]),
        ("position error", "camera mapper sensor 1 mm by 1 mm focal 8 mm pixels 9 by 9 every at least 1 s exposure at "
         "most 1 s position error", ["E0106"]),
    ],
)  # fmt: skip
def test_invalid_cameras_are_reported(old: str, new: str, codes: list[str]) -> None:
    assert [code for code, _ in found(VEHICLE.replace(old, new, 1))] == codes


@rows(
    ("old", "new", "codes"),
    [
        ("", "", []),
        ("every 8 m", "every 8 s", []),
        ("every 8 m", "every 8 m/s", ["E0310"]),
        ("every 8 m", "every 0 m", ["E0319"]),
        ("every 8 m ", "", ["E1706"]),
        ("every 8 m resolution 2.5 cm overlap 80 % forward", "overlap 0 % forward", []),
        ("resolution 2.5 cm", "resolution 400 um", []),
        ("resolution 2.5 cm", "resolution 2.5 %", ["E0301"]),
        ("80 % forward", "100 % forward", ["E1003"]),
        ("70 % side", "7 m side", ["E0310"]),
        ("blur 50 %", "blur 0 %", ["E0319"]),
        ("blur 50 %", "blur 10_001 %", ["E1003"]),
        ("relief 2 m", "relief 0 m", []),
        ("relief 2 m", "relief 2 s", ["E0310"]),
        ("distance away ", "", ["E0608", "E0608"]),
        ("3 m .. 20 m", "0 m .. 20 m", []),
        ("3 m .. 20 m", "-1 m .. 20 m", ["E0319"]),
        ("distance away", "distance altitude", ["E0608"]),
        ("grid, face", "grid, facade", ["E0608"]),
        ("motion cover area at altitude distance away pattern pattern", "motion home", ["E1706"]),
    ],
)
def test_invalid_demands_are_reported(old: str, new: str, codes: list[str]) -> None:
    assert [code for code, _ in found(SKILL.replace(old, new, 1))] == codes


@pytest.mark.parametrize(("written", "um"), [("4.4 um", None), ("44 um", 44), ("4.4 mm", 4_400), ("35 mm", 35_000)])
def test_optical_lengths_are_whole_micrometres(written: str, um: int | None) -> None:
    read = parse(Source("v.rts", VEHICLE.replace("focal 8.8 mm", f"focal {written}")))
    values = [camera.focal.value for vehicle in read.unit.vehicles for camera in vehicle.cameras]
    assert values == ([] if um is None else [um])
    assert um is None or [*micrometres(um).split()] == written.split()
