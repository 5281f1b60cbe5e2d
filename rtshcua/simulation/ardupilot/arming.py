"""What stands against arming ArduCopter. A mode that does without a position can be armed in without one."""

from rtshcua.simulation.autopilot import LOW_TO_ARM, Autopilot
from rtshcua.simulation.modes import NEEDS_POSITION


def reasons(a: Autopilot) -> tuple[str, ...]:
    """Why it would not arm, the mode apart; none if it would."""
    found = []
    if a.vehicle.crashed:
        found.append("Leaning")
    if not a.sensors.consistent:
        found.append("Accels inconsistent")
    elif a.vehicle.mode in NEEDS_POSITION:
        if not a.sensors.has_fix:
            found.append("GPS 1: Bad fix")
        elif not a.sensors.has_position:
            found.append("Need Position Estimate")
    if a.failsafes.low_voltage:
        found += ["Battery 1 low voltage failsafe", "Battery failsafe"]
    if a.battery.level <= LOW_TO_ARM:
        found.append("Battery 1 below minimum arming capacity")
    if not a.fence.allows(a.here):
        found.append("Vehicle breaching fence")
    return tuple(found)
