"""The flight modes of the simulated vehicle, and how a flavour numbers them."""

from collections.abc import Mapping
from dataclasses import dataclass

from rtshcua.model.faults import FlightMode

NEEDS_POSITION = frozenset(
    {
        FlightMode.POSITION,
        FlightMode.LOITER,
        FlightMode.TAKEOFF,
        FlightMode.GUIDED,
        FlightMode.MISSION,
        FlightMode.ORBIT,
        FlightMode.BRAKE,
        FlightMode.RETURN,
    },
)
"""Modes that cannot be entered without a position estimate."""


@dataclass(frozen=True, slots=True)
class ModeTable:
    """The numbers and names of a flavour's modes."""

    numbers: Mapping[FlightMode, int]
    """`custom_mode` of HEARTBEAT."""
    base: Mapping[FlightMode, int]
    """`base_mode` of HEARTBEAT while disarmed."""
    start: FlightMode
    """The mode after boot."""
    armable: frozenset[FlightMode]
    """The modes in which arming is not refused."""
    names: Mapping[int, str]
    """The names in the flavour's texts, by number."""
    blind: int = 0
    """The bits that `base_mode` loses while the vehicle lands without a position."""
    stands_by: bool = False
    """Whether HEARTBEAT reports standby until lift-off, even if armed."""

    def name(self, mode: FlightMode) -> str:
        """Return the flavour's name of a mode."""
        return self.names[self.numbers[mode]]

    def mode(self, number: int) -> FlightMode | None:
        """Return the mode with this `custom_mode`, if any."""
        return next((mode for mode, own in self.numbers.items() if own == number), None)
