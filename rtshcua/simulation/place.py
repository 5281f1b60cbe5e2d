"""Positions: local metres around home, and latitude and longitude in 1e-7 degree (WGS 84)."""

from dataclasses import dataclass, field
from math import copysign, cos, pi, radians

_METRES_PER_E7 = 6_378_137 * pi / 180e7
"""Metres per 1e-7 degree of latitude, on a sphere of the equatorial radius: error at most 0.5 %."""
_HALF_TURN_E7 = 1_800_000_000
_MOST_E7 = 2**31 - 1


@dataclass(frozen=True, slots=True)
class Point:
    """Metres north, east and up of home."""

    north: float
    east: float
    up: float


@dataclass(frozen=True, slots=True)
class HomePosition:
    """The start position: degrees times 1e7, and millimetres above mean sea level."""

    latitude: int
    longitude: int
    amsl_mm: int
    _shrink: float = field(init=False, repr=False, compare=False)  # of a degree of longitude

    def __post_init__(self) -> None:
        object.__setattr__(self, "_shrink", cos(radians(self.latitude / 1e7)))

    def local(self, latitude: float, longitude: float) -> tuple[float, float]:
        """Return metres north and east of home, on the tangent plane, accurate within some kilometres."""
        north = (latitude - self.latitude) * _METRES_PER_E7
        east = longitude - self.longitude
        if abs(east) > _HALF_TURN_E7:  # crosses longitude 180
            east -= copysign(2 * _HALF_TURN_E7, east)
        return north, east * _METRES_PER_E7 * self._shrink

    def globe(self, north: float, east: float) -> tuple[int, int]:
        """Return latitude and longitude in 1e-7 degree, limited to 32 bits; the inverse of `local`."""
        longitude = self.longitude + round(east / _METRES_PER_E7 / self._shrink)
        if abs(longitude) > _HALF_TURN_E7:
            longitude -= 2 * _HALF_TURN_E7 if longitude > 0 else -2 * _HALF_TURN_E7
        latitude = self.latitude + round(north / _METRES_PER_E7)
        if abs(latitude) > _MOST_E7 or abs(longitude) > _MOST_E7:
            return max(-_MOST_E7, min(_MOST_E7, latitude)), max(-_MOST_E7, min(_MOST_E7, longitude))
        return latitude, longitude
