"""Check the fields of vehicles."""

from rtshcua.decision.checks.policy import MAX_POSITION_ERROR, MAX_REACTION
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker import time_zones
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.fields import elevation, on_globe, quantity
from rtshcua.ground.checker.lookup import find_signal
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.well_known import WELL_KNOWN, read_by_all
from rtshcua.model.flat.limits import FULL, MAX_SPEED
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import Acceleration, Braking, VehicleDecl
from rtshcua.model.quantity import Dimension, display

MAX_OFFSET_US = 14 * 3_600_000_000  # local times are at most 14 h from UTC


def check_vehicles(context: CheckContext) -> None:
    """Report every field of a vehicle with a wrong dimension or value."""
    for vehicle in context.symbols.vehicles.values():
        on_globe(context, vehicle.home)
        quantity(context, vehicle.within, Dimension.LENGTH)
        quantity(context, vehicle.speed, Dimension.SPEED)
        quantity(context, vehicle.climb, Dimension.SPEED)
        quantity(context, vehicle.position_error, Dimension.LENGTH, positive=False, most=MAX_POSITION_ERROR)
        quantity(context, vehicle.endurance, Dimension.DURATION)
        quantity(context, vehicle.reserve, Dimension.RATIO, positive=False)
        if vehicle.reserve.dimension is Dimension.RATIO and vehicle.reserve.value >= FULL:
            context.report.add(
                codes.NUMBER_SIZE,
                vehicle.reserve.span,
                "the reserve must be below 100 %",
            )
        elevation(context, vehicle.elevation)
        quantity(context, vehicle.elevation_within, Dimension.LENGTH, positive=False)
        quantity(context, vehicle.return_altitude, Dimension.ALTITUDE, positive=False)
        if vehicle.braking is not None:
            _braking(context, vehicle.braking)
        _speeds(context, vehicle)
        _without(context, vehicle)
        offset = vehicle.utc_offset
        if offset is not None and abs(offset.value) > MAX_OFFSET_US:
            context.report.add(codes.NUMBER_SIZE, offset.span, "the offset from UTC must be at most 14 h")
        if vehicle.time_zone is not None:
            _time_zone(context, vehicle.time_zone)


def _time_zone(context: CheckContext, name: Name) -> None:
    known = time_zones.names()
    if name.text not in known:
        context.report.add(
            codes.UNKNOWN_TIME_ZONE,
            name.span,
            f"unknown time zone `{name.text}`",
            help=suggestion(name.text, known) or 'write an IANA name, as in `clock "Europe/Berlin"`',
        )


def _without(context: CheckContext, vehicle: VehicleDecl) -> None:
    """Check `without`: known signals, each named once, none of them required."""
    needed = read_by_all(vehicle)
    first: dict[str, Span] = {}
    for name in vehicle.without:
        if name.text in first:
            context.report.add(
                codes.WRITTEN_TWICE,
                name.span,
                f"`{name.text}` is repeated in `without` of `{vehicle.name.text}`",
                help="keep one of them",
                labels=[(first[name.text], "first written here")],
            )
        first.setdefault(name.text, name.span)
        if name.text in needed:
            why = "every decision reads it" if name.text in WELL_KNOWN else "`brakes` requires it"
            context.report.add(
                codes.NEEDED_SIGNAL,
                name.span,
                f"the signal `{name.text}` cannot be in `without`: {why}",
                help="remove it from `without`" + ("" if name.text in WELL_KNOWN else ", or remove `brakes`"),
            )
        else:
            find_signal(context, name)


#: the speeds in `speeds`
SPEEDS = ("cruise", "climb", "descent", "landing", "return", "air")


def _speeds(context: CheckContext, vehicle: VehicleDecl) -> None:
    """Check the speeds: known, each written once, below the maximum, and above the wind."""
    quantity(context, vehicle.flight, Dimension.DURATION)
    quantity(context, vehicle.wind, Dimension.SPEED, positive=False)
    gains = vehicle.acceleration
    if gains is not None:
        before = len(context.report.found)
        quantity(context, gains.speed, Dimension.SPEED)
        quantity(context, gains.time, Dimension.DURATION)
        if len(context.report.found) == before and not 1 <= gained(gains) <= MAX_SPEED:
            context.report.add(
                codes.NUMBER_SIZE, gains.span, "the acceleration per second must be from 1 mm/s to 1000 m/s"
            )
    first: dict[str, Span] = {}
    for each in vehicle.speeds:
        name = each.name.text
        quantity(context, each.speed, Dimension.SPEED)
        quantity(context, each.below, Dimension.ALTITUDE, positive=False)
        if name in first:
            context.report.add(
                codes.WRITTEN_TWICE,
                each.name.span,
                f"`{name}` is repeated in `speeds` of `{vehicle.name.text}`",
                help="keep one of them",
                labels=[(first[name], "first written here")],
            )
        elif name not in SPEEDS:
            context.report.add(
                codes.UNKNOWN_NAME,
                each.name.span,
                f"unknown speed `{name}`",
                help=suggestion(name, SPEEDS) or f"the speeds are {listed(SPEEDS)}",
                fix=correction(context.report, each.name.span, name, SPEEDS),
            )
        if each.below is not None and name != "landing":
            context.report.add(
                codes.SYNTAX, each.below.span, f"only the speed `landing` can have a height, not `{name}`"
            )
        first.setdefault(name, each.name.span)
        most = {"cruise": vehicle.speed, "return": vehicle.speed, "climb": vehicle.climb}.get(name)
        if most is not None and each.speed.dimension is most.dimension and each.speed.value > most.value:
            context.report.add(
                codes.NUMBER_SIZE,
                each.speed.span,
                f"`{name}` exceeds the maximum of the vehicle, {display(most.value, Dimension.SPEED)}",
                labels=[(most.span, "declared here")],
            )
    _against_wind(context, vehicle)


def _against_wind(context: CheckContext, vehicle: VehicleDecl) -> None:
    wind = vehicle.wind
    air = next((each.speed for each in vehicle.speeds if each.name.text == "air"), vehicle.speed)
    if wind is not None and wind.dimension is air.dimension is Dimension.SPEED and wind.value >= air.value > 0:
        context.report.add(
            codes.NUMBER_SIZE,
            wind.span,
            f"the wind is not below the airspeed of the vehicle, {display(air.value, Dimension.SPEED)}",
            help="declare the airspeed, as in `speeds air 16 m/s`, or reduce the wind",
            labels=[(air.span, "declared here")],
        )


def gained(gains: Acceleration) -> int:
    """Return the acceleration in mm/s per second, rounded down; 0 if the time is not positive."""
    return gains.speed.value * 1_000_000 // gains.time.value if gains.time.value > 0 else 0


def deceleration(braking: Braking) -> int:
    """Return the deceleration in mm/s per second, rounded down; 0 if the time is not positive."""
    return braking.speed.value * 1_000_000 // braking.time.value if braking.time.value > 0 else 0


def _braking(context: CheckContext, braking: Braking) -> None:
    before = len(context.report.found)
    quantity(context, braking.speed, Dimension.SPEED)
    quantity(context, braking.time, Dimension.DURATION)
    quantity(context, braking.reaction, Dimension.DURATION, positive=False, most=MAX_REACTION)
    if len(context.report.found) == before and not 1 <= deceleration(braking) <= MAX_SPEED:
        context.report.add(
            codes.NUMBER_SIZE,
            braking.span,
            "the deceleration per second must be from 1 mm/s to 1000 m/s",
        )
