"""A program with a camera and a skill that states what its pictures must show, and changes of it."""

from functools import cache
from pathlib import Path

from reference.sources import LIBRARY
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Checked, examine_program
from rtshcua.mavlink import dialect

PROGRAM = """
import "lib:skills/signals.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

vehicle quad {
  identity "m-1"  home 47.39774 N, 8.54559 E within 5 m  speed at most 12 m/s  climb at most 3 m/s
  position error 1 m  energy 100 % = 90 min hover  reserve 15 %
  camera mapper sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 every at least 700 ms exposure at most 1 ms
}
zone field = polygon(47.3990 N, 8.5450 E, 47.3990 N, 8.5470 E, 47.3980 N, 8.5470 E, 47.3980 N, 8.5450 E)
zone wide  = circle(47.39774 N, 8.54559 E, 300 m)
zone road  = corridor(47.3978 N, 8.5457 E, 47.3985 N, 8.5465 E, 47.3990 N, 8.5465 E, width 60 m)
zone wall  = corridor(47.3978 N, 8.5457 E, 47.3978 N, 8.5467 E, width 60 m)
zone tower = difference(circle(47.3985 N, 8.5460 E, 40 m), circle(47.3985 N, 8.5460 E, 5 m))
zone barn  = difference(circle(47.3985 N, 8.5460 E, 40 m), polygon(47.39845 N, 8.5459 E, 47.39845 N, 8.5461 E,
             47.39855 N, 8.5461 E, 47.39855 N, 8.5459 E))

skill look(
  area:     zone,
  altitude: altitude in 40 m .. highest,
  away:     length in 8 m .. 15 m = 10 m,
  pattern:  one of grid, perimeter, corridor = grid,
  speed:    speed in 1 m/s .. 8 m/s = 5 m/s,
) sizes (
  highest: altitude in 20 m .. 100 m = 60 m,
  apart:   length in 1 m .. 20 m = 8 m,
  pixel:   length in 1 mm .. 10 cm = 2 cm,
  share:   ratio in 0 % .. 90 % = 80 %,
) {
  motion   cover area at altitude distance away pattern pattern speed speed
  class    tactical  deadline 5 s  valid for 90 min  lasts at most 25 min
  pictures by mapper every 8 m resolution 2 cm overlap 80 % forward 70 % side blur 100 %
  fallback hover for 10 s, return_home, emergency_land
  energy   at most 35 %
}
policy rules version 1 {
  permit return_home, emergency_land, hover by any
  permit takeoff, look by role operator through agent
  contingency return_home, emergency_land
}
mission flight under rules@1 on quad {
  proposed by agent openclaw for role operator
  phase departure {
    takeoff(altitude = 20 m)
    look(field, 50 m)
    return_home()
  }
}
"""
#: changes by which the camera looks sideways
SIDEWAYS = (
    ("grid, perimeter, corridor = grid", "face, around = face"),
    ("2 cm overlap 80 % forward 70 % side blur 100 %", "4 mm overlap 30 % forward 0 % side blur 300 %"),
    ("every 8 m", "every 3 m"),
    ("8 m/s = 5", "4 m/s = 3"),
)
#: changes by which it scans a face or a structure at heights that overlap, facing it
SCAN = (
    *SIDEWAYS,
    ("15 m", "14 m"),
    ("  altitude: altitude in 40 m", "  lowest:   altitude in 5 m .. 50 m,\n  altitude: altitude in 10 m"),
    (
        "area at altitude distance away pattern pattern",
        "area from lowest to altitude distance away pattern pattern facing inward",
    ),
    ("0 % side", "60 % side"),
)


def program(*changes: tuple[str, str]) -> str:
    """Return the program with these texts replaced, each of which it must have."""
    text = PROGRAM
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


@cache
def checked(text: str) -> Checked:
    """Return the findings, bounds and pictures of a program."""

    def read(path: str) -> bytes:
        return text.encode() if path == "probe.rts" else Path(path).read_bytes()

    return examine_program(load(["probe.rts"], read, LIBRARY), dialect.load())
