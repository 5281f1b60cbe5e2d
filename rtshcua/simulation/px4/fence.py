"""PX4's fence: what GF_* parameters and the upload make of it, and GF_ACTION when it is breached.

The action is taken once, when a breach begins; whoever then commands something else is obeyed, as recorded.
"""

from collections.abc import Callable
from math import inf

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.fence import Area, Circle, Limits
from rtshcua.simulation.fence_watch import Breach, FenceRules
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_WARN, _HOLD, _RETURN, _TERMINATE, _LAND = 1, 2, 3, 4, 5
"""GF_ACTION; 0 is nothing."""


def _limits(value: Callable[[str], float], area: Area) -> Limits | None:
    if value("GF_ACTION") == 0:
        return None
    across, high = value("GF_MAX_HOR_DIST"), value("GF_MAX_VER_DIST")
    if area == Area() and not across > 0 and not high > 0:
        return None
    if across > 0 and not area.included:  # with areas, the places allowed are those of the areas
        area = Area((Circle((0.0, 0.0), across),), area.excluded)
    return Limits(area, high if high > 0 else inf)


RULES = FenceRules(limits=_limits, name=lambda _limits, _point: "Geofence", every=False, critical=True)


def on_breach(a: Autopilot, _: Breach) -> None:
    """Does what GF_ACTION asks for. Holding is at the place where the breach was seen: it comes back to there."""
    action, vehicle = a.parameters.value("GF_ACTION"), a.vehicle
    if action == _WARN:
        a.say(mavlink.MAV_SEVERITY_WARNING, "Geofence exceeded\t")
    elif action == _RETURN:
        a.say(mavlink.MAV_SEVERITY_CRITICAL, "Failsafe activated: switching to Return\t")
        vehicle.set_mode(Mode.RETURN)
    elif action == _TERMINATE:
        a.say(mavlink.MAV_SEVERITY_EMERGENCY, "Failsafe activated: terminating\t")
        vehicle.disarm()
    elif action == _LAND:
        a.say(mavlink.MAV_SEVERITY_CRITICAL, "Failsafe activated: switching to Land\t")
        vehicle.set_mode(Mode.LAND)
    else:
        a.say(mavlink.MAV_SEVERITY_CRITICAL, "Failsafe activated: switching to Hold\t")
        vehicle.set_mode(Mode.LOITER)
        vehicle.go_to(Point(vehicle.body.north, vehicle.body.east, vehicle.body.up))


def on_mode_in_breach(_: Autopilot) -> None:
    """PX4 does not care while the fence is breached."""


def on_breach_cleared(_: Autopilot) -> None:
    """PX4 says nothing when the vehicle is inside again."""
