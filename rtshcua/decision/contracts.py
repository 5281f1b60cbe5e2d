"""Values derived from a contract and its vehicle: argument cells, the longest duration, and the charge that is
needed.
"""

from rtshcua.decision.flying import MINUTE, MOST_DRAIN, SECOND, charge, drained, home_us
from rtshcua.decision.values import ABSENT, FALSE, PRESENT, TRUE, UNKNOWN, Truth, Value
from rtshcua.decision.volume import Volume
from rtshcua.model.flat.contract import PLACE, Contract, MotionKind, Parameter
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import VehicleLimits
from rtshcua.model.flat.zone import MAX_COORDINATE


def cells(contract: Contract) -> int:
    """The number of argument cells of a contract."""
    return sum(2 if parameter.kind == PLACE else 1 for parameter in contract.parameters)


def misfit(arguments: tuple[int, ...], contract: Contract) -> Parameter | None:
    """The first parameter whose argument is out of range. A place is only bounded by the range of coordinates."""
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            low, high, last = -MAX_COORDINATE, MAX_COORDINATE, parameter.cell + 1
        else:
            low, high, last = parameter.low, parameter.high, parameter.cell
        if not all(low <= argument <= high for argument in arguments[parameter.cell : last + 1]):
            return parameter
    return None


def first_cell(contract: Contract, kind: int) -> int:
    """The cell of the only parameter of a kind: the place that a skill flies to, or the zone that it covers."""
    return next(parameter.cell for parameter in contract.parameters if parameter.kind == kind)


def longest(contract: Contract, vehicle: VehicleLimits, limit_us: int = 0) -> int:
    """The longest duration in us: the link's own limit, else that of the skill's contract, else the longest of any
    flight.
    """
    return limit_us or contract.duration_us or vehicle.endurance_us


def drains(measured: Value) -> tuple[int, int]:
    """The least and the greatest drain per minute according to the signal `battery.drain`, in 1/10000; 0 where the
    signal is missing, so that the declared value counts.
    """
    low, high, gap, _ = measured
    least = 0 if gap != PRESENT else min(max(low, 0), MOST_DRAIN)
    return least, 0 if gap == ABSENT else min(max(high, 0), MOST_DRAIN)


#: the drain was not measured
UNMEASURED: Value = (0, 0, ABSENT, None)


class Energy:
    """The charge that a contract needs, in 1/10000 of a full battery: to finish, to return from the farthest planned
    place, and the vehicle's reserve.

    The return is computed with the declared battery, or with the measured `drain` per minute if that is worse.

    A skill that ends on the ground needs neither the return nor the reserve; `stays` marks those that need both.
    `asked` is the slowest speed that this step and the ones before it request, 0 if none does.
    """

    __slots__ = ("_asked", "_fixed", "_vehicle", "stays")

    def __init__(self, contract: Contract, vehicle: VehicleLimits, asked: int = 0) -> None:
        self.stays = contract.motion.kind not in (MotionKind.HOME, MotionKind.LAND)
        self._fixed = contract.energy + (vehicle.reserve if self.stays else 0)
        self._vehicle, self._asked = vehicle, asked

    def way_home(self, distance: int, heights: tuple[int, int], drain: int = 0) -> int:
        """The charge for the return from `distance` mm away, from any height between two bounds; rounded up."""
        vehicle, speeds = self._vehicle, self._vehicle.speeds
        if speeds is None:
            declared = -(-distance * SECOND * FULL // (vehicle.speed * vehicle.endurance_us))
            return max(declared, -(-distance * SECOND * drain // (vehicle.speed * MINUTE)))
        time_us = home_us(vehicle, speeds, distance, heights, self._asked)
        return max(charge(speeds, time_us), drained(time_us, drain))

    def needed(self, distance: int, heights: tuple[int, int] = (0, 0), drain: int = 0) -> int:
        """The charge that is needed when the farthest planned place is `distance` mm from home, rounded up."""
        return self._fixed + self.way_home(distance, heights, drain) if self.stays else self._fixed

    def suffices(self, battery: Value, volume: Volume, drain: Value = UNMEASURED) -> Truth:
        """Whether the battery holds the needed charge; unknown when the charge or the farthest place is. `drain` is
        the measured drain.
        """
        low, high, gap, _ = battery
        if self.stays:
            gap = max(gap, volume.place.located, volume.height[2] if self._vehicle.speeds else PRESENT)
        if gap == ABSENT:
            return UNKNOWN
        nearest, farthest = volume.farthest
        lowest, highest = volume.height[0], volume.height[1]
        slowest, fastest = drains(drain)
        most = self.needed(farthest, (lowest, highest), fastest)
        if low >= most:
            truth = TRUE
        else:
            same = nearest == farthest and lowest == highest and slowest == fastest
            least = most if same else self.needed(nearest, (highest, lowest), slowest)
            truth = FALSE if high < least else TRUE | FALSE
        return truth | UNKNOWN if gap else truth
