"""Describes zones and the vehicle."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

from rtshcua.decision.flying import MINUTE
from rtshcua.ground.checker import time_zones
from rtshcua.ground.lower.vehicle import speeds_of
from rtshcua.ground.report.prose.phrases import (
    coordinates,
    listed,
    name,
    named,
    on_days,
    optical,
    quantity,
    time_of_day,
    whole_day,
)
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.places import (
    CameraDecl,
    Circle,
    Combination,
    Corridor,
    GeoJson,
    Polygon,
    Shape,
    VehicleDecl,
    ZoneDecl,
)
from rtshcua.model.quantity import Dimension, display


def describe_shape(shape: Shape) -> str:
    """Describe the ground plan of a zone."""
    match shape:
        case Circle():
            return f"a circle of {quantity(shape.radius)} around {coordinates(shape.center)}"
        case Polygon():
            count = len(shape.holes)
            holes = f", with {count} hole{'s' if count > 1 else ''} cut out of it" if count else ""
            return f"a polygon of {len(shape.corners)} corners{holes}"
        case Corridor():
            return f"a corridor {quantity(shape.width)} wide along {len(shape.points)} places"
        case GeoJson():
            feature = "" if shape.feature is None else f", feature {shape.feature!r}"
            return f"the outline in the file {shape.path!r}{feature}"
        case Combination():
            parts = [_part(each) for each in shape.shapes]
            if shape.operator == "union":
                return f"what lies in any of these: {'; '.join(parts)}"
            return f"what lies in {parts[0]}, but not in {' nor in '.join(parts[1:])}"
        case _:
            return f"the ground plan of {name(shape.name)}"


def _part(shape: Shape) -> str:
    """Describe a ground plan within another one, in brackets if it is a combination, to be unambiguous."""
    words = describe_shape(shape)
    return f"({words})" if isinstance(shape, Combination) else words


def places_of(shape: Shape) -> Iterator[tuple[str, Coordinates]]:
    """Yield the places in the declaration of a shape with their descriptions."""
    match shape:
        case Circle():
            yield f"centre, radius {quantity(shape.radius)}", shape.center
        case Polygon():
            for number, corner in enumerate(shape.corners, 1):
                yield f"corner {number}", corner
            for hole, ring in enumerate(shape.holes, 1):
                for number, corner in enumerate(ring, 1):
                    yield f"hole {hole}, corner {number}", corner
        case Corridor():
            for number, point in enumerate(shape.points, 1):
                yield f"corridor {quantity(shape.width)} wide, place {number}", point
        case Combination():
            for part, each in enumerate(shape.shapes, 1):
                for what, place in places_of(each):
                    yield f"part {part}: {what}", place
        case _:
            return


def describe_band(zone: ZoneDecl) -> str:
    """Describe the floor and the ceiling of a zone."""
    floor = "no floor" if zone.floor is None else f"from {quantity(zone.floor)}"
    ceiling = "no ceiling" if zone.ceiling is None else f"up to {quantity(zone.ceiling)}"
    if zone.floor is None and zone.ceiling is None:
        return "at every height"
    return f"{floor}, {ceiling}"


def describe_times(zone: ZoneDecl) -> str:
    """Describe when a zone is active."""
    parts = []
    if zone.daily is not None:
        start, end = zone.daily.start.value, zone.daily.end.value
        over = ", over midnight" if start > end else ""
        begins = f"{', beginning' if over else ''} {on_days(zone.daily.days)}" if zone.daily.days else ""
        if begins and whole_day(start, end):
            parts.append(f"{on_days(zone.daily.days)}, local time")
        else:
            every = "" if begins else "every day "
            parts.append(f"{every}from {time_of_day(start)} to {time_of_day(end)} local time{over}{begins}")
    if zone.dates is not None:
        parts.append(f"from {utc(zone.dates.start_us)} to {utc(zone.dates.end_us)}")
    return listed(parts) or "at all times"


def utc(us: int) -> str:
    """Write a UTC time without trailing zero parts: `2026-05-01 08:00 UTC`."""
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=us)
    seconds = "" if us % 60_000_000 == 0 else f"{moment:%S}"
    fraction = f".{us % 1_000_000:06d}".rstrip("0") if us % 1_000_000 else ""
    return f"{moment:%Y-%m-%d %H:%M}{':' if seconds else ''}{seconds}{fraction} UTC"


def describe_fitted(signal: str, fitted: bool) -> str:
    """Describe whether the vehicle has the sensor of a signal, and the consequence."""
    if fitted:
        return f"The vehicle reports {name(signal)}, and every clause on it applies."
    return f"The vehicle does not report {name(signal)}: its clauses `where fitted` do not apply."


def _camera(camera: CameraDecl) -> str:
    """Describe a camera."""
    sensor = f"a sensor of {optical(camera.width)} by {optical(camera.height)}"
    pixels = f"{camera.columns.value} by {camera.rows.value} pixels"
    mounted = ", mounted portrait" if camera.portrait else ""
    times = f"a picture every {quantity(camera.interval)} at the most often, exposed for at most"
    return (
        f"{name(camera.name.text)}: {sensor}, {pixels}, {optical(camera.focal)} behind the lens{mounted}; {times} "
        f"{quantity(camera.exposure)}"
    )


def describe_vehicle(vehicle: VehicleDecl) -> Iterator[tuple[str, str]]:
    """Yield the properties of a vehicle, each with its label."""
    yield "Identity", vehicle.identity
    yield "Name in the sources", name(vehicle.name.text)
    yield "Home", f"{coordinates(vehicle.home)}; the real one lies within {quantity(vehicle.within)}"
    yield "Speed", f"at most {quantity(vehicle.speed)}"
    yield "Climb", f"at most {quantity(vehicle.climb)}"
    yield "Position error", f"at most {quantity(vehicle.position_error)}; every planned path is widened by this"
    flight = "" if vehicle.flight is None else f", {quantity(vehicle.flight)} of flight at the worst"
    yield "Full charge", f"{quantity(vehicle.endurance)} of hovering{flight}"
    minute = display(-(-MINUTE * FULL // speeds_of(vehicle).flight_us), Dimension.RATIO)
    yield "Drain", f"at most {minute} of it a minute, as declared; more counts where it is measured (`battery.drain`)"
    yield "Reserve", f"{quantity(vehicle.reserve)} of a full charge must be left after landing at home"
    if vehicle.cells is not None:
        yield "Battery", f"{vehicle.cells.value} cells in series"
    if vehicle.braking is not None:
        braking = vehicle.braking
        reaction, time = (display(each.value, Dimension.DURATION) for each in (braking.reaction, braking.time))
        limits = "limits in flight count where it would come to stand"
        yield "Braking", f"from {quantity(braking.speed)} to a stand in {time}, after a delay of {reaction}; {limits}"
    if vehicle.return_altitude is not None:
        yield "Return", f"it climbs to {quantity(vehicle.return_altitude)} before it flies home, if it is lower"
    if vehicle.speeds:
        kept = ", ".join(
            f"{each.name.text} {quantity(each.speed)}" + (f" below {quantity(each.below)}" if each.below else "")
            for each in vehicle.speeds
        )
        yield "Speeds", f"at least {kept}; how long a step takes is proved by these"
    if vehicle.acceleration is not None:
        gains = vehicle.acceleration
        yield "Acceleration", f"to {quantity(gains.speed)} in {quantity(gains.time)}"
    if vehicle.wind is not None:
        yield "Wind", f"it is flown in at most {quantity(vehicle.wind)}"
    if vehicle.elevation is not None:
        within = "" if vehicle.elevation_within is None else f", true to {quantity(vehicle.elevation_within)}"
        yield "Elevation of home", f"{quantity(vehicle.elevation)}{within}"
    if vehicle.utc_offset is not None:
        offset = vehicle.utc_offset.value
        yield "Local time", f"UTC {'-' if offset < 0 else '+'}{time_of_day(abs(offset))}"
    if vehicle.time_zone is not None:
        yield "Local time", f"that of {vehicle.time_zone.text}, by the time-zone data {time_zones.VERSION}"
    yield from (("Camera", _camera(camera)) for camera in vehicle.cameras)
    if vehicle.servos:
        outputs = listed([str(servo.value) for servo in vehicle.servos])
        yield "Free servo outputs", f"{outputs}; skills may set them"
    if vehicle.without:
        signals = named([each.text for each in vehicle.without])
        yield "Not fitted", f"sensors for {signals}; clauses that count only where they are fitted are left out"
