"""The flight modes that the simulated vehicle has, whatever number the flavour gives them."""

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
    """How a flavour numbers the modes that it has."""

    numbers: Mapping[FlightMode, int]
    """`custom_mode` of HEARTBEAT."""
    base: Mapping[FlightMode, int]
    """`base_mode` of HEARTBEAT while disarmed."""
    start: FlightMode
    """The mode after boot."""
    armable: frozenset[FlightMode]
    """The modes in which arming is not refused."""
    names: Mapping[int, str]
    """What the flavour calls them in its texts, by number."""
    blind: int = 0
    """What `base_mode` loses while the vehicle lands without a position."""
    stands_by: bool = False
    """Whether HEARTBEAT tells that it stands by until it lifts off, armed or not."""

    def name(self, mode: FlightMode) -> str:
        """What the flavour calls a mode that it has."""
        return self.names[self.numbers[mode]]

    def mode(self, number: int) -> FlightMode | None:
        """The mode with this `custom_mode`, if the flavour has one."""
        return next((mode for mode, own in self.numbers.items() if own == number), None)
