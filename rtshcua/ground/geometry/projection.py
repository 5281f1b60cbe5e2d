"""The two scales of `Projection`, from WGS 84 to local millimetres, in decimal arithmetic.

x is east, y is north of the vehicle's declared home. `decimal` with a fixed context computes the same digits on every
machine; the sine and cosine of the C library do not.
"""

from decimal import ROUND_HALF_EVEN, Context, Decimal, localcontext

from rtshcua.model.flat.zone import SHIFT, Projection

#: WGS 84 (NIMA TR8350.2): semi-major axis in mm, flattening.
SEMI_MAJOR = Decimal(6_378_137_000)
FLATTENING = 1 / Decimal("298.257223563")

PI = Decimal("3.14159265358979323846264338327950288419716939937511")
DEGREE_E7 = 10_000_000  # the unit of latitudes and longitudes: 1e-7 degree
CONTEXT = Context(prec=40, rounding=ROUND_HALF_EVEN)


def projection_at(latitude: int, longitude: int) -> Projection:
    """Return the local projection at a place in 1e-7 degree, for latitudes between 85 S and 85 N.

    One degree of latitude is `M * pi / 180` and one of longitude `N * cos(latitude) * pi / 180`, with the meridional
    radius `M = a (1 - e2) / (1 - e2 sin2)^1.5` and the prime vertical radius `N = a / (1 - e2 sin2)^0.5`.
    """
    with localcontext(CONTEXT):
        phi = Decimal(latitude) / DEGREE_E7 * PI / 180
        sine, cosine = sine_of(phi), sine_of(PI / 2 - phi)
        squared = FLATTENING * (2 - FLATTENING)  # e2, the first eccentricity squared
        bend = 1 - squared * sine * sine
        root = bend.sqrt()
        meridional = SEMI_MAJOR * (1 - squared) / (bend * root)
        vertical = SEMI_MAJOR / root
        step = PI / 180 / DEGREE_E7 * (1 << SHIFT)
        north = int((meridional * step).to_integral_value())
        east = int((vertical * cosine * step).to_integral_value())
    return Projection(latitude=latitude, longitude=longitude, east=east, north=north)


def sine_of(angle: Decimal) -> Decimal:
    """Return the sine by its Taylor series, to the precision of the context. `angle` is in radians, at most pi."""
    term = total = angle
    square = angle * angle
    n = 1
    while abs(term) > Decimal("1e-38"):
        n += 2
        term *= -square / (n * (n - 1))
        total += term
    return total
