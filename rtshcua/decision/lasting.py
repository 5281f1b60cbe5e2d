"""How long something may fly at most."""

from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Vehicle


def longest(contract: Contract, vehicle: Vehicle, limit_us: int = 0) -> int:
    """A link's own limit, else what its skill's contract allows, else as long as anything can fly, in us."""
    return limit_us or contract.duration_us or vehicle.endurance_us
