"""Write a plan as source: the zones of its fence, a policy to begin with, and the mission.

PX4 requires a vehicle to be inside any of the fence's areas, ArduPilot inside all of them; outside of all exclusions,
both.
"""

from collections.abc import Iterator, Sequence
from decimal import Decimal
from math import isqrt
from typing import Final, NamedTuple

from rtshcua.ground.exchange.losses import Loss, comment
from rtshcua.ground.exchange.plan_steps import ImportedStep, flying_items
from rtshcua.ground.exchange.plan_surveys import CoveredSurvey
from rtshcua.ground.exchange.qgc_reading import QgcFence, QgcItem, QgcPlan, degrees_e7
from rtshcua.ground.exchange.stock_policy import (
    CLIMB,
    CRUISE,
    FLIGHT_S,
    LEAST_HIGHEST_MM,
    WITHIN_MM,
    GeoPoint,
    percent,
    size_line,
    vehicle_lines,
)
from rtshcua.ground.exchange.zone_source import SourceNames, SourceZone, circle_text, metres, polygons_text
from rtshcua.ground.gateway.translation import SEA_FRAMES
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.mavlink import enums
from rtshcua.model.flat.zone import Projection, project

#: the highest altitude and the longest duration that the library's skills can be sized for
_HIGHEST_MM, _LONGEST_S = 500_000, 1_800
_SHORTEST_S: Final = 10
#: room around the places of a plan without a fence, and above its heights, mm
_ROOM_MM, _HEADROOM_MM = 50_000, 10_000
_RETURN_MM: Final = 30_000
_FASTEST: Final = 12_000  # mm/s, of the vehicle
_DEFAULT_FASTEST: Final = 8_000
_LONGEST_MIN: Final = 240  # the longest lifetime of an invocation
#: time to accelerate, to brake and to settle at a place, s
_TURN_S: Final = 12
#: skills that end a mission
_LAST: Final = ("return_home", "emergency_land")


class FenceZones(NamedTuple):
    """The zones of a fence, and which of them the airspace is inside and outside of."""

    zones: tuple[SourceZone, ...]
    inside: tuple[str, ...]
    outside: tuple[str, ...]

    def airspace(self) -> str:
        """The item of a policy; empty without zones."""
        parts = (
            f"{word} {', '.join(some)}" for word, some in (("inside", self.inside), ("outside", self.outside)) if some
        )
        told = " ".join(parts)
        return f"airspace {told}" if told else ""


def fence_zones(plan: QgcPlan, names: SourceNames) -> FenceZones:
    """The zones of a plan's fence."""
    zones: list[SourceZone] = []
    inside: list[str] = []
    outside: list[str] = []
    for fence in plan.fences:
        name = names.of("fence" if fence.inclusion else "no_fly", "fence")
        zones.append(SourceZone(name, (f"of the plan: {fence.place}",), _shape(fence)))
        (inside if fence.inclusion else outside).append(name)
    if len(inside) > 1 and not plan.is_ardupilot:
        whole = names.of("fence_areas", "fence")
        zones.append(SourceZone(whole, ("PX4: inside any of these",), f"union({', '.join(inside)})"))
        inside = [whole]
    return FenceZones(tuple(zones), tuple(inside), tuple(outside))


def _shape(fence: QgcFence) -> str:
    return circle_text(*fence.centre, fence.radius_mm) if fence.polygon is None else polygons_text([fence.polygon])


class PlanExtent(NamedTuple):
    """How far a plan flies: its farthest place from home, mm; its highest altitude above home, mm; the longest time of
    a leg and of a wait, s; the greatest speed, mm/s; the number of its items; and the time of its surveys, s.
    """

    farthest: int
    height: int
    leg_s: int
    wait_s: int
    speed: int
    items: int
    surveys_s: int = 0


def extent_of(plan: QgcPlan, home: GeoPoint, surveys: Sequence[CoveredSurvey] = ()) -> PlanExtent:
    """The extent of a plan around a home. Its surveys begin after the flights at their places."""
    plane = projection_at(home.latitude, home.longitude)
    speeds = _speeds(plan)
    slowest = min((int(each * 1000) for each in speeds if each >= 1), default=CRUISE)
    ends = {each.place: each for each in surveys}
    way, legs = [(0, 0, 0)], [0]
    for item in flying_items(plan):
        way.append((*_place_of(item, plane, way[-1][:2]), _above_home(item, plan.home_above_sea)))
        legs.append(_leg_s(way[-2], way[-1], slowest))
        if item.place in ends:
            way.append((*ends[item.place].end, ends[item.place].highest))
    waits = [each.params[0] or 0 for each in plan.items if each.command not in _NOT_WAITING]
    return PlanExtent(
        max((*(_length(x, y) for x, y, _ in way), *(each.farthest for each in surveys))),
        max((*(height for _, _, height in way), *(each.highest for each in surveys))),
        max(legs),
        int(max(waits, default=0)),
        int(max(speeds, default=0) * 1000),
        len(way) + len(surveys),
        sum(each.seconds for each in surveys),
    )


def _speeds(plan: QgcPlan) -> list[Decimal | int]:
    return [each.params[1] or 0 for each in plan.items if each.command == enums.MAV_CMD_DO_CHANGE_SPEED]


def _place_of(item: QgcItem, plane: Projection, last: tuple[int, int]) -> tuple[int, int]:
    """The place of an item in the local plane; the last one if it names none."""
    latitude, longitude = item.params[4:6]
    return project(plane, degrees_e7(latitude), degrees_e7(longitude)) if latitude and longitude else last


def _leg_s(begin: tuple[int, int, int], end: tuple[int, int, int], slowest: int) -> int:
    """The time of a leg, with acceleration and its climb or descent, at most."""
    level = -(-_length(end[0] - begin[0], end[1] - begin[1]) // min(slowest, CRUISE))
    return level - (-abs(end[2] - begin[2]) // CLIMB) + _TURN_S


_NOT_WAITING: Final = (enums.MAV_CMD_NAV_TAKEOFF, enums.MAV_CMD_NAV_LAND, enums.MAV_CMD_DO_CHANGE_SPEED, 84, 85)


def _length(x: int, y: int) -> int:
    return isqrt(x * x + y * y)


def _above_home(item: QgcItem, home_above_sea: int | None) -> int:
    """The height of an item; 0 if it is above sea, and home's height is not known."""
    height = round((item.params[6] or 0) * 1000)
    if item.frame not in SEA_FRAMES:
        return height
    return 0 if home_above_sea is None else height - home_above_sea


class PolicyDraft(NamedTuple):
    """A policy to begin with, its name, and the losses of the plan that it makes up for."""

    name: str
    text: str
    losses: tuple[Loss, ...]


def draft_policy(
    plan: QgcPlan, home: GeoPoint, names: SourceNames, surveys: Sequence[CoveredSurvey] = ()
) -> PolicyDraft:
    """A policy for a plan, with the library's vehicle and skills: it permits what the plan needs, inside its fence.
    Each of its surveys has a skill.
    """
    extent, losses = extent_of(plan, home, surveys), []
    fence = fence_zones(plan, names)
    skills = ", ".join(["takeoff", "goto", *(each.step.skill for each in surveys)])
    fence = fence._replace(outside=(*fence.outside, *(each.keep_out for each in surveys if each.keep_out)))
    if not fence.inside:
        radius = -(-(extent.farthest + _ROOM_MM) // 10_000) * 10_000
        field = SourceZone(names.of("field", "field"), ("made up: around all places of the plan",),
                           circle_text(*home, radius))  # fmt: skip
        fence = FenceZones((field, *fence.zones), (field.name,), fence.outside)
        losses.append(Loss("no-fence", "/geoFence", f"a circle of {metres(radius)} around home"))
    highest = min(-(-max(extent.height, LEAST_HIGHEST_MM) // 1_000) * 1_000, _HIGHEST_MM)
    name = names.of("imported", "imported")
    lines = [
        *(f'import "lib:skills/{each}.rts"' for each in ("signals", "takeoff", "goto", "hover", *_LAST)),
        "",
        *_sizes(extent, highest),
        "",
        "// The figures are those that stock PX4 and ArduCopter keep: use those of your vehicle.",
        *vehicle_lines(
            "imported-01",
            home,
            WITHIN_MM,
            max((_RETURN_MM, *(each.clear for each in surveys))),
            plan.home_above_sea,
            max(15, percent(_landing_s(highest))),
            sorted({each.camera for each in surveys}),
        ),
        "",
        *(each.text() for each in fence.zones),
        *(zone.text() for each in surveys for zone in each.zones),
        *(f"{each.skill}\n" for each in surveys),
        "// A policy to begin with: it permits what this plan needs. Whatever no rule permits is denied.",
        f"policy {name} version 1 {{",
        f"  permit  takeoff, goto by role operator through operator, agent when altitude <= {metres(highest)}",
        *(f"  permit  {each.step.skill} by role operator through operator, agent" for each in surveys),
        "  permit  hover, return_home, emergency_land by any",
        f"  degrade {skills}, hover when battery < 25 % to return_home",
        f"  {fence.airspace()}",
        "  contingency hover for 10 s, return_home, emergency_land",
        "}",
        "",
    ]
    return PolicyDraft(name, "\n".join(lines), tuple(losses))


def _sizes(extent: PlanExtent, highest: int) -> Iterator[str]:
    """The sizes of the skills: for the longest leg, wait and return, so that many steps fit into one charge."""
    climb_s = -(-highest // CLIMB)
    home_s = min(-(-extent.farthest // CRUISE) + 2 * climb_s + 60, _LONGEST_S)
    fastest = min(max(extent.speed, _DEFAULT_FASTEST), _FASTEST)
    high = f"highest = {metres(highest)}, "
    # each step may wait for those before it
    minutes = min((extent.items * (extent.leg_s + _TURN_S) + extent.surveys_s) // 60 + 10, _LONGEST_MIN)
    short, long = (f"lifetime = {max(least, minutes)} min, " for least in (40, 60))
    leg_s = min(max(extent.leg_s, _SHORTEST_S), _LONGEST_S)
    charge = min(-(-100 * leg_s // FLIGHT_S), 80)
    yield size_line("takeoff", high, climb_s + 15, 60, 4)
    yield f"sizes goto({high}{short}fastest = {metres(fastest)}/s, longest = {leg_s} s, charge = {charge} %)"
    yield size_line("hover", short, min(extent.wait_s + 15, _LONGEST_S), 35, 4)
    yield size_line("return_home", long, home_s, 120, 9)
    yield size_line("emergency_land", long, _landing_s(highest), 120, 8)


def _landing_s(highest: int) -> int:
    return -(-highest // CLIMB) + 30


class MissionHeader(NamedTuple):
    """What a mission's source names: its own name, the policy and its version, the vehicle, the kind of its proposer
    (`operator` or `agent`), and the file that it comes from.
    """

    name: str
    policy: str
    version: int
    vehicle: str
    proposer: str
    origin: str


def mission_text(header: MissionHeader, steps: Sequence[ImportedStep]) -> str:
    """The mission, in three phases: up to the first climb, the work, and the return or landing at the end."""
    first = next((at for at, each in enumerate(steps) if each.step.skill == "takeoff"), -1) + 1
    last = len(steps)
    while last > first and steps[last - 1].step.skill in _LAST:
        last -= 1
    phases = (("departure", steps[:first]), ("inspection", steps[first:last]), ("recovery", steps[last:]))
    intent = comment(header.origin).replace("\\", "\\\\").replace('"', '\\"')
    lines = [
        f"mission {header.name} under {header.policy}@{header.version} on {header.vehicle} {{",
        f'  intent "Imported from {intent}."',
        f"  proposed by {header.proposer} import for role operator",
    ]
    for phase, some in phases:
        if some:
            lines += ["", f"  phase {phase} {{", *(f"    {step_text(each)}" for each in some), "  }"]
    return "\n".join([*lines, "}", ""])


def step_text(planned: ImportedStep) -> str:
    """A step as a call with named arguments."""
    arguments = ", ".join(f"{name} = {text}" for name, text in planned.step.arguments.items())
    return f"{planned.step.skill}({arguments})"
