"""The seed corpus of fuzzing: shipped, accepted and rejected sources, examples, and earlier findings."""

import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from fuzz.world import CHECKOUT

TESTS = CHECKOUT / "tests"
SEEDS = Path(__file__).with_name("seeds")
READS_GEOJSON = b"""
import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/goto.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

zone yard from "probe.geojson" feature "yard" ceiling 60 m
zone rest = difference(site, yard)
zone wide = grow(yard, by 10 m)
skill look() {
  motion hold
  class tactical
  deadline 5 s
  valid for 40 min
  lasts at most 1 min
  require not (position inside yard) or position inside rest
  fallback return_home, emergency_land
  energy at most 5 %
}
policy rules version 1 {
  permit any by any through agent, operator, onboard, reflex
  forbid hover by any when position inside wide and battery < 30 %
  contingency return_home, emergency_land
}
mission flight under rules@1 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(20 m) look() return_home() }
}
"""


def kept(target: str) -> list[Path]:
    """The seeds that were findings."""
    return sorted((SEEDS / target).iterdir()) if (SEEDS / target).is_dir() else []


def _glob(*patterns: str) -> Iterator[bytes]:
    for pattern in patterns:
        for path in sorted(CHECKOUT.glob(pattern)):
            yield path.read_bytes()


@cache
def sources() -> tuple[bytes, ...]:
    """All texts in the language."""
    return tuple(
        _glob(
            "skills/*.rts", "policies/*.rts", "missions/*.rts", "tests/accepted/*.rts", "tests/rejected/*.rts",
            "tests/specifications/valid/*.rts", "tests/specifications/faulty/*.rts",
            "tests/unit/ground/language/forms.rts",
        )
    )  # fmt: skip


@cache
def conditions() -> tuple[bytes, ...]:
    """The conditions of the reference, and those in all sources."""
    page = (CHECKOUT / "docs" / "language.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```condition\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    found = [line.encode() for block in blocks for line in block.splitlines()]
    for source in sources():
        found += re.findall(rb"^\s*(?:require|assume|maintain)\s+(.*)$", source, re.MULTILINE)
    found += [
        b"max(height - 20 m, obstacle.distance) >= 2 * gap",
        b"abs(height - up) <= 3 m / 2",
        b"rising gps.fix in {fix_3d, dgps} within the last 5 s",
        b"position inside city for the last 3 s or not position inside school",
        b"battery < 20 % within 5 s of falling link.quality > 50 %",
        b"phase in {departure, inspection} and local time in 08:00 .. 18:00",
    ]
    return tuple(dict.fromkeys(found))


@cache
def specifications() -> tuple[bytes, ...]:
    """All mission specifications."""
    return tuple(_glob("missions/*.json", "tests/accepted/*.json", "tests/rejected/*.json"))


@cache
def geojson() -> tuple[bytes, ...]:
    """All GeoJSON, and one feature that fits the site."""
    made: Iterable[bytes] = (
        b'{"type":"Feature","id":"yard","geometry":{"type":"Polygon","coordinates":'
        b"[[[8.5445,47.3972],[8.5465,47.3972],[8.5465,47.3985],[8.5445,47.3985],[8.5445,47.3972]]]}}",
        b'{"type":"MultiPolygon","coordinates":[[[[8.5445,47.3972],[8.5465,47.3972],[8.5465,47.3985],[8.5445,47.3972]]'
        b"],[[[8.547,47.397],[8.548,47.397],[8.548,47.398],[8.547,47.397]]]]}",
    )
    return (*_glob("tests/accepted/parts/*.geojson", "tests/specifications/valid/*.geojson"), *made)
