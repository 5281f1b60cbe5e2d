"""E0514, E0515: wherever a step is broken off, the straight way home, and to where its links fly, keeps the airspace.

The way may begin at every place of the planned path and of the leg to it, not at its ends alone, and it is as wide as
the vehicle's position error. It ends at any place where home may really be, unless the airspace is so small that it
does not hold these. On board a link that would leave the airspace is not flown, and the vehicle lands where it is:
better than nothing, but not what the chain says.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from rtshcua.decision.link import PreparedLink
from rtshcua.decision.parameters import first_cell
from rtshcua.decision.places import Place as Places
from rtshcua.decision.places import Sweep
from rtshcua.decision.prepared import PreparedAirspace, PreparedInvocation
from rtshcua.decision.truth import TRUE
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.ground.compiler.proofs.anytime import may_keep
from rtshcua.ground.compiler.proofs.fan import Fan, Landmarks, Point, disc
from rtshcua.ground.compiler.proofs.places import Place, from_home, planned
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.model.flat.contract import PLACE, MotionKind
from rtshcua.model.ir.missions import Step

_HOME = (0, 0)


class Flown(NamedTuple):
    """The places from which a link may begin, in the order of the path, and their heights in mm."""

    points: tuple[Point, ...]
    low: int
    high: int


class Ways:
    """The ways that lead from the steps of one mission."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        error = ground.prepared.policy.vehicle.position_error
        self._box = (-error, -error, error, error)
        self._landmarks = Landmarks(ground.prepared.policy)
        self._homes = disc(ground.prepared.policy.vehicle.home_within)
        self._homes_kept: dict[int, bool] = {}
        self._told: set[Point] = set()

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
            place = self._leaving(flown, None, airspace)
            return place is None or self._report(codes.RETURN_OUTSIDE, step, link, place, airspace)
        altitude = self._altitude(link)
        risen = Flown(flown.points, min(flown.low, altitude), max(flown.high, altitude))
        place = self._leaving(risen, self._target(link) if link.motion == MotionKind.FLY else (), airspace)
        return place is None or self._report(codes.LOITER_OUTSIDE, step, link, place, airspace)

    def _leaving(self, flown: Flown, target: Point | tuple[()] | None, airspace: PreparedAirspace) -> Point | None:
        """A place of the path from where the straight way leaves the airspace; `target` is None for home, and empty
        where the link leads up and nowhere else.
        """
        key = (flown, target)
        if key in self._ground.kept:
            return None
        to = self._home(flown.high, airspace) if target is None else [target] if target else []
        # nearly always all of it lies in one hull that keeps the airspace
        if may_keep(self._space([*flown.points, *to], flown.low, flown.high), airspace) != TRUE:
            for leg in list(pairwise(flown.points)) or [(flown.points[0], flown.points[0])]:
                if leg[0] in self._told:
                    continue
                if may_keep(self._space([*leg, *to], flown.low, flown.high), airspace) != TRUE:
                    self._told.add(leg[1])
                    return leg[1]
        self._ground.kept.add(key)
        return None

    def _home(self, high: int, airspace: PreparedAirspace) -> Sequence[Point]:
        """Where the vehicle may come down at home."""
        kept = self._homes_kept.get(high)
        if kept is None:
            kept = self._homes_kept[high] = may_keep(self._space(self._homes, 0, high), airspace) == TRUE
        return self._homes if kept else [_HOME]

    def _space(self, points: Sequence[Point], low: int, high: int) -> Places:
        sweep: Sweep = Fan(points, self._box, self._landmarks)
        return Places(((sweep, low, high),), 0)

    def _beyond(self, link: PreparedLink, flown: Flown) -> Flown:
        """Where later links may begin: the place that this one flies to too."""
        altitude = self._altitude(link)
        return Flown((*flown.points, self._target(link)), min(flown.low, altitude), max(flown.high, altitude))

    def _altitude(self, link: PreparedLink) -> int:
        return link.link.arguments[self._ground.prepared.policy.contracts[link.link.skill].motion.altitude]

    def _target(self, link: PreparedLink) -> Point:
        cell = first_cell(self._ground.prepared.policy.contracts[link.link.skill], PLACE)
        x, y = link.link.arguments[cell : cell + 2]
        return x, y

    def _report(self, code: Code, step: Step, link: PreparedLink, place: Point, airspace: PreparedAirspace) -> bool:
        ground = self._ground
        name = ground.prepared.policy.contracts[link.link.skill].name
        words = "home" if link.motion == MotionKind.HOME else f"of the link `{name}`"
        ground.context.report.add(
            code,
            step.span,
            f"the straight way {words} from this step, which begins {from_home(*place)}, would leave the airspace",
            help="on board the link would not be flown then, but the one after it; move the step, or lead the mission "
            "around by further steps",
            labels=[
                (ground.span(airspace.airspace), "the airspace"),
                (ground.span(link.link), "this link would fly there"),
            ],
        )
        return False
