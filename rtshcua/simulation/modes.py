"""The flight modes that the simulated vehicle has, whatever number the flavour gives them."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Mode(StrEnum):
    """A flight mode by what it does."""

    MANUAL = "manual"
    """The pilot's sticks alone (MANUAL, STABILIZE)."""
    ALTITUDE = "altitude"
    """The pilot's sticks, height held (ALTCTL, ALT_HOLD)."""
    POSITION = "position"
    """The pilot's sticks, place held (POSCTL, POSHOLD)."""
    LOITER = "loiter"
    """Stays where it is (AUTO.LOITER, LOITER)."""
    TAKEOFF = "takeoff"
    """Climbs, then loiters (AUTO.TAKEOFF; ArduCopter takes off in GUIDED)."""
    GUIDED = "guided"
    """Flies to position targets as they come (OFFBOARD, GUIDED)."""
    MISSION = "mission"
    """Flies the mission that was uploaded (AUTO.MISSION, AUTO)."""
    ORBIT = "orbit"
    """Circles a place (PX4 only)."""
    BRAKE = "brake"
    """Stops and stays (ArduCopter only)."""
    RETURN = "return"
    """Climbs, flies home and lands (AUTO.RTL, RTL)."""
    LAND = "land"
    """Lands where it is (AUTO.LAND, LAND)."""


NEEDS_POSITION = frozenset(
    {Mode.POSITION, Mode.LOITER, Mode.TAKEOFF, Mode.GUIDED, Mode.MISSION, Mode.ORBIT, Mode.BRAKE, Mode.RETURN},
)
"""Modes that cannot be entered without a position estimate."""


@dataclass(frozen=True, slots=True)
class ModeTable:
    """How a flavour numbers the modes that it has."""

    numbers: Mapping[Mode, int]
    """`custom_mode` of HEARTBEAT."""
    base: Mapping[Mode, int]
    """`base_mode` of HEARTBEAT while disarmed."""
    start: Mode
    """The mode after boot."""
    armable: frozenset[Mode]
    """The modes in which arming is not refused."""
    names: Mapping[int, str]
    """What the flavour calls them in its texts, by number."""
    blind: int = 0
    """What `base_mode` loses while the vehicle lands without a position."""
    stands_by: bool = False
    """Whether HEARTBEAT tells that it stands by until it lifts off, armed or not."""

    def name(self, mode: Mode) -> str:
        """What the flavour calls a mode that it has."""
        return self.names[self.numbers[mode]]

    def mode(self, number: int) -> Mode | None:
        """The mode with this `custom_mode`, if the flavour has one."""
        return next((mode for mode, own in self.numbers.items() if own == number), None)
