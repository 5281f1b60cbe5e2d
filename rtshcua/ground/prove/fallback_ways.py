"""Prove that the fallbacks of a step stay in the airspace, wherever the step is aborted (E0514, E0515, E0508).

A fallback flies straight home (E0514) or to a fixed place (E0515). A step that flies home is proved like a fallback
(E0508). The way may begin at every place of the planned path and of the leg to it, and it is as wide as the vehicle's
position error. The way home climbs first, then crosses at the return altitude (`decision.volume.across`), and ends with
a descent at any place where home may be. On board, a link that would leave the airspace is not flown, and the vehicle
lands where it is. That is safe, but not what the chain declares.
"""

from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import NamedTuple

from msgspec.structs import replace

from rtshcua.decision.contracts import first_cell, longest
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation, PreparedLink
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.volume import SHORT, across, near_home
from rtshcua.decision.zones import PlaceSet as Places
from rtshcua.decision.zones import PreparedZone, Sweep
from rtshcua.diagnostics import codes
from rtshcua.ground.prove.airspace_keeping import HullSweep, Landmarks, Leg, Point, breach_text, disc, keeps, path_legs
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_starts import StartPlace, from_home, planned
from rtshcua.ground.prove.step_times import MissionStep, StepTime, zone_span
from rtshcua.model.flat.contract import PLACE, MotionKind
from rtshcua.model.flat.policy import VehicleLimits
from rtshcua.model.flat.zone import HIGHEST
from rtshcua.model.quantity import Dimension, display

_HOME = (0, 0)
_METRE = 1_000  # mm
#: a leg that is partly near home is split into parts not shorter than this, in mm
_SHORTEST = 1_000


class FlownPath(NamedTuple):
    """The places at which a link may begin, in the order of the path, and their heights in mm.

    If the last place is the end of an earlier link, `after` is the skill of that link.
    """

    points: tuple[Point, ...]
    low: int
    high: int
    after: str = ""


class Stretch(NamedTuple):
    """A part of a way: its description, the places between which it leads, in any order, and its heights in mm."""

    part: str
    points: tuple[Point, ...]
    low: int
    high: int


class Departure(NamedTuple):
    """The start of a way that leaves the airspace, and the part of the way that leaves it."""

    place: Point
    stretch: Stretch


@dataclass(frozen=True, slots=True)
class _LinkTime:
    """The time in which a link may fly, until `further` us after the latest begin of a step.

    `present` is the airspace without zones that cannot exist in that time.
    """

    period: StepTime
    further: int
    airspace: PreparedAirspace
    present: PreparedAirspace = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "present", self.period.present(self.airspace, self.further))


class FallbackWays:
    """Proves the ways of the fallbacks from the steps of one mission."""

    def __init__(self, proof: ProofContext) -> None:
        self._proof = proof
        self._vehicle = proof.policy.vehicle
        reach = self._vehicle.position_error + 1  # the middle of a leg is rounded by less than 1 mm
        self._box = (-reach, -reach, reach, reach)
        self._landmarks = Landmarks(proof.policy)
        self._homes = disc(self._vehicle.home_within)
        self._reported: set[Point] = set()
        self._nowhere: set[PreparedLink] = set()

    def prove(self, step: MissionStep, starts: Sequence[StartPlace]) -> None:
        """Report the first way from a step that leaves the airspace.

        The step itself is already proved to stay in the airspace, for home at its declared place.
        """
        airspace = self._proof.prepared.airspace
        if airspace is None or step.flat.plan.kind == MotionKind.LAND:
            return  # a landing has no way
        if step.flat.plan.kind == MotionKind.HOME:
            there = _LinkTime(step.time, step.prepared.lasts_us, airspace)
            for start in starts:
                if not self._link(step, None, FlownPath(((start.x, start.y),), start.height, start.height), there):
                    return
            return
        links = list(self._links(step.prepared))
        for start in starts:
            _, volume = planned(self._proof, step.prepared, start)
            path = step.flat.plan.path
            points = ((start.x, start.y), *zip(path[::2], path[1::2], strict=True))
            flown = FlownPath(points, *volume.height[:2])
            for link, lasts in links:
                if link in self._nowhere:
                    continue
                there = _LinkTime(step.time, step.prepared.lasts_us + lasts, airspace)
                if not self._link(step, link, flown, there):
                    return
                if link.motion == MotionKind.FLY:
                    flown = self._beyond(link, flown)

    def _links(self, invocation: PreparedInvocation) -> Iterator[tuple[PreparedLink, int]]:
        """Yield the links that may replace or abort a step, each with its latest end in us after the step.

        Links that hold or land are omitted: they have no way.
        """
        degrades = [[rule.target] for rule in invocation.candidates.degrades]
        before = 0  # the contingency flies after the step's own chain has failed
        for chain in (*degrades, invocation.chain, self._proof.prepared.contingency):
            lasts = before if chain is self._proof.prepared.contingency else 0
            for link in chain:
                lasts += self._lasts(link)
                if link.motion in (MotionKind.HOME, MotionKind.FLY, MotionKind.CLIMB):
                    yield link, lasts
            before = max(before, lasts)

    def _lasts(self, link: PreparedLink) -> int:
        policy = self._proof.policy
        return longest(policy.contracts[link.link.skill], policy.vehicle, link.link.limit_us)

    def _link(self, step: MissionStep, link: PreparedLink | None, flown: FlownPath, then: _LinkTime) -> bool:
        """Whether a link, or a step that flies home (None), stays in the airspace. Reports a way that does not."""
        home = link is None or link.motion == MotionKind.HOME
        if link is None or home:
            to: Sequence[Point] = self._homes
        else:
            to = [self._target(link)] if link.motion == MotionKind.FLY else []
            altitude = self._altitude(link)
            flown = flown._replace(low=min(flown.low, altitude), high=max(flown.high, altitude))
            if to and not self._keeps(Stretch("", tuple(to), altitude, altitude), then.present):
                self._nowhere.add(link)  # report it once: the target is outside from everywhere
                self._report(step, link, flown, Departure(to[0], Stretch("", (to[0],), altitude, altitude)), to, then)
                return False
        leaves = self._leaving(flown, to, home, then.present, self._vehicle, self._reported)
        if leaves is not None:
            self._reported.add(leaves.place)
            self._report(step, link, flown, leaves, to, then)
            return False
        missing = then.period.missing(then.airspace, then.further)
        if missing is not None:
            self._missing(step, link, missing, then)
            return False
        for zone in then.period.avoidable(then.airspace, then.further):
            alone = then.airspace._replace(inside=(), outside=(zone,))
            if self._leaving(flown, to, home, alone, self._vehicle) is not None:
                then.period.avoid(zone, then.further)
        for zone in then.airspace.inside:
            then.period.stay(zone, then.further)
        return True

    def _leaving(
        self,
        flown: FlownPath,
        to: Sequence[Point],
        home: bool,
        airspace: PreparedAirspace,
        vehicle: VehicleLimits,
        reported: AbstractSet[Point] = frozenset(),
    ) -> Departure | None:
        """Return a place of the path from which the straight way leaves the airspace, or None.

        Legs that begin at a `reported` place are skipped. `to` are all possible targets; it is empty for a climb.
        """
        zones = tuple(tuple(zone.number for zone in each) for each in (airspace.inside, airspace.outside))
        key = (flown.points, flown.low, flown.high, tuple(to), home and vehicle.return_altitude, zones)
        if key in self._proof.kept:
            return None
        legs = path_legs(flown.points)
        near = home and any(_comes_near(leg, near_home(vehicle)) for leg in legs)
        # fast path: usually the hull of the whole path stays in the airspace
        whole = _stretches(flown.points, flown, to, vehicle if home else None, near=near)
        if not all(self._keeps(each, airspace) for each in whole):
            for leg in legs:
                found = None if leg[0] in reported else self._leg(leg, flown, to, vehicle if home else None, airspace)
                if found is not None:
                    return Departure(leg[1], found)
        self._proof.kept.add(key)
        return None

    def _leg(
        self, leg: Leg, flown: FlownPath, to: Sequence[Point], returns: VehicleLimits | None, airspace: PreparedAirspace
    ) -> Stretch | None:
        """Return a part of a way from a leg that leaves the airspace. `returns` is the vehicle on a way home."""
        limit = 0 if returns is None else near_home(returns)
        near = returns is not None and returns.return_altitude > 0 and _comes_near(leg, limit)
        stretches = _stretches(leg, flown, to, returns, near=near)
        found = next((each for each in stretches if not self._keeps(each, airspace)), None)
        (ax, ay), (bx, by) = leg
        if found is None or not near or (ax - bx) ** 2 + (ay - by) ** 2 <= _SHORTEST**2:
            return found
        if _comes_near((leg[0], leg[0]), limit) and _comes_near((leg[1], leg[1]), limit):
            return found
        # only near home is the way low, so look at each half
        middle = ((ax + bx) // 2, (ay + by) // 2)
        halves = ((leg[0], middle), (middle, leg[1]))
        parts = (self._leg(half, flown, to, returns, airspace) for half in halves)
        return next((part for part in parts if part is not None), None)

    def _keeps(self, stretch: Stretch, airspace: PreparedAirspace) -> bool:
        """Whether the hull of a part of a way stays in the airspace."""
        return keeps(self._space(stretch), airspace) == TRUE

    def _space(self, stretch: Stretch) -> Places:
        sweep: Sweep = HullSweep(stretch.points, self._box, self._landmarks)
        return Places(((sweep, stretch.low, stretch.high),), 0)

    def _beyond(self, link: PreparedLink, flown: FlownPath) -> FlownPath:
        """Return the path with the target of a link added, since later links may begin there."""
        altitude = self._altitude(link)
        name = self._proof.policy.contracts[link.link.skill].name
        low, high = min(flown.low, altitude), max(flown.high, altitude)
        return FlownPath((*flown.points, self._target(link)), low, high, name)

    def _altitude(self, link: PreparedLink) -> int:
        return link.link.arguments[self._proof.policy.contracts[link.link.skill].motion.altitude]

    def _target(self, link: PreparedLink) -> Point:
        cell = first_cell(self._proof.policy.contracts[link.link.skill], PLACE)
        x, y = link.link.arguments[cell : cell + 2]
        return x, y

    def _missing(self, step: MissionStep, link: PreparedLink | None, zone: PreparedZone, then: _LinkTime) -> None:
        if link is None:
            return  # the proof of the step's own path reports it
        proof, policy = self._proof, self._proof.policy
        name = policy.contracts[link.link.skill].name
        proof.report.add(
            codes.RETURN_OUTSIDE if link.motion == MotionKind.HOME else codes.LOITER_OUTSIDE,
            step.span,
            f"the link `{name}` may fly {then.period.from_to(then.further)}, and its way from this step stays in "
            f"`{policy.zones[zone.number].name}`, which does not always exist then",
            help="issue the mission at another time, or shorten its steps",
            labels=[
                (proof.span(then.airspace.airspace), "the airspace"),
                (proof.span(link.link), "this link would fly there"),
                (zone_span(proof, zone), "declared here"),
            ],
        )

    def _report(
        self,
        step: MissionStep,
        link: PreparedLink | None,
        flown: FlownPath,
        leaves: Departure,
        to: Sequence[Point],
        then: _LinkTime,
    ) -> None:
        airspace, (place, stretch) = then.present, leaves
        proof, policy = self._proof, self._proof.policy
        home = link is None or link.motion == MotionKind.HOME
        if stretch.part == _ACROSS:
            legs = [(place, each) for each in ([_HOME, *to] if home else to or [place])]
        else:
            legs = path_legs(stretch.points)
        from_ = f"where the link `{flown.after}` ends" if flown.after and place == flown.points[-1] else "this step"
        begins = f"from {from_}, which begins {from_home(*place)},"
        labels = [(proof.span(airspace.airspace), "the airspace")]
        help = "move the step, or add steps that lead around"
        code, subject = codes.PATH_OUTSIDE, f"{stretch.part} home {begins}"
        if link is not None:
            name = policy.contracts[link.link.skill].name
            labels.append((proof.span(link.link), "this link would fly there"))
            code = codes.RETURN_OUTSIDE if home else codes.LOITER_OUTSIDE
            subject = subject if home else f"{stretch.part} of the link `{name}` {begins}"
            subject = f"`{name}`, a link of this step's chains," if place in to else subject
        labels += then.period.labels(airspace, self._space(stretch), then.further)
        if home:
            vehicle = proof.lowered.vehicle
            if self._vehicle.home_within and self._keeps(stretch._replace(points=_of_home(stretch, to)), airspace):
                labels.append((vehicle.within.span, "home may be this far from its declared place"))
            raised = self._raised(flown, to, stretch, airspace)
            if raised is not None:
                help = f"{_above(raised)}; or {help}"
                if vehicle.return_altitude is not None:
                    labels.append((vehicle.return_altitude.span, "the vehicle returns at this height"))
        if link is not None:
            help = f"on board, the next link would fly instead; {help}"
        proof.report.add(
            code,
            step.span,
            f"{subject} would {breach_text(policy, airspace, legs, stretch.low, stretch.high)}",
            help=help,
            labels=labels,
        )

    def raised(self, start: StartPlace, airspace: PreparedAirspace) -> str:
        """Return advice on a return altitude that leads the way home from a place above all obstacles; else empty."""
        flown = FlownPath(((start.x, start.y),), start.height, start.height)
        leaves = self._leaving(flown, self._homes, True, airspace, self._vehicle)
        height = None if leaves is None else self._raised(flown, self._homes, leaves.stretch, airspace)
        return "" if height is None else _above(height)

    def _raised(
        self, flown: FlownPath, to: Sequence[Point], stretch: Stretch, airspace: PreparedAirspace
    ) -> int | None:
        """Return the least return altitude, in whole metres, at which all ways home from a step stay in the airspace.

        Returns None if no altitude above the obstacles does.
        """
        vehicle = self._vehicle
        while stretch.part == _ACROSS:
            space = self._space(stretch)
            above = [zone.ceiling for zone in airspace.outside if space.inside(zone) != FALSE]
            height = -(-(max(above, default=HIGHEST) + SHORT) // _METRE) * _METRE
            if height >= HIGHEST or height <= vehicle.return_altitude:
                return None
            vehicle = replace(vehicle, return_altitude=height)
            leaves = self._leaving(flown, to, True, airspace, vehicle)
            if leaves is None:
                return height
            stretch = leaves.stretch
        return None


_ACROSS = "the straight way"


def _above(height: int) -> str:
    return (
        f"with `return at {display(height, Dimension.ALTITUDE)}` the way home leads above all zones on it; set the "
        "autopilot to the same height"
    )


def _stretches(
    points: Sequence[Point], flown: FlownPath, to: Sequence[Point], returns: VehicleLimits | None, *, near: bool
) -> list[Stretch]:
    """Return the parts of a way from places to its targets. `near` means that some places are near home."""
    if returns is None:
        return [Stretch(_ACROSS, (*points, *to), flown.low, flown.high)]
    top = max(flown.high, returns.return_altitude)
    least = across(flown.low, returns.return_altitude, near=near)
    climb = [Stretch("the climb before the way", tuple(points), flown.low, top)] if least > flown.low else []
    way = Stretch(_ACROSS, (*points, *to), least, top)
    return [*climb, way, Stretch("the descent at the end of the way", tuple(to), min(flown.low, 0), top)]


def _of_home(stretch: Stretch, to: Sequence[Point]) -> tuple[Point, ...]:
    """Return the places of a part of a way for home at its declared place."""
    return (*(each for each in stretch.points if each not in to), *([_HOME] if set(to) & set(stretch.points) else []))


def _comes_near(leg: Leg, limit: int) -> bool:
    """Whether some place of a leg is at most `limit` mm from home."""
    (ax, ay), (bx, by) = leg
    ux, uy = bx - ax, by - ay
    along, square = -ax * ux - ay * uy, ux * ux + uy * uy
    if along <= 0:
        return ax * ax + ay * ay <= limit * limit
    if along >= square:
        return bx * bx + by * by <= limit * limit
    return (ax * uy - ay * ux) ** 2 <= limit * limit * square
