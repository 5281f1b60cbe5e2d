"""What is known of the vehicle besides its signals."""

from dataclasses import dataclass


@dataclass(slots=True)
class Craft:
    """Whether it is ready, armed and in the air (None: it has not said), ever flew, and since when its link is lost."""

    ready: bool = False
    armed: bool | None = None
    airborne: bool | None = None
    flown: bool = False
    lost_since_us: int | None = None

    @property
    def at_rest(self) -> bool:
        """On the ground and disarmed, as it said itself."""
        return self.armed is False and self.airborne is False
