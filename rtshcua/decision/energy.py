"""The charge that an invocation needs, against the charge that there is. In 1/10000 of a full battery."""

from rtshcua.decision.truth import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.decision.values import ABSENT, Value
from rtshcua.decision.volume import Volume
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Vehicle

SECOND = 1_000_000  # us


class Energy:
    """What one contract needs: to finish, to come home from the farthest planned place, and the vehicle's reserve.

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
        if self.stays and volume.height[2] > gap:
            gap = volume.height[2]
        if gap == ABSENT:
            return UNKNOWN
        nearest, farthest = volume.farthest
        most = self.needed(farthest)
        if low >= most:
            truth = TRUE
        else:
            truth = FALSE if high < (most if nearest == farthest else self.needed(nearest)) else TRUE | FALSE
        return truth | UNKNOWN if gap else truth
