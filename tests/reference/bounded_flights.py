"""Random missions of a vehicle with random declared speeds, and a simulated vehicle with exactly these speeds.

Tests compare the proved bounds on time, height and charge with these flights.
"""

from math import cos, radians, sin
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.ground.prove.mission_bounds import Bounds
from rtshcua.mavlink import dialect
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.surroundings import Wind
from rtshcua.virtual.fitting import fitting
from virtual import case

LIBRARY = str(Path(__file__).resolve().parents[2])
#: metres for a degree of latitude, and of longitude at home: exact enough to place steps
NORTH, EAST = 111_200.0, 75_500.0
HOME = (47.39774, 8.54559)


class Keeps(NamedTuple):
    """The declared least speeds of the vehicle: m/s, m, and m/s per second."""

    cruise: float
    climb: float
    descent: float
    landing: float
    homeward: float
    gains: float
    air: float
    wind: float
    returns: int


class Drawn(NamedTuple):
    """A mission as text, the least speeds of its vehicle, the direction of the wind, and the largest height in m."""

    text: str
    keeps: Keeps
    wind_from: int
    highest: float


def draw(seed: int) -> Drawn:
    """Draw the mission of a seed."""
    of = Random(seed)
    cruise, air = of.choice([3.0, 5.0, 7.0]), of.choice([12.0, 14.0])
    keeps = Keeps(
        cruise,
        of.choice([1.0, 1.5, 2.5]),
        of.choice([0.8, 1.0, 1.5]),
        of.choice([0.3, 0.5, 0.7]),
        of.choice([cruise, cruise - 1]),
        of.choice([0.75, 1.0]),
        air,
        of.choice([0.0, 3.0, 6.0, 8.0]),
        of.choice([10, 25, 40]),
    )
    height = of.choice([8, 15, 30])
    steps, heights = [f"up({height} m)"], [height]
    for _ in range(of.randint(1, 4)):
        height = of.choice([height, height, 6, 12, 25, 38])
        speed = of.choice(["", "", f", pace = {of.choice([2, 4, 8])} m/s"])
        match of.randrange(4):
            case 0:
                steps.append(f"wait({of.randint(1, 20)} s)")
                continue
            case 1:
                pattern = of.choice(["grid", "perimeter", "orbit"])
                steps.append(f"survey(area, {height} m, {pattern}, {of.choice([3, 5, 8])} m/s)")
            case _:
                steps.append(f"fly({_place(of, of.choice([5, 40, 120]))}, {height} m{speed})")
        heights.append(height)
    steps.append(of.choice(["come_home()", "come_home()", "come_down()"]))
    text = _text(keeps, steps, _place(of, 90), of.choice([15, 30]))
    return Drawn(text, keeps, of.randrange(360), max(*heights, keeps.returns))


def _place(of: Random, far: float) -> str:
    angle, away = radians(of.uniform(0, 360)), of.uniform(0.2, 1) * far
    return f"{HOME[0] + away * cos(angle) / NORTH:.7f} N, {HOME[1] + away * sin(angle) / EAST:.7f} E"


def _text(keeps: Keeps, steps: list[str], area: str, wide: int) -> str:
    """The source. Each skill may take long and use much charge: the bounds are proved for each step."""
    here = f"{HOME[0]} N, {HOME[1]} E"

    def skill(name: str, motion: str, energy: int, fallback: str = "come_home, come_down") -> str:
        chain = f"  fallback {fallback}\n" if fallback else ""
        return (
            f"skill {name} {{\n  motion {motion}\n  class tactical\n  deadline 10 s\n  valid for 90 min\n"
            f"  lasts at most 8 min\n  grace 5 s\n{chain}  energy at most {energy} %\n}}\n"
        )

    return "".join(
        (
            'import "lib:skills/signals.rts"\n',
            f'vehicle quad {{\n  identity "quad-07"\n  home {here} within 5 m\n',
            "  speed at most 12 m/s  climb at most 3 m/s\n  position error 3 m\n",
            "  energy 100 % = 40 min hover, 26 min flight  reserve 20 %\n",
            f"  return at {keeps.returns} m\n  brakes from 12 m/s in 6 s after 500 ms\n",
            f"  speeds cruise {keeps.cruise} m/s, climb {keeps.climb} m/s, descent {keeps.descent} m/s,",
            f" landing {keeps.landing} m/s below 10 m, return {keeps.homeward} m/s, air {keeps.air} m/s\n",
            f"  accelerates to {keeps.gains} m/s in 1 s\n  wind at most {keeps.wind} m/s\n",
            "  clock utc +02:00\n",
            "  without wind.speed, obstacle.distance, link.quality, battery.voltage\n}\n",
            f"zone area = circle({area}, {wide} m)\n",
            skill("come_down()", "land", 16, ""),
            skill("come_home()", "home", 22, "come_down"),
            skill("up(to: altitude in 5 m .. 50 m)", "climb to to", 6),
            skill("wait(time: duration in 1 s .. 30 s)", "hold for time", 4),
            skill(
                "fly(aim: position, top: altitude in 5 m .. 50 m, pace: speed in 1 m/s .. 9 m/s)",
                "fly to aim at top speed pace",
                10,
            ),
            skill("go(aim: position, top: altitude in 5 m .. 50 m)", "fly to aim at top", 10),
            skill(
                "survey(over: zone, top: altitude in 5 m .. 50 m, pattern: one of grid, perimeter, orbit,"
                " pace: speed in 1 m/s .. 9 m/s)",
                "cover over at top pattern pattern speed pace",
                16,
            ),
            "policy rules version 1 {\n  permit any by any\n  contingency come_home, come_down\n}\n",
            "mission flight under rules@1 on quad {\n  proposed by agent x for role operator\n  phase departure {\n",
            *(f"    {_named(step)}\n" for step in steps),
            "  }\n}\n",
        )
    )


def _named(step: str) -> str:
    """Return a step with the right skill: a flight without a speed uses the skill without one."""
    return step.replace("fly(", "go(") if step.startswith("fly(") and "pace" not in step else step


def compiled(drawn: Drawn) -> Compiled:
    """Compile the mission, with its findings."""

    def read(path: str) -> bytes:
        return drawn.text.encode() if path == "probe.rts" else Path(path).read_bytes()

    return compile_program(
        load(["probe.rts"], read, LIBRARY), dialect.load(), mission=None, issued_at_us=case.flat.ISSUED
    )


def simulated(drawn: Drawn, of: Compiled, flavour: str) -> SimulationConfig:
    """Return a vehicle with exactly the declared speeds, in the strongest wind."""
    keeps = drawn.keeps
    if flavour == "px4":
        parameters: dict[str, float] = {
            "MPC_TKO_SPEED": keeps.climb, "MPC_Z_VEL_MAX_UP": keeps.climb, "MPC_Z_VEL_MAX_DN": keeps.descent,
        }  # fmt: skip
    else:
        parameters = {
            "WPNAV_SPEED_UP": 100 * keeps.climb, "WPNAV_SPEED_DN": 100 * keeps.descent,
            "RTL_SPEED": 100 * keeps.homeward,
        }  # fmt: skip
    assert of.policy is not None
    chosen: dict[str, Any] = {
        "flavour": AutopilotKind(flavour),
        "cruise_mm_s": round(1_000 * keeps.cruise),
        "land_mm_s": round(1_000 * keeps.landing),
        "parameters": tuple(parameters.items()),
        "wind": Wind(round(1_000 * keeps.wind), drawn.wind_from),
    }
    return fitting(of.policy, **chosen)


def bounds(of: Compiled) -> Bounds:
    """Return the proved bounds of the mission."""
    assert of.bounds is not None
    return of.bounds
