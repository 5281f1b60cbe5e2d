"""What follows from a contract and its vehicle alone: its argument cells, how long it may fly, and the charge that it
needs.
"""

from rtshcua.decision.values import ABSENT, FALSE, TRUE, UNKNOWN, Truth, Value
from rtshcua.decision.volume import Volume
from rtshcua.model.flat.contract import PLACE, Contract, MotionKind, Parameter
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Vehicle
from rtshcua.model.flat.zone import MAX_COORDINATE


def cells(contract: Contract) -> int:
    """How many argument cells a contract has."""
    return sum(2 if parameter.kind == PLACE else 1 for parameter in contract.parameters)


def misfit(arguments: tuple[int, ...], contract: Contract) -> Parameter | None:
    """The first parameter whose argument is out of its range; a place has no range but that of all coordinates."""
    for parameter in contract.parameters:
        if parameter.kind == PLACE:
            low, high, last = -MAX_COORDINATE, MAX_COORDINATE, parameter.cell + 1
        else:
            low, high, last = parameter.low, parameter.high, parameter.cell
        if not all(low <= argument <= high for argument in arguments[parameter.cell : last + 1]):
            return parameter
    return None


def first_cell(contract: Contract, kind: int) -> int:
    """The cell of the first parameter of a kind, of which there is one: that is what a skill flies to, or covers."""
    return next(parameter.cell for parameter in contract.parameters if parameter.kind == kind)


def longest(contract: Contract, vehicle: Vehicle, limit_us: int = 0) -> int:
    """A link's own limit, else what its skill's contract allows, else as long as anything can fly, in us."""
    return limit_us or contract.duration_us or vehicle.endurance_us


SECOND = 1_000_000  # us


class Energy:
    """What one contract needs of the charge, in 1/10000 of a full battery: to finish, to come home from the farthest
    planned place, and the vehicle's reserve.

    A skill that ends on the ground needs no way home, and it is what the reserve is kept for; the others are those that
    `stays` is true of.
    """

    __slots__ = ("_fixed", "_range", "stays")

    def __init__(self, contract: Contract, vehicle: Vehicle) -> None:
        self.stays = contract.motion.kind not in (MotionKind.HOME, MotionKind.LAND)
        self._fixed = contract.energy + (vehicle.reserve if self.stays else 0)
        self._range = vehicle.speed * vehicle.endurance_us  # mm that a full charge flies, times SECOND

    def needed(self, distance: int) -> int:
        """The charge needed when the farthest planned place is `distance` mm from home, rounded up."""
        return self._fixed - (-distance * SECOND * FULL // self._range) if self.stays else self._fixed

    def suffices(self, battery: Value, volume: Volume) -> Truth:
        """Whether the battery holds what is needed; unknown when the charge is, or the place that counts."""
        low, high, gap, _ = battery
        if self.stays and volume.place.located > gap:
            gap = volume.place.located
        if gap == ABSENT:
            return UNKNOWN
        nearest, farthest = volume.farthest
        most = self.needed(farthest)
        if low >= most:
            truth = TRUE
        else:
            truth = FALSE if high < (most if nearest == farthest else self.needed(nearest)) else TRUE | FALSE
        return truth | UNKNOWN if gap else truth
