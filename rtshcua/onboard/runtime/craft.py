"""What is known of the vehicle besides its signals."""

from dataclasses import dataclass


@dataclass(slots=True)
class Craft:
    """Whether it is ready, armed and in the air (None: it has not said), and whether it ever flew.

    `others`: how it flew when it was ready, if nothing of ours makes it fly so.
    """

    ready: bool = False
    others: str = ""
    armed: bool | None = None
    airborne: bool | None = None
    flown: bool = False

    @property
    def last_seen(self) -> str:
        """Where the vehicle was when it last said so, for whoever has to look for it."""
        if self.airborne is None:
            return "it never said whether it was in the air"
        return "last seen in the air" if self.airborne else "last seen on the ground"

    @property
    def at_rest(self) -> bool:
        """On the ground and disarmed, as it said itself."""
        return self.armed is False and self.airborne is False
