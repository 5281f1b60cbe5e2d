"""What a drawing shows of a site: zones, home and the way of a mission. Lengths are in mm, places in the local plane: x
east and y north of the vehicle's declared home; heights above home.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot
from typing import Final, NamedTuple

from rtshcua.decision.volume import across, cone
from rtshcua.model.flat.contract import MotionKind

_SECOND: Final = 1_000_000  # us


@dataclass(frozen=True, slots=True)
class ZoneOutline:
    """An outline in the local plane, exactly as signed: a circle with its centre and the square of its radius, or
    rings, outer ones counter-clockwise and holes clockwise.
    """

    rings: tuple[tuple[tuple[int, int], ...], ...] = ()
    centre: tuple[int, int] | None = None
    radius_squared: int = 0


@dataclass(frozen=True, slots=True)
class PlaceView:
    """A place in the declaration of a zone: its description, WGS 84, and its coordinates in the local plane."""

    what: str
    latitude: str
    longitude: str
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class ZoneView:
    """A zone. `use` is its use in the airspace: `allowed`, `forbidden` or empty; `floor` and `ceiling` are in mm above
    home, or None; `derived` means that a rule grows it from another zone, and `timed` that it does not always exist.
    """

    name: str
    note: str
    use: str
    shape: str
    band: str
    times: str
    ground: ZoneOutline
    floor: int | None
    ceiling: int | None
    places: tuple[PlaceView, ...]
    place: str
    changed: bool
    derived: bool = False
    timed: bool = False


@dataclass(frozen=True, slots=True)
class FlightMargins:
    """How far a vehicle may be from its planned way, by the limits that it declares: the error of its position; its
    greatest speed over ground, mm/s; and told to stop, it continues for at most `reaction_us` and then loses at least
    `braking` mm/s of its speed in a second (0: it declares neither).
    """

    position_error: int = 0
    speed: int = 0
    braking: int = 0
    reaction_us: int = 0

    def stopping(self, speed: int) -> int:
        """The greatest distance, mm rounded up, from the order to stop at a speed in mm/s (0: its greatest) to the
        standstill; 0 if the vehicle declares no braking. As `decision/running_conditions.py` predicts it from a fresh
        state.
        """
        if not self.braking:
            return 0
        speed = speed or self.speed
        part = 2 * self.braking * self.reaction_us + speed * _SECOND
        return -(-speed * part // (2 * self.braking * _SECOND))


@dataclass(frozen=True, slots=True)
class Site:
    """What surrounds a flight: the zones, the declared home, the radius within which the real home may lie, and the
    height to which a return climbs (0: none is declared); `policy` is the name of the policy that says so. `elevation`
    is that of home above mean sea level, None if it is not known.
    """

    policy: str
    zones: tuple[ZoneView, ...]
    home: tuple[int, int]
    home_within: int
    return_altitude: int
    elevation: int | None = None
    margins: FlightMargins = FlightMargins()


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """A step of a planned way: its number, and its path, which is empty if it stays where it is. The other members are
    those of its plan (`rtshcua.model.flat.mission.Plan`): altitude above home, speed (0: the vehicle chooses it), and
    the height of each place, if they have their own.
    """

    number: int
    path: tuple[tuple[int, int], ...]
    motion: MotionKind = MotionKind.HOLD
    altitude: int = 0
    speed: int = 0
    heights: tuple[int, ...] = ()


class SitePoint(NamedTuple):
    """A place with its height above home."""

    x: int
    y: int
    height: int


@dataclass(frozen=True, slots=True)
class PlannedWay:
    """The way of a mission, or of some of its steps, which then begins at `begin`; None: on the ground at home."""

    name: str
    steps: tuple[PlannedStep, ...]
    begin: SitePoint | None = None


class PlannedLeg(NamedTuple):
    """A straight part of a step's way. The checks take it to be anywhere between the heights `low` and `high`."""

    step: PlannedStep
    begin: SitePoint
    end: SitePoint
    low: int
    high: int


class LeftAirspace(NamedTuple):
    """The first place of a step, by its number, that is outside the airspace."""

    number: int
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class RefusedParts:
    """What a check refused of a way: the numbers of steps, and where they leave the airspace."""

    steps: frozenset[int] = frozenset()
    left: tuple[LeftAirspace, ...] = ()


NOT_REFUSED: Final = RefusedParts()


class FlownPlace(NamedTuple):
    """Where the vehicle was at a time, in us since the flight began; `ground` is the height of the ground below it,
    also above home, None if it is not known.
    """

    t_us: int
    x: int
    y: int
    height: int
    ground: int | None = None


#: the kinds of marks of a flight
EVENTS: Final = frozenset({"event", "refused"})


class FlightMark(NamedTuple):
    """Something that happened in flight, such as a decision: a time and a place, its label, and its kind: `event`, or
    `refused` for what was denied or went wrong.
    """

    t_us: int
    x: int
    y: int
    label: str
    kind: str = "event"


@dataclass(frozen=True, slots=True)
class FlownWay:
    """A flown track in parts, which gaps of the telemetry separate, marks along it, and the places of images with their
    titles, which are drawn without labels. The parts that are `later` came after the last record of the log.
    """

    parts: tuple[tuple[FlownPlace, ...], ...]
    marks: tuple[FlightMark, ...] = ()
    images: tuple[tuple[int, int, str], ...] = ()
    later: tuple[tuple[FlownPlace, ...], ...] = ()


def planned_legs(way: PlannedWay, site: Site) -> Iterator[PlannedLeg]:
    """The legs of a way, from where it begins: as `decision/volume.py` plans them.

    A step flies to the first place of its path while it changes its height, and then along the path. A return climbs
    where it is, crosses, and descends at home; at home it only descends.
    """
    at = way.begin or SitePoint(*site.home, 0)
    for step in way.steps:
        for to, low, high in _targets(step, at, site):
            yield PlannedLeg(step, at, to, low, high)
            at = to


def way_of_step(way: PlannedWay, index: int, site: Site) -> PlannedWay:
    """The way of one step, from where the steps before it are planned to end."""
    begin = way.begin or SitePoint(*site.home, 0)
    for leg in planned_legs(PlannedWay(way.name, way.steps[:index], way.begin), site):
        begin = leg.end
    return PlannedWay(way.name, way.steps[index : index + 1], begin)


def _targets(step: PlannedStep, at: SitePoint, site: Site) -> Iterator[tuple[SitePoint, int, int]]:
    """The ends of the legs of a step from a point, and the heights between which each is checked."""
    x, y, height = at
    match step.motion:
        case MotionKind.HOLD:
            return
        case MotionKind.CLIMB:
            to = SitePoint(x, y, step.altitude)
        case MotionKind.LAND:
            to = SitePoint(x, y, 0)
        case MotionKind.HOME:
            home, returns = site.home, site.return_altitude
            high = max(height, returns)
            near = hypot(x - home[0], y - home[1]) <= cone(returns) + site.home_within + site.margins.position_error
            if (x, y) != home:
                yield SitePoint(x, y, high), height, high
                yield SitePoint(*home, high), across(height, returns, near=near), high
            else:
                high = height
            yield SitePoint(*home, 0), 0, high
            return
        case _:
            for place, level in zip(step.path, step.heights or (step.altitude,) * len(step.path), strict=True):
                to = SitePoint(*place, level)
                yield to, min(height, level), max(height, level)
                height = level
            return
    yield to, min(height, to.height), max(height, to.height)
