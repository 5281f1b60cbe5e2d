"""E0514, E0515: wherever a step is broken off, the straight way home, and to where its links fly, keeps the airspace.

The way may begin at every place of the planned path and of the leg to it, not at its ends alone, and it is as wide as
the vehicle's position error. It ends at any place where home may really be. On board a link that would leave the
airspace is not flown, and the vehicle lands where it is: better than nothing, but not what the chain says.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rtshcua.decision.contracts import first_cell
from rtshcua.decision.prepare import PreparedAirspace, PreparedInvocation, PreparedLink
from rtshcua.decision.values import TRUE
from rtshcua.decision.zones import Place as Places
from rtshcua.decision.zones import Sweep
from rtshcua.diagnostics import codes
from rtshcua.ground.compiler.proofs.anytime import may_keep
from rtshcua.ground.compiler.proofs.fan import Fan, Landmarks, Point, disc
from rtshcua.ground.compiler.proofs.leaving import breach, path_legs
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

    def prove(self, step: Step, invocation: PreparedInvocation, starts: Sequence[Place]) -> None:
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
            for link in links:
                if link in self._nowhere:
                    continue
                if not self._link(step, link, flown, airspace):
                    return
                if link.motion == MotionKind.FLY:
                    flown = self._beyond(link, flown)

    def _links(self, invocation: PreparedInvocation) -> Iterator[PreparedLink]:
        """What may be flown instead of a step, or in the midst of it; holding and landing lead nowhere."""
        degrades = (rule.target for rule in invocation.candidates.degrades)
        for link in (*degrades, *invocation.chain, *self._ground.prepared.contingency):
            if link.motion in (MotionKind.HOME, MotionKind.FLY, MotionKind.CLIMB):
                yield link

    def _link(self, step: Step, link: PreparedLink, flown: Flown, airspace: PreparedAirspace) -> bool:
        """Whether a link keeps the airspace; reports the place from where it does not."""
        if link.motion == MotionKind.HOME:
            to: Sequence[Point] = self._homes
            flown = flown._replace(high=max(flown.high, self._ground.prepared.policy.vehicle.return_altitude))
        else:
            to = [self._target(link)] if link.motion == MotionKind.FLY else []
            altitude = self._altitude(link)
            flown = flown._replace(low=min(flown.low, altitude), high=max(flown.high, altitude))
            if to and not self._keeps(to, altitude, altitude, airspace):
                self._nowhere.add(link)  # said once: it is the same from everywhere
                self._report(step, link, flown._replace(low=altitude, high=altitude), to[0], to, airspace)
                return False
        place = self._leaving(flown, to, airspace)
        if place is not None:
            self._report(step, link, flown, place, to, airspace)
        return place is None

    def _leaving(self, flown: Flown, to: Sequence[Point], airspace: PreparedAirspace) -> Point | None:
        """A place of the path from where the straight way leaves the airspace; `to` is all that it may lead to, and
        empty where the link leads up and nowhere else.
        """
        key = (flown.points, flown.low, flown.high, tuple(to))
        if key in self._ground.kept:
            return None
        # nearly always all of it lies in one hull that keeps the airspace
        if not self._keeps([*flown.points, *to], flown.low, flown.high, airspace):
            for leg in path_legs(flown.points):
                if leg[0] in self._told:
                    continue
                if not self._keeps([*leg, *to], flown.low, flown.high, airspace):
                    self._told.add(leg[1])
                    return leg[1]
        self._ground.kept.add(key)
        return None

    def _keeps(self, points: Sequence[Point], low: int, high: int, airspace: PreparedAirspace) -> bool:
        """Whether the hull of some places keeps the airspace."""
        return may_keep(self._space(points, low, high), airspace) == TRUE

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

    def _report(
        self,
        step: Step,
        link: PreparedLink,
        flown: Flown,
        place: Point,
        to: Sequence[Point],
        airspace: PreparedAirspace,
    ) -> None:
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
