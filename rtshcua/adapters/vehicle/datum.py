"""The one place where a height above home and an altitude above mean sea level are made of each other.

Everything of ours is in mm above home. PX4's commands take metres above mean sea level, whatever frame they name.
A mistake between the two has crashed real vehicles.
"""

from typing import Final

_MM: Final = 1_000


class NoDatum(RuntimeError):
    """A height was to be converted before the vehicle said how high its home lies."""


def amsl_m(height_mm: int, home_amsl_mm: int | None) -> float:
    """Metres above mean sea level of a height in mm above home. Raises NoDatum where home's own is not known."""
    if home_amsl_mm is None:
        raise NoDatum("the vehicle has not said how high its home lies, so no altitude can be commanded")
    return (home_amsl_mm + height_mm) / _MM


def home_amsl_mm(amsl_mm: int, height_mm: int) -> int:
    """How high home lies above mean sea level, by one report of both altitudes (GLOBAL_POSITION_INT)."""
    return amsl_mm - height_mm


def relative_m(height_mm: int) -> float:
    """Metres above home, for what takes those."""
    return height_mm / _MM
