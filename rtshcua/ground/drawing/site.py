"""What a drawing shows of a site: zones, home and the way of a mission. Lengths are in mm, places in the local plane: x
east and y north of the vehicle's declared home; heights above home.
"""

from dataclasses import dataclass


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
    home, or None; `derived` means that a rule grows it from another zone.
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


@dataclass(frozen=True, slots=True)
class Site:
    """What surrounds a flight: the zones, the declared home, the radius within which the real home may lie, and the
    height to which a return climbs (0: none is declared); `policy` is the name of the policy that says so.
    """

    policy: str
    zones: tuple[ZoneView, ...]
    home: tuple[int, int]
    home_within: int
    return_altitude: int


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """A step of a planned way: its number, and its path, which is empty if it stays where it is."""

    number: int
    path: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class PlannedWay:
    """The way of a mission."""

    name: str
    steps: tuple[PlannedStep, ...]
