"""Workspaces with files from memory and the shipped library."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.ground.editor.incremental_parse import ParsedText
from rtshcua.ground.editor.workspace import Workspace
from rtshcua.library import root

SITE = """import "lib:skills/signals.rts"
import "lib:skills/hover.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
import "lib:policies/site.rts"

// Where we practise.
zone pond = circle(47.39774 N, 8.54559 E, 40 m)  ceiling 60 m above home  entry 47.39774 N, 8.54559 E
zone shore = difference(city, pond)
enum mood { calm = 0, wild = 1 }
signal sea.mood : mood = HEARTBEAT.custom_mode  unknown at 255  stale after 2 s
"""
SKILL = """import "site.rts"
import "lib:skills/goto.rts"

// Look at something from near.
skill look(target: position, height_above: altitude in 5 m .. 60 m = 20 m, manner: one of slow, fast = slow) {
  motion   fly to target at height_above
  class    tactical
  deadline 5 s
  valid    for 40 min during survey
  lasts    at most 1 min
  grace    1 s
  require  gps.fix >= fix_3d and battery > 30 % and sea.mood != wild
  assume   wind.speed < 12 m/s
  maintain height <= 65 m
  fallback hover for 10 s, return_home, emergency_land
  energy   at most 6 %
  record   intent, decision, state, authorization, effect
}
"""
POLICY = """import "look.rts"

template near(over: zone, top: altitude in 5 m .. 60 m, who: role) {
  permit look by role who through agent when target inside over and height_above <= top
}

policy lake version 1 {
  use near(city, top = 30 m, who = operator)
  permit takeoff by role operator through agent
  permit hover, return_home, emergency_land by any
  forbid look by any when target inside grow(school, 20 m) or phase == recovery and sea.mood in {wild}
  airspace inside city outside school
  contingency hover for 10 s, return_home, emergency_land
}
"""
MISSION = """import "lake.rts"

mission dip(over: zone = pond, up: altitude in 10 m .. 30 m = 20 m) under lake@1 on surveyor {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = up) }
  phase survey    { look(over.entry, height_above = up, manner = fast) { require battery > 40 % and sea.mood == calm } }
  phase recovery  { return_home() }
}
"""
LAKE = {"/w/site.rts": SITE, "/w/look.rts": SKILL, "/w/lake.rts": POLICY, "/w/dip.rts": MISSION}


def lake(files: dict[str, str]) -> Workspace:
    """A workspace with these files and the library."""

    def read(path: str) -> bytes:
        return files[path].encode() if path.startswith("/w/") and path in files else Path(path).read_bytes()

    def listing(path: str) -> list[str]:
        if path.rstrip("/") == "/w":
            return [name.removeprefix("/w/") for name in files]
        return [each.name for each in Path(path).iterdir()]

    other = Workspace(read, str(root()), listing)
    other._files = _PARSED  # parsed files of the library, shared by all tests
    return other


_PARSED: dict[str, ParsedText] = {}


@pytest.fixture
def make() -> Callable[[dict[str, str]], Workspace]:
    """A function that makes workspaces."""
    return lake


@pytest.fixture
def desk() -> Workspace:
    """The sample workspace: four files, none of them open."""
    return lake(LAKE)


@pytest.fixture(scope="module")
def make_lake() -> Workspace:
    """A function that makes copies of the sample workspace, for property tests."""
    return lake(LAKE)
