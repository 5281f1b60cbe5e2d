"""The features of a file with zones, and the zones that they become: heights by datum, times, and what a zone is for.

A height above ground is none above sea until somebody says how high the ground is. With the stated lowest and highest
terrain it becomes a height above sea on the safe side: a zone to stay outside of is never smaller than the feature,
one to stay inside of never larger. Hours in UTC are hours of the vehicle's clock only if the clock has a fixed offset.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final, NamedTuple

from rtshcua.ground.exchange.losses import Loss, NotKept
from rtshcua.ground.exchange.zone_source import SourceNames, SourceZone, metres
from rtshcua.model.flat.limits import DAY

GROUND, SEA, ELLIPSOID, PRESSURE = "AGL", "AMSL", "WGS84", "STD"
#: what a zone is for
OUTSIDE, INSIDE, NO_USE = "outside", "inside", ""
DAYS: Final = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
#: a limit that is higher than this is no limit, mm
_UNLIMITED_MM: Final = 30_000_000
_TERRAIN_HELP: Final = "state the lowest and the highest ground of the site: `--terrain LOW..HIGH` in m above sea"
_CLOCK_HELP: Final = "state the fixed offset of the vehicle's clock from UTC, as in `--clock +02:00`"
#: the beginning and the end of a period that has none
_ALWAYS_BEGUN, _NEVER_ENDS = "1970-01-01T00:00:00Z", "2100-01-01T00:00:00Z"
_MINUTES: Final = DAY // 60_000_000


class UnkeptFeature(Exception):
    """Why a feature is not kept, and a help."""

    def __init__(self, text: str, help: str = "") -> None:
        super().__init__(text)
        self.why = text, help


class Limit(NamedTuple):
    """A height in mm over a datum."""

    mm: int
    datum: str


class Hours(NamedTuple):
    """Hours of some days, in minutes from the beginning of the day in UTC; `days` are numbers from monday, 0. A time
    with an offset from UTC may be on the day before or after. Equal times are a whole day.
    """

    days: tuple[int, ...]
    begin: int
    end: int


class Period(NamedTuple):
    """When a zone exists: from and until a moment (RFC 3339, UTC; empty: not bounded), and in which hours; None:
    always.
    """

    begin: str = ""
    end: str = ""
    hours: Hours | None = None


@dataclass(slots=True)
class ZoneFeature:
    """A feature: its name and place in the file, its shape as source text, its limits (None: none), its periods (none:
    always), what it is for, and texts for comments. `refused` says why it is not kept, with a help.
    """

    name: str
    place: str
    shape: str = ""
    floor: Limit | None = None
    ceiling: Limit | None = None
    periods: tuple[Period, ...] = ()
    use: str = OUTSIDE
    comments: tuple[str, ...] = ()
    rules: tuple[str, ...] = ()
    losses: list[Loss] = field(default_factory=list)
    refused: tuple[str, str] | None = None


class ZoneTerms(NamedTuple):
    """What a person states about the site: the lowest and the highest ground in mm above sea, the offset of the
    vehicle's clock in minutes, and the width of lines in mm; None where nothing is stated.
    """

    terrain: tuple[int, int] | None = None
    clock: int | None = None
    width: int | None = None


class WrittenZones(NamedTuple):
    """The zones, the rules for a policy that they suggest, the losses, and what is not kept."""

    zones: tuple[SourceZone, ...]
    rules: tuple[str, ...]
    losses: tuple[Loss, ...]
    not_kept: tuple[NotKept, ...]


def write_zones(features: Sequence[ZoneFeature], terms: ZoneTerms, names: SourceNames) -> WrittenZones:
    """The zones of features."""
    zones: list[SourceZone] = []
    losses: list[Loss] = []
    not_kept: list[NotKept] = []
    used: dict[str, list[str]] = {INSIDE: [], OUTSIDE: []}
    rules: list[str] = []
    for feature in features:
        try:
            own = list(_zones_of(feature, terms, names))
        except UnkeptFeature as error:
            not_kept.append(NotKept(feature.name, feature.place, *error.why))
            continue
        losses += feature.losses
        zones += own
        if feature.use:
            used[feature.use] += [each.name for each in own]
        rules += [rule.replace("ZONE", each.name) for rule in feature.rules for each in own]
    airspace = _airspace(used[INSIDE], used[OUTSIDE])
    return WrittenZones(tuple(zones), (*airspace, *rules), tuple(losses), tuple(not_kept))


def _airspace(inside: Sequence[str], outside: Sequence[str]) -> Iterator[str]:
    """The item of a policy. It is inside of one zone: of several, a vehicle would have to be inside of all."""
    parts = [f"inside {inside[0]}"] if inside else []
    parts += [f"outside {', '.join(outside)}"] if outside else []
    if parts:
        yield f"airspace {' '.join(parts)}" + (f"  // or inside {', '.join(inside[1:])}" if inside[1:] else "")


def _zones_of(feature: ZoneFeature, terms: ZoneTerms, names: SourceNames) -> Iterator[SourceZone]:
    """The zones of a feature: one for each of its periods."""
    if feature.refused is not None:
        raise UnkeptFeature(*feature.refused)
    if len(feature.periods) > 1 and feature.use == INSIDE:
        raise UnkeptFeature("it has several periods, and the vehicle has to be inside of it")
    heights = tuple(_heights(feature, terms))
    times = [tuple(_active(period, terms)) for period in feature.periods] or [()]
    for number, active in enumerate(times, start=1):
        told = (feature.name,) if number == 1 else (f"{feature.name}, period {number}",)
        yield SourceZone(names.of(feature.name, "zone"), (*told, *feature.comments), feature.shape, (*heights, *active))


def _heights(feature: ZoneFeature, terms: ZoneTerms) -> Iterator[str]:
    """The floor and the ceiling, above sea."""
    grows = feature.use != INSIDE
    floor, ceiling = feature.floor, feature.ceiling
    low = high = None
    if floor is not None and not (floor.datum == GROUND and floor.mm <= 0):
        low = _above_sea(feature, floor, terms, higher=not grows)
        yield f"floor {metres(low)} above sea"
    if ceiling is not None and ceiling.mm < _UNLIMITED_MM:
        high = _above_sea(feature, ceiling, terms, higher=grows)
        yield f"ceiling {metres(high)} above sea"
    if low is not None and high is not None and low >= high:
        raise UnkeptFeature("its lower limit is not below its upper limit")


def _above_sea(feature: ZoneFeature, limit: Limit, terms: ZoneTerms, *, higher: bool) -> int:
    if limit.datum == SEA:
        return limit.mm
    if limit.datum == PRESSURE:
        raise UnkeptFeature("its height is a flight level, which is no height above sea")
    if limit.datum != GROUND:
        raise UnkeptFeature(f"its height is above {limit.datum}", "convert it to a height above sea")
    if terms.terrain is None:
        raise UnkeptFeature("its height is above ground, and the ground is not known", _TERRAIN_HELP)
    made = limit.mm + terms.terrain[higher]
    feature.losses.append(Loss("widened", feature.place, f"{metres(limit.mm)} above ground: {metres(made)} above sea"))
    return made


def _active(period: Period, terms: ZoneTerms) -> Iterator[str]:
    """The items of a zone that exists in a period."""
    if period.begin or period.end:
        yield f'active "{period.begin or _ALWAYS_BEGUN}" .. "{period.end or _NEVER_ENDS}"'
    if period.hours is None:
        return
    if terms.clock is None:
        raise UnkeptFeature("its hours are in UTC, and the vehicle's clock is not known", _CLOCK_HELP)
    days, begin, end = period.hours
    later = (begin + terms.clock) // _MINUTES
    moved = sorted({(day + later) % 7 for day in days})
    on = ", ".join(DAYS[day] for day in moved)
    window = f"{_time(begin + terms.clock)} .. {_time(end + terms.clock)}"
    if (end - begin) % _MINUTES == 0:
        if (begin + terms.clock) % _MINUTES:
            raise UnkeptFeature("its days begin at another hour than those of the vehicle's clock")
        if len(moved) < len(DAYS):
            yield f"active on {on}"
    else:
        yield f"active {window}" if len(moved) == len(DAYS) else f"active {window} on {on}"


def moment_text(written: object, *, up: bool) -> str:
    """A moment of a file in UTC as in sources, to the second; rounded up at the end of a period. Empty if there is
    none.
    """
    if written in (None, ""):
        return ""
    try:
        moment = datetime.fromisoformat(written if isinstance(written, str) else "")
        if moment.tzinfo is None:
            raise UnkeptFeature("a moment does not say its offset from UTC")
        moment = moment.astimezone(UTC)
        if up and moment.microsecond:
            moment += timedelta(seconds=1)
    except (ValueError, OverflowError):
        raise UnkeptFeature("a moment is not one of RFC 3339") from None
    return f"{moment:%Y-%m-%dT%H:%M:%S}Z"


def period_of(begin: object, end: object, hours: Hours | None = None) -> Period:
    """A period from its moments in a file. Raises `UnkeptFeature`."""
    first, last = moment_text(begin, up=False), moment_text(end, up=True)
    if first and last and first >= last:
        raise UnkeptFeature("a period ends before it begins")
    return Period(first, last, hours)


def _time(minutes: int) -> str:
    hour, minute = divmod(minutes % _MINUTES, 60)
    return f"{hour:02}:{minute:02}"
