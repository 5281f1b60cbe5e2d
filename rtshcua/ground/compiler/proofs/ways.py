"""E0514, E0515: wherever a step is broken off, the straight way home, and to where its links fly, keeps the airspace.

The way may begin at every place of the planned path and of the leg to it, not at its ends alone, and it is as wide as
the vehicle's position error. It ends at any place where home may really be. On board a link that would leave the
airspace is not flown, and the vehicle lands where it is: better than nothing, but not what the chain says.
"""

from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import NamedTuple

from rtshcua.decision.contracts import first_cell, longest
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation, PreparedLink
from rtshcua.decision.values import TRUE
from rtshcua.decision.zones import Place as Places
from rtshcua.decision.zones import PreparedZone, Sweep
from rtshcua.diagnostics import codes
from rtshcua.ground.compiler.proofs.fan import Fan, Landmarks, Point, disc
from rtshcua.ground.compiler.proofs.leaving import breach, path_legs
from rtshcua.ground.compiler.proofs.period import Period, keeps, zone_span
from rtshcua.ground.compiler.proofs.places import Place, from_home, planned
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.model.flat.contract import PLACE, MotionKind
from rtshcua.model.ir.missions import Step

_HOME = (0, 0)


class Flown(NamedTuple):
    """The places from which a link may begin, in the order of the path, and their heights in mm; the last one may be
    where a link ends, `after` is that one's skill.
    """

    points: tuple[Point, ...]
    low: int
    high: int
    after: str = ""


@dataclass(frozen=True, slots=True)
class Then:
    """When a link may fly: until `further` us after the latest begin of a step. The airspace, and what of it may be
    present then.
    """

    period: Period
    further: int
    airspace: PreparedAirspace
    present: PreparedAirspace = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "present", self.period.present(self.airspace, self.further))


class Ways:
    """The ways that lead from the steps of one mission."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        error = ground.prepared.policy.vehicle.position_error
        self._box = (-error, -error, error, error)
        self._landmarks = Landmarks(ground.prepared.policy)
        self._homes = disc(ground.prepared.policy.vehicle.home_within)
        self._told: set[Point] = set()
        self._nowhere: set[PreparedLink] = set()

    def prove(self, step: Step, invocation: PreparedInvocation, period: Period, starts: Sequence[Place]) -> None:
        """Report the first way from a step that leaves the airspace; the step itself was found to keep it."""
        airspace = self._ground.prepared.airspace
        if airspace is None or invocation.invocation.plan.kind in (MotionKind.HOME, MotionKind.LAND):
            return  # it is the way home itself, or leads nowhere
        links = list(self._links(invocation))
        for start in starts:
            _, volume = planned(self._ground, invocation, start)
            path = invocation.invocation.plan.path
            points = ((start.x, start.y), *zip(path[::2], path[1::2], strict=True))
            flown = Flown(points, *volume.height[:2])
            for link, lasts in links:
                if link in self._nowhere:
                    continue
                there = Then(period, invocation.lasts_us + lasts, airspace)
                if not self._link(step, link, flown, there):
                    return
                if link.motion == MotionKind.FLY:
                    flown = self._beyond(link, flown)

    def _links(self, invocation: PreparedInvocation) -> Iterator[tuple[PreparedLink, int]]:
        """What may be flown instead of a step, or in the midst of it, and when it has ended, us after the step; holding
        and landing lead nowhere.
        """
        degrades = [[rule.target] for rule in invocation.candidates.degrades]
        before = 0  # the contingency flies when the step's own chain has failed
        for chain in (*degrades, invocation.chain, self._ground.prepared.contingency):
            lasts = before if chain is self._ground.prepared.contingency else 0
            for link in chain:
                lasts += self._lasts(link)
                if link.motion in (MotionKind.HOME, MotionKind.FLY, MotionKind.CLIMB):
                    yield link, lasts
            before = max(before, lasts)

    def _lasts(self, link: PreparedLink) -> int:
        policy = self._ground.prepared.policy
        return longest(policy.contracts[link.link.skill], policy.vehicle, link.link.limit_us)

    def _link(self, step: Step, link: PreparedLink, flown: Flown, then: Then) -> bool:
        """Whether a link keeps the airspace; reports the place from where it does not."""
        if link.motion == MotionKind.HOME:
            to: Sequence[Point] = self._homes
            flown = flown._replace(high=max(flown.high, self._ground.prepared.policy.vehicle.return_altitude))
        else:
            to = [self._target(link)] if link.motion == MotionKind.FLY else []
            altitude = self._altitude(link)
            flown = flown._replace(low=min(flown.low, altitude), high=max(flown.high, altitude))
            if to and not self._keeps(to, altitude, altitude, then.present):
                self._nowhere.add(link)  # said once: it is the same from everywhere
                self._report(step, link, flown._replace(low=altitude, high=altitude), to[0], to, then)
                return False
        place = self._leaving(flown, to, then.present, self._told)
        if place is not None:
            self._told.add(place)
            self._report(step, link, flown, place, to, then)
            return False
        missing = then.period.missing(then.airspace, then.further)
        if missing is not None:
            self._missing(step, link, missing, then)
            return False
        for zone in then.period.avoidable(then.airspace, then.further):
            alone = then.airspace._replace(inside=(), outside=(zone,))
            if self._leaving(flown, to, alone) is not None:
                then.period.avoid(zone, then.further)
        for zone in then.airspace.inside:
            then.period.stay(zone, then.further)
        return True

    def _leaving(
        self, flown: Flown, to: Sequence[Point], airspace: PreparedAirspace, told: AbstractSet[Point] = frozenset()
    ) -> Point | None:
        """A place of the path from where the straight way leaves the airspace, but not of a leg from one that was
        `told`; `to` is all that it may lead to, and empty where the link leads up and nowhere else.
        """
        zones = tuple(tuple(zone.number for zone in each) for each in (airspace.inside, airspace.outside))
        key = (flown.points, flown.low, flown.high, tuple(to), zones)
        if key in self._ground.kept:
            return None
        # nearly always all of it lies in one hull that keeps the airspace
        if not self._keeps([*flown.points, *to], flown.low, flown.high, airspace):
            for leg in path_legs(flown.points):
                if leg[0] not in told and not self._keeps([*leg, *to], flown.low, flown.high, airspace):
                    return leg[1]
        self._ground.kept.add(key)
        return None

    def _keeps(self, points: Sequence[Point], low: int, high: int, airspace: PreparedAirspace) -> bool:
        """Whether the hull of some places keeps the airspace."""
        return keeps(self._space(points, low, high), airspace) == TRUE

    def _space(self, points: Sequence[Point], low: int, high: int) -> Places:
        sweep: Sweep = Fan(points, self._box, self._landmarks)
        return Places(((sweep, low, high),), 0)

    def _beyond(self, link: PreparedLink, flown: Flown) -> Flown:
        """Where later links may begin: the place that this one flies to too."""
        altitude = self._altitude(link)
        name = self._ground.prepared.policy.contracts[link.link.skill].name
        low, high = min(flown.low, altitude), max(flown.high, altitude)
        return Flown((*flown.points, self._target(link)), low, high, name)

    def _altitude(self, link: PreparedLink) -> int:
        return link.link.arguments[self._ground.prepared.policy.contracts[link.link.skill].motion.altitude]

    def _target(self, link: PreparedLink) -> Point:
        cell = first_cell(self._ground.prepared.policy.contracts[link.link.skill], PLACE)
        x, y = link.link.arguments[cell : cell + 2]
        return x, y

    def _missing(self, step: Step, link: PreparedLink, zone: PreparedZone, then: Then) -> None:
        ground, policy = self._ground, self._ground.prepared.policy
        name = policy.contracts[link.link.skill].name
        ground.context.report.add(
            codes.RETURN_OUTSIDE if link.motion == MotionKind.HOME else codes.LOITER_OUTSIDE,
            step.span,
            f"the way of the link `{name}` from this step would be in `{policy.zones[zone.number].name}`, which does "
            f"not exist at all times {then.period.from_to(then.further)}: it may be flown then",
            help="issue the mission at another time, or let its steps take less",
            labels=[
                (ground.span(then.airspace.airspace), "the airspace"),
                (ground.span(link.link), "this link would fly there"),
                (zone_span(ground, zone), "declared here"),
            ],
        )

    def _report(
        self,
        step: Step,
        link: PreparedLink,
        flown: Flown,
        place: Point,
        to: Sequence[Point],
        then: Then,
    ) -> None:
        airspace = then.present
        ground, policy = self._ground, self._ground.prepared.policy
        name = policy.contracts[link.link.skill].name
        home = link.motion == MotionKind.HOME
        legs = [(place, each) for each in ([_HOME, *to] if home else to or [place])]
        sure = home and not self._keeps([place, _HOME], flown.low, flown.high, airspace)
        words = "home" if home else f"of the link `{name}`"
        from_ = "this step"
        if flown.after and place == flown.points[-1]:
            from_ = f"where the link `{flown.after}` ends"
        subject = f"the straight way {words} from {from_}, which begins {from_home(*place)},"
        if place in to:
            subject = f"`{name}`, a link of this step's chains,"
        labels = [
            (ground.span(airspace.airspace), "the airspace"),
            (ground.span(link.link), "this link would fly there"),
        ]
        labels += then.period.labels(airspace, self._space([place, *to], flown.low, flown.high), then.further)
        if home and not sure and policy.vehicle.home_within:
            labels.append((ground.lowered.vehicle.within.span, "home may lie so far from where it is declared"))
        ground.context.report.add(
            codes.RETURN_OUTSIDE if home else codes.LOITER_OUTSIDE,
            step.span,
            f"{subject} would {breach(policy, airspace, legs, flown.low, flown.high)}",
            help="on board the link would not be flown then, but the one after it; move the step, or lead the mission "
            "around by further steps",
            labels=labels,
        )
