"""Random programs, and an oracle for the compiler's proofs by dense sampling of places, heights and times.

The oracle shares no code with the proofs. It does not import the package, and uses floats in metres and seconds.

Only certain verdicts count: a program is `bad` where some sample is wrong by more than `SURE` (in metres, a moment
in seconds is wrong or not), and `good` where all keep more than the margins that belong to a plan (ADR 55).
"""

from collections.abc import Iterator
from math import cos, hypot, pi, radians, sin, sqrt
from random import Random
from typing import NamedTuple

import numpy as np

#: the vehicle's home, degrees; its local time is two hours ahead of UTC
HOME = (47.39774, 8.54559)
ERROR = 3.0
SURE, CLEAR = 0.6, 2.5
DAY = 86_400
#: 2026-06-01T00:00Z, seconds
MIDNIGHT = 20_605 * DAY
#: seconds: from the issue to the first step; deadline and longest duration of the steps; duration of a return
WAIT, TAKEOFF, FLY, RETURN = 300, (10, 60), (5, 120), (10, 240)
HOVER, HOMEWARD, ALL_LINKS = 10, 240, 1_500


def _scale() -> tuple[float, float]:
    """Metres for a degree of latitude and of longitude at home, on the ellipsoid WGS 84."""
    a, e2 = 6_378_137.0, 0.00669437999014
    s = sin(radians(HOME[0]))
    meridian = a * (1 - e2) / sqrt(1 - e2 * s * s) ** 3
    return meridian * pi / 180, a / sqrt(1 - e2 * s * s) * cos(radians(HOME[0])) * pi / 180


NORTH, EAST = _scale()


def written(x: float, y: float) -> str:
    """Format a place as in sources."""
    return f"{HOME[0] + y / NORTH:.7f} N, {HOME[1] + x / EAST:.7f} E"


class Zone(NamedTuple):
    """A circle or a box with heights, and its times: local seconds of the day, or seconds of UTC."""

    name: str
    x: float
    y: float
    wide: float
    high: float  # 0: a circle
    ceiling: float
    daily: tuple[int, int] | None
    dates: tuple[int, int] | None

    def source(self) -> str:
        """Return its declaration in the language."""
        x, y, w, h = self.x, self.y, self.wide, self.high
        corners = [(x - w, y - h), (x + w, y - h), (x + w, y + h), (x - w, y + h)]
        shape = (
            f"polygon({', '.join(written(*each) for each in corners)})" if h else f"circle({written(x, y)}, {w:.0f} m)"
        )
        text = f"zone {self.name} = {shape}"
        if self.ceiling < 1_000:
            text += f"  ceiling {self.ceiling:.0f} m"
        if self.daily:
            text += "  active " + " .. ".join(f"{each // 3600:02}:{each // 60 % 60:02}" for each in self.daily)
        if self.dates:
            text += "  active " + " .. ".join(f'"{_moment(each)}"' for each in self.dates)
        return text + "\n"

    def depth(self, x: float, y: float, z: float) -> float:
        """The depth of a place inside the zone, metres; negative outside, at most by its distance."""
        if self.high:
            flat = min(self.wide - abs(x - self.x), self.high - abs(y - self.y))
        else:
            flat = self.wide - hypot(x - self.x, y - self.y)
        return min(flat, self.ceiling - z)

    def exists(self, at: float) -> bool:
        """Whether it exists at a UTC time."""
        if self.dates and not self.dates[0] <= at <= self.dates[1]:
            return False
        if not self.daily:
            return True
        start, end = self.daily
        return (at + 7_200 - start) % DAY <= (end - start) % DAY


def _moment(at: int) -> str:
    seconds = at - MIDNIGHT
    return f"2026-06-{1 + seconds // DAY:02}T{seconds // 3600 % 24:02}:{seconds // 60 % 60:02}Z"


class Leg(NamedTuple):
    """A step: start and end, m, and its earliest begin and latest end, s after the issue."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    latest: int
    ended: int
    flies: bool  # a step of the skill `fly`
    home: bool


class Drawn(NamedTuple):
    """A random program with the time of issue of its mission, s of UTC; 0 if unknown."""

    text: str
    issued: int
    zones: tuple[Zone, ...]
    inside: tuple[Zone, ...]
    outside: tuple[Zone, ...]
    maintain: tuple[bool, Zone] | None
    permit: tuple[bool, Zone] | None
    forbid: tuple[bool, Zone] | None
    legs: tuple[Leg, ...]
    within: float
    returns: float  # the return altitude above home; 0: not declared


def zone(of: Random, name: str, dated: bool) -> Zone:
    """Draw a zone near home."""
    daily, dates = None, None
    kind = of.random()
    if kind < 0.45:
        start = of.randrange(0, DAY, 600)
        daily = (start, (start + of.choice([120, 600, 3_600, 40_000 // 60 * 60, DAY - 600, DAY - 120])) % DAY)
    elif kind < 0.65 and dated:
        start = MIDNIGHT + of.randrange(0, 2 * DAY, 600)
        dates = (start, start + of.choice([120, 3_600, DAY, 20 * DAY]))
    wide = float(of.choice([8, 20, 45, 90, 200, 320]))
    return Zone(
        name, of.uniform(-110, 110), of.uniform(-110, 110),
        wide, wide * of.uniform(0.3, 1) if of.random() < 0.5 else 0.0,
        float(of.choice([15, 27, 1_000, 1_000, 1_000])), daily, dates,
    )  # fmt: skip


def draw(seed: int) -> Drawn:
    """Draw the program of a seed."""
    of = Random(seed)
    issued = 0 if of.random() < 0.3 else MIDNIGHT + of.randrange(DAY) // 60 * 60 + 7
    zones = tuple(zone(of, f"z{number}", bool(issued)) for number in range(of.randint(1, 4)))
    within = of.choice([1.0, 1.0, 10.0])
    inside: list[Zone] = []
    outside: list[Zone] = []
    for each in zones:
        kind = of.random()
        if kind < 0.45:
            outside.append(each)
        elif kind < 0.6 and each.wide > 100:
            inside.append(each)
    rules = [
        (of.random() < 0.5, of.choice(zones)) if of.random() < 0.25 else None for _ in ("maintain", "permit", "forbid")
    ]
    maintain, permit, forbid = rules
    legs, steps, at, latest = [], [], (0.0, 0.0, 0.0), WAIT
    altitude = float(of.choice([10, 20, 30]))
    latest += TAKEOFF[0]
    legs.append(Leg(at, (0.0, 0.0, altitude), latest, latest + TAKEOFF[1], False, False))
    latest, at = latest + TAKEOFF[1], (0.0, 0.0, altitude)
    steps.append(f"takeoff({altitude:.0f} m)")
    for _ in range(of.randint(1, 3)):
        to = (of.uniform(-110, 110), of.uniform(-110, 110), float(of.choice([10, 20, 30])))
        latest += FLY[0]
        legs.append(Leg(at, to, latest, latest + FLY[1], True, False))
        latest, at = latest + FLY[1], to
        steps.append(f"fly({written(to[0], to[1])}, {to[2]:.0f} m)")
    latest += RETURN[0]
    legs.append(Leg(at, (0.0, 0.0, 0.0), latest, latest + RETURN[1], False, True))
    steps.append("return_home()")
    returns = of.choice([0.0, 18.0, 29.0, 30.0, 40.0])
    text = _text(zones, inside, outside, maintain, permit, forbid, steps, within, returns)
    return Drawn(
        text, issued, zones, tuple(inside), tuple(outside), maintain, permit, forbid, tuple(legs), within, returns
    )


def _side(rule: tuple[bool, Zone]) -> str:
    return f"{'inside' if rule[0] else 'outside'} {rule[1].name}"


def _text(
    zones: tuple[Zone, ...], inside: list[Zone], outside: list[Zone], maintain: tuple[bool, Zone] | None,
    permit: tuple[bool, Zone] | None, forbid: tuple[bool, Zone] | None, steps: list[str], within: float, returns: float,
) -> str:  # fmt: skip
    lists = [("inside", inside), ("outside", outside)]
    airspace = " ".join(f"{word} {', '.join(each.name for each in some)}" for word, some in lists if some)
    names = ("signals", "takeoff", "hover", "return_home", "emergency_land")
    return "".join(
        (
            *(f'import "lib:skills/{name}.rts"\n' for name in names),
            f'vehicle quad {{\n  identity "quad-07"\n  home {written(0, 0)} within {within:.0f} m\n',
            f"  speed at most 12 m/s  climb at most 3 m/s\n  position error {ERROR:.0f} m\n",
            "  energy 100 % = 18 min hover  reserve 15 %\n",
            f"  return at {returns:.0f} m\n" if returns else "",
            "  clock utc +02:00\n}\n",
            *(each.source() for each in zones),
            "skill fly(target: position, altitude: altitude in 5 m .. 60 m) {\n  motion fly to target at altitude\n",
            f"  class tactical\n  deadline {FLY[0]} s\n  valid for 40 min\n  lasts at most {FLY[1]} s\n",
            f"  maintain position {_side(maintain)}\n" if maintain else "",
            f"  fallback hover for {HOVER} s, return_home, emergency_land\n  energy at most 15 %\n}}\n",
            "policy rules version 1 {\n  permit takeoff, hover, return_home, emergency_land by any\n",
            "  permit fly by any",
            f" when target {_side(permit)}\n" if permit else "\n",
            f"  forbid fly by any when target {_side(forbid)}\n" if forbid else "",
            f"  airspace {airspace}\n" if airspace else "",
            "  contingency return_home, emergency_land\n}\n",
            "mission flight under rules@1 on quad {\n  proposed by agent x for role operator\n  phase departure {\n",
            *(f"    {step}\n" for step in steps),
            "  }\n}\n",
        )
    )


# ------------------------------------------------------------------------------------------------------ the oracle


def _between(start: tuple[float, ...], end: tuple[float, ...]) -> Iterator[tuple[float, float]]:
    count = int(hypot(end[0] - start[0], end[1] - start[1]) / 1.5) + 1
    for at in range(count + 1):
        yield start[0] + (end[0] - start[0]) * at / count, start[1] + (end[1] - start[1]) * at / count


def _homes(within: float) -> list[tuple[float, float]]:
    ring = [(within * cos(k * pi / 8), within * sin(k * pi / 8)) for k in range(16)]
    return [(0.0, 0.0), *(ring if within else ())]


class Extent(NamedTuple):
    """The least and the greatest depth inside a zone of a volume's places, widened by the error."""

    least: float
    most: float


def _extent(zone: Zone, places: list[tuple[float, float]], low: float, high: float) -> Extent:
    steps = ERROR * np.array([-1.0, 0.0, 1.0])
    at = np.array(places)
    x = (at[:, 0, None, None] + steps[None, :, None] + 0 * steps[None, None, :]).ravel() - zone.x
    y = (at[:, 1, None, None] + 0 * steps[None, :, None] + steps[None, None, :]).ravel() - zone.y
    box = np.minimum(zone.wide - np.abs(x), zone.high - np.abs(y))
    flat = box if zone.high else zone.wide - np.hypot(x, y)
    return Extent(min(float(flat.min()), zone.ceiling - high), min(float(flat.max()), zone.ceiling - low))


def _moments(low: float, high: float) -> list[float]:
    """Return the times to sample: every 10 s, and both ends."""
    return [*(low + 10 * k for k in range(int((high - low) / 10) + 1)), high]


class Need(NamedTuple):
    """A zone must, or must not, exist from `low` to `high` s after the issue. `sure`: independent of the margins."""

    zone: Zone
    exists: bool
    low: int
    high: int


class Needs(NamedTuple):
    """The needs without and with all margins; `never` and `hardly` mean that no time satisfies them."""

    never: bool
    hardly: bool
    sure: tuple[Need, ...]
    all: tuple[Need, ...]


def _stay(
    zone: Zone, inside: bool, extent: Extent, low: int, high: tuple[int, int]
) -> Iterator[tuple[bool, Need | None]]:
    """The needs of a volume for a zone: from `low` to the earlier `high` surely, and to the later with all margins."""
    if inside:
        if extent.least < -SURE:
            yield True, None
        if extent.least < CLEAR:
            yield False, None
        yield True, Need(zone, True, low, high[0])
        yield False, Need(zone, True, low, high[1])
    else:
        if extent.most > SURE:
            yield True, Need(zone, False, low, high[0])
        if extent.most > -CLEAR:
            yield False, Need(zone, False, low, high[1])


def needs(program: Drawn) -> Needs:
    """Return the needs of a program."""
    found: list[tuple[bool, Need | None]] = []
    airspace = [*((each, True) for each in program.inside), *((each, False) for each in program.outside)]
    last = program.legs[-1].ended
    for leg in program.legs:
        path = list(_between(leg.start, leg.end))
        low, high = sorted((leg.start[2], leg.end[2]))
        for each, side in airspace:
            if leg.home:
                found += _homeward(program, each, side, [leg.start[:2]], high, high, (leg.ended, leg.ended))
            else:
                found += _stay(each, side, _extent(each, path, low, high), 0, (leg.ended, leg.ended))
                until = (leg.ended + HOMEWARD, leg.ended + ALL_LINKS)
                found += _homeward(program, each, side, path[::2], low, high, until)
        if leg.flies:
            if program.maintain:
                side, each = program.maintain
                found += _stay(each, side, _extent(each, path, low, high), 0, (leg.ended, leg.ended))
            for rule, wanted in ((program.permit, True), (program.forbid, False)):
                if rule:
                    side, each = rule
                    depth = each._replace(ceiling=1_000.0).depth(*leg.end)  # the height of a parameter does not count
                    found += _asked(each, side == wanted, depth, leg.latest)
    for each, side in airspace:
        extent = _extent(each, _homes(program.within), 0, 0)
        found += _stay(each, side, extent, 0, (last, last))
    return Needs(
        any(sure and need is None for sure, need in found),
        any(need is None for _, need in found),
        tuple(need for sure, need in found if sure and need is not None),
        tuple(need for sure, need in found if not sure and need is not None),
    )


def _homeward(
    program: Drawn, zone: Zone, inside: bool, starts: list[tuple[float, float]], low: float, high: float,
    until: tuple[int, int],
) -> Iterator[tuple[bool, Need | None]]:  # fmt: skip
    """The needs of the ways home from some places between two heights for a zone: climb, cruise and descent."""
    homes, returns = _homes(program.within), program.returns
    top = max(high, returns)
    # near home a return may stay low: the default cones reach out to 10 m, or a third of the height
    near = max(10.0, returns / 3) + program.within + ERROR
    surely, hardly = ([not returns or hypot(*at) < near + each for at in starts] for each in (-SURE, CLEAR))
    for low_from, kinds in ((surely, (True, False)),) if surely == hardly else ((surely, (True,)), (hardly, (False,))):
        parts = [(homes, 0.0, top)]
        for lowly, least in ((True, low), (False, max(low, returns - 2.0))):
            some = [at for at, is_low in zip(starts, low_from, strict=True) if is_low == lowly]
            ways = [place for at in some for home in homes for place in list(_between(at, home))[::2]]
            parts += [(ways, least, top), (some, low, top)] if some else []
        for part in parts:
            yield from (each for each in _stay(zone, inside, _extent(zone, *part), 0, until) if each[0] in kinds)


def _asked(zone: Zone, inside: bool, depth: float, latest: int) -> Iterator[tuple[bool, Need | None]]:
    """The needs of a place for a zone when its step begins."""
    return _stay(zone, inside, Extent(depth, depth), 0, (latest, latest))


def _met(need: Need, issued: int) -> bool:
    return all(need.zone.exists(at) == need.exists for at in _moments(issued + need.low, issued + need.high))


def judged(program: Drawn) -> bool | None:
    """Return whether a program is good; None if it is within the margins."""
    needed = needs(program)
    if needed.never:
        return False
    issues = [program.issued] if program.issued else [MIDNIGHT + 60 * minute for minute in range(1_440)]
    if not any(all(_met(need, issue) for need in needed.sure) for issue in issues):
        return False
    if not needed.hardly and any(all(_met(need, issue) for need in needed.all) for issue in issues):
        return True
    return None
