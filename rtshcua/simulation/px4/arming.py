"""What stands against arming PX4."""

from rtshcua.simulation.autopilot import LOW_TO_ARM, Autopilot
from rtshcua.simulation.modes import NEEDS_POSITION


def reasons(a: Autopilot) -> tuple[str, ...]:
    """Why it would not arm, the mode apart; none if it would."""
    found = []
    if a.vehicle.crashed:
        found.append("Attitude failure (roll)")
    if not a.sensors.consistent:
        found.append("system is starting up")
    if a.vehicle.mode in NEEDS_POSITION and not a.sensors.has_position:
        found.append("no valid global position")
    if a.sensors.receives and not a.sensors.has_fix:
        found.append("GPS fix too low")
    if a.battery.level <= LOW_TO_ARM:
        found.append("battery too low")
    if not a.fence.allows(a.here):
        found.append("vehicle outside geofence")
    return tuple(found)
