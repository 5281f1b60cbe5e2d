"""What a simulation is made from. Two simulations of equal configuration that hear the same say the same."""

from dataclasses import dataclass
from enum import StrEnum

from rtshcua.simulation.faults import Fault
from rtshcua.simulation.place import Home
from rtshcua.simulation.wind import Wind

HOME = Home(473_977_400, 85_455_900, 488_000)
"""Where PX4's simulations start: an airfield in Zurich."""


class Kind(StrEnum):
    """Which autopilot the vehicle behaves like."""

    PX4 = "px4"
    ARDUPILOT = "ardupilot"


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """All that can be chosen; integers in mm, mm/s, us, 1e-7 degree and 1/10000."""

    flavour: Kind = Kind.PX4
    system: int = 1
    home: Home = HOME
    battery: int = 10_000
    hover_us: int = 18 * 60 * 1_000_000
    """How long a full battery hovers."""
    cruise_mm_s: int = 5_000
    max_speed_mm_s: int = 12_000
    wind: Wind = Wind()
    seed: int = 1
    noise: bool = True
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        """Raises ValueError for what no vehicle could be."""
        if not 1 <= self.system <= 255:
            raise ValueError("system is an id from 1 to 255")
        if not 0 <= self.battery <= 10_000:
            raise ValueError("battery is from 0 to 10000, in 1/10000")
        if self.hover_us <= 0:
            raise ValueError("hover time is more than nothing")
        if not 0 < self.cruise_mm_s <= self.max_speed_mm_s <= 15_000:
            raise ValueError("cruise speed is more than 0 and at most the greatest speed, which is at most 15000 mm/s")
        if not -850_000_000 <= self.home.latitude <= 850_000_000 or abs(self.home.longitude) > 1_800_000_000:
            raise ValueError("home is between 85 degrees south and north, and 180 degrees west and east")
