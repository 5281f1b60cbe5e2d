"""E0310, E0319, E0502, E1003: what a vehicle declares of itself."""

from rtshcua.decision.checks.vehicle import MAX_POSITION_ERROR, MAX_REACTION
from rtshcua.diagnostics import codes
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.fields import elevation, on_globe, quantity
from rtshcua.model.flat.limits import FULL, MAX_SPEED
from rtshcua.model.ir.places import Braking
from rtshcua.model.quantity import Dimension

MAX_OFFSET_US = 14 * 3_600_000_000  # local times are at most 14 h from UTC


def check(context: Context) -> None:
    """Report every field of a vehicle that is of the wrong dimension or size."""
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
                "the reserve leaves nothing to fly with: it must be below 100 %",
            )
        elevation(context, vehicle.elevation)
        quantity(context, vehicle.elevation_within, Dimension.LENGTH, positive=False)
        quantity(context, vehicle.return_altitude, Dimension.ALTITUDE, positive=False)
        if vehicle.braking is not None:
            _braking(context, vehicle.braking)
        offset = vehicle.utc_offset
        if offset is not None and abs(offset.value) > MAX_OFFSET_US:
            context.report.add(codes.NUMBER_SIZE, offset.span, "local times are at most 14 h before or after UTC")


def deceleration(braking: Braking) -> int:
    """What it loses of its speed, in mm/s in a second, rounded down; 0 where that is nothing."""
    return braking.speed.value * 1_000_000 // braking.time.value if braking.time.value > 0 else 0


def _braking(context: Context, braking: Braking) -> None:
    before = len(context.report.found)
    quantity(context, braking.speed, Dimension.SPEED)
    quantity(context, braking.time, Dimension.DURATION)
    quantity(context, braking.reaction, Dimension.DURATION, positive=False, most=MAX_REACTION)
    if len(context.report.found) == before and not 1 <= deceleration(braking) <= MAX_SPEED:
        context.report.add(
            codes.NUMBER_SIZE,
            braking.span,
            "what it loses of its speed in a second must be from 1 mm/s to 1000 m/s",
        )
