"""Linting: a project of 20 files without a cache, one of 200 with a warm cache, and `check` of both, compared with
`python -c pass`, in turns, from start to exit.

The goals are 0.8 s and 0.6 s on a machine where `python -c pass` takes 10 ms. The limits are ratios of processor times,
which do not depend on the machine and its load. Exits with 1 when a ratio is above its limit.
"""

import os
import subprocess
import sys
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import NamedTuple

BARE_MS = 10
COLD_S, WARM_S = 0.8, 0.6
ROUNDS = 5
FEW, MANY = 20, 200  # files

SITE = """// The site of project {n}, and what its policies share.
import "lib:policies/site.rts"

zone pylon_{n} = circle(47.39{n:03d} N, 8.54620 E, 15 m) ceiling 60 m above home
  entry 47.39{n:03d} N, 8.54620 E
zone yard_{n} = polygon(
  47.39710 N, 8.54500 E,
  47.39710 N, 8.54620 E,
  47.39790 N, 8.54620 E,
  47.39790 N, 8.54500 E,
) ceiling 50 m above home
"""

SKILL = """// Wait at a place for a while, to listen.
import "lib:skills/signals.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

skill listen_{n}(time: duration in 1 s .. 60 s = 10 s) {{
  motion   hold for time
  class    tactical
  deadline 5 s
  valid    for 40 min
  lasts    at most 1 min
  grace    1 s
  require  gps.fix >= fix_3d and battery > {charge} %
  assume   wind.speed < 12 m/s where fitted
  maintain height <= 65 m
  fallback return_home, emergency_land
  energy   at most 6 %
  record   intent, decision, state, authorization, effect
}}
"""

POLICY = """// Policy {n}: what an agent may have done at pylon {site}.
import "site_{site}.rts"
import "listen_{skill}.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/goto.rts"
import "lib:skills/inspect_area.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

role supervisor

policy works_{n} version {version} {{
  permit  takeoff by role operator through agent, operator  when altitude <= {high} m
  permit  goto by role operator through agent, operator  when target inside city and altitude <= {high} m
  permit  inspect_area by role operator through agent, operator  when area inside bridge_a and altitude <= 30 m
  permit  listen_{skill} by role operator through agent, operator  when position inside city
  permit  hover, return_home, emergency_land by any
  forbid  goto by any when target inside grow(school, {margin} m)
  confirm inspect_area when altitude < 10 m by role supervisor within 30 s
  degrade goto, inspect_area, listen_{skill} when battery < {charge} % to return_home
  airspace inside city outside school
  contingency hover for 10 s, return_home, emergency_land
}}
"""

MISSION = """// Mission {n}: look at the bridge, and come home.
import "works_{policy}.rts"

mission look_{n} under works_{policy}@{version} on quad {{
  intent   "Look at the bridge from {height} m, listen, and come home."
  proposed by agent openclaw for role operator
  phase departure  {{ takeoff(altitude = {height} m) }}
  phase inspection {{
    goto(bridge_a.entry, altitude = {height} m)
    inspect_area(bridge_a, altitude = {height} m)
    listen_{skill}(10 s)
  }}
  phase recovery   {{ return_home() }}
}}
"""


def project(folder: Path, files: int) -> None:
    """Write a project: of ten files one site, one own skill, two policies and six missions."""
    for number in range(files):
        tens, which = divmod(number, 10)
        site, skill = tens, tens
        if which == 0:
            name, text = f"site_{tens}", SITE.format(n=860 - tens)
        elif which == 1:
            name, text = f"listen_{tens}", SKILL.format(n=tens, charge=30 + tens % 5)
        elif which in (2, 3):
            n = 2 * tens + which - 2
            name = f"works_{n}"
            text = POLICY.format(
                n=n, site=site, skill=skill, version=1 + n % 9, high=36 + n % 5, margin=20 + n % 7, charge=20 + n % 6
            )
        else:
            policy = 2 * tens + which % 2
            name = f"look_{number}"
            text = MISSION.format(n=number, policy=policy, version=1 + policy % 9, skill=skill, height=18 + number % 9)
        (folder / f"{name}.rts").write_text(text, encoding="utf-8")


class Time(NamedTuple):
    """Elapsed seconds from start to exit, and processor time: equal on a quiet machine."""

    elapsed: float
    worked: float


def seconds(words: list[str], folder: Path, environment: dict[str, str]) -> Time:
    """Return the times of one run."""
    start, before = perf_counter(), getrusage(RUSAGE_CHILDREN)
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    taken, after = perf_counter() - start, getrusage(RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stdout + done.stderr
    return Time(taken, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    ours = [sys.executable, "-m", "rtshcua"]
    with TemporaryDirectory(prefix="rtshcua-lint-") as made:
        place = Path(made)
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        own = {"PYTHONPYCACHEPREFIX": str(place / "bytecode"), "RTSHCUA_DATA_DIR": str(place / "own"), "NO_COLOR": "1"}
        environment |= own
        for name, files in (("few", FEW), ("many", MANY)):
            (place / name).mkdir()
            project(place / name, files)
        asked = {
            "python -c pass": ([sys.executable, "-c", "pass"], "few"),
            "lint of 20 files, cold": ([*ours, "lint", "--no-cache", "."], "few"),
            "lint of 200 files, warm": ([*ours, "lint", "."], "many"),
            "check of 20 files": ([*ours, "check", "."], "few"),
        }
        for words, folder in asked.values():
            seconds(words, place / folder, environment)  # warm-up: byte code and caches
        taken: dict[str, list[Time]] = {name: [] for name in asked}
        for _ in range(ROUNDS):
            for name, (words, folder) in asked.items():
                taken[name].append(seconds(words, place / folder, environment))
    elapsed = [min(each.elapsed for each in times) for times in taken.values()]  # the fastest run counts
    bare, *worked = (min(each.worked for each in times) for times in taken.values())
    held = True
    for name, time, whole in zip(list(taken)[1:], worked, elapsed[1:], strict=True):
        limit = {"lint of 20 files, cold": COLD_S, "lint of 200 files, warm": WARM_S}.get(name)
        told = ""
        if limit is not None:
            most = limit * 1e3 / BARE_MS
            held = held and time / bare <= most
            told = f", limit {most:.0f} (issue 6: {limit} s)"
        print(
            f"lint: {name} takes {time / bare:.1f} times `python -c pass`{told}; {time:.2f} s against "
            f"{bare * 1e3:.0f} ms of processor time, and {whole:.2f} s on the clock"
        )
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
