"""ArduCopter's fence: what FENCE_* parameters and the upload make of it, and FENCE_ACTION when it is breached.

The action is taken once, when a breach begins; whoever changes the mode after that is obeyed for as long as the breach
lasts ("Manual recovery"), as recorded.
"""

from collections.abc import Callable
from math import inf

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.fence import Area, Circle, Limits
from rtshcua.simulation.fence_watch import Breach, FenceRules
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_CEILING, _CIRCLE, _POLYGON = 1, 2, 4
"""The bits of FENCE_TYPE; the floor (8) is not in this vehicle."""
_REPORT, _RETURN, _LAND, _BRAKE = 0, 1, 2, 4
"""FENCE_ACTION; the smart returns (3, 5) are plain ones here."""
_GIVE_UP_M = 100.0
"""So far outside, it lands instead of coming back."""
_VEL_LIMIT = 2


def _limits(value: Callable[[str], float], area: Area) -> Limits | None:
    kinds = int(value("FENCE_TYPE"))
    if value("FENCE_ENABLE") < 1:
        return None
    included = area.included if kinds & _POLYGON else ()
    excluded = area.excluded if kinds & _POLYGON else ()
    if kinds & _CIRCLE:
        included = (*included, Circle((0.0, 0.0), value("FENCE_RADIUS")))
    ceiling = value("FENCE_ALT_MAX") if kinds & _CEILING else inf
    return Limits(Area(included, excluded, every=True), ceiling)


def _name(limits: Limits, point: Point) -> str:
    if point.up > limits.ceiling:
        return "Max Alt"
    for shape in limits.area.included:
        if isinstance(shape, Circle) and shape.centre == (0.0, 0.0) and not shape.holds(point.north, point.east):
            return "Circle"
    return "Polygon"


RULES = FenceRules(limits=_limits, name=_name, every=True, critical=False)


def on_breach(a: Autopilot, breach: Breach) -> None:
    """Tells of it, and does what FENCE_ACTION asks for."""
    kind = mavlink.FENCE_BREACH_MAXALT if breach.name == "Max Alt" else mavlink.FENCE_BREACH_BOUNDARY
    count = min(a.fence.count, 65_535)
    a.send(mavlink.MAVLink_fence_status_message(1, count, kind, a.boot_ms, _VEL_LIMIT))
    a.say(mavlink.MAV_SEVERITY_NOTICE, f"{breach.name} fence breached")
    action, vehicle = a.parameters.value("FENCE_ACTION"), a.vehicle
    if action == _REPORT:
        return
    if action == _LAND or breach.by > _GIVE_UP_M:
        vehicle.set_mode(Mode.LAND)
    elif action == _BRAKE:
        vehicle.set_mode(Mode.BRAKE)
    else:
        vehicle.set_mode(Mode.RETURN)


def on_mode_in_breach(a: Autopilot) -> None:
    """A new mode while the fence is breached counts as the pilot bringing it back."""
    a.say(mavlink.MAV_SEVERITY_INFO, "Manual recovery started")


def on_breach_cleared(a: Autopilot) -> None:
    """The vehicle is inside again."""
    a.say(mavlink.MAV_SEVERITY_NOTICE, "Fence breach cleared")
