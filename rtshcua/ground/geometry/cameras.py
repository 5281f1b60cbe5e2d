"""What a camera sees of a flat surface that it looks at squarely: footprint, pixel, overlap, blur, in exact fractions.

The pinhole model: an extent *s* on the sensor shows *s* * *away* / *focal* of the surface. Lens distortion, tilt and
the vehicle's position error are not part of it (docs/survey.md). Lengths on the sensor are in um, all others in mm,
speeds in mm/s, times in us, shares in 1/10000.
"""

from fractions import Fraction
from math import ceil, floor
from typing import Final, NamedTuple

from rtshcua.model.flat.limits import FULL

_SECOND_US: Final = 1_000_000
_MM_UM: Final = 1_000


class SurveyCamera(NamedTuple):
    """A camera: its sensor's extents and pixels along and across the direction of flight, and its times."""

    along: int
    across: int
    pixels_along: int
    pixels_across: int
    focal: int
    interval_us: int
    exposure_us: int

    def shows_along(self, away: int) -> Fraction:
        """Return the extent of a picture along the flight in mm, at a distance in mm."""
        return Fraction(self.along * away, self.focal)

    def shows_across(self, away: int) -> Fraction:
        """Return the extent of a picture across the flight in mm, at a distance in mm."""
        return Fraction(self.across * away, self.focal)

    def sample_distance(self, away: int) -> Fraction:
        """Return what a pixel shows, in mm: the larger of its two sides (ground sampling distance)."""
        return self._pitch() * away / self.focal

    def farthest(self, resolution_um: int) -> int:
        """Return the greatest distance in mm at which a pixel shows at most `resolution_um`."""
        return floor(Fraction(resolution_um * self.focal, _MM_UM) / self._pitch())

    def blur(self, speed: int, away: int) -> int:
        """Return how far a picture smears at a speed, in 1/10000 of a pixel, rounded up."""
        moved = Fraction(speed * self.exposure_us, _SECOND_US)
        return ceil(FULL * moved * self.pixels_along / self.shows_along(away)) if away > 0 else FULL * FULL

    def fastest(self, blur: int, away: int) -> int:
        """Return the greatest speed in mm/s at which a picture smears at most `blur` 1/10000 of a pixel."""
        return floor(Fraction(blur * _SECOND_US, FULL * self.exposure_us) * self.shows_along(away) / self.pixels_along)

    def _pitch(self) -> Fraction:
        return max(Fraction(self.along, self.pixels_along), Fraction(self.across, self.pixels_across))


def apart(extent: Fraction, overlap: int) -> int:
    """Return the greatest distance in mm of two pictures of this extent that overlap by a share, rounded down."""
    return floor(extent * (FULL - overlap) / FULL)


def overlap(extent: Fraction, distance: int | Fraction) -> int:
    """Return the share of a picture that its neighbour at a distance shows too, rounded down; 0 if there is none."""
    return max(0, floor(FULL * (1 - distance / extent))) if extent > 0 else 0


def passed_in(speed: int, time_us: int) -> Fraction:
    """Return the way in mm at a speed."""
    return Fraction(speed * time_us, _SECOND_US)


def time_for(way: int, speed: int) -> int:
    """Return the time of a way at a speed in us, rounded down."""
    return way * _SECOND_US // speed
