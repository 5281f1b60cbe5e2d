"""Vehicles."""

from rtshcua.diagnostics.codes import NOT_WRITTEN, SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.base import Part
from rtshcua.ground.language.build.zones import Zones
from rtshcua.ground.language.wording import short
from rtshcua.model.ir.expression import Coordinates, Quantity, TimeOfDay
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import Acceleration, Braking, NamedSpeed, VehicleDecl
from rtshcua.model.quantity import UNITS, Dimension

FULL = 100 * UNITS["%"].numerator

#: The most cells in series that a battery of a multirotor may have.
MOST_CELLS = 48

VEHICLE_PARTS = ("identity", "home", "speed", "climb", "position error", "energy", "reserve")


class Vehicles(Zones):
    """What flies."""

    def identity(self, span: Span, text: str) -> Part:
        """`identity "quad-07"`."""
        if not text.strip():
            help = 'say what the vehicle calls itself, as in `identity "quad-07"`: a bundle runs nowhere else'
            self.report(NOT_WRITTEN, "the identity is empty", span, help)
        return Part("identity", span, text)

    def home(self, span: Span, place: Coordinates, within: Quantity) -> Part:
        """`home 47.39774 N, 8.54559 E within 50 m`."""
        return Part("home", span, (place, within))

    def speed(self, span: Span, most: Quantity) -> Part:
        """`speed at most 12 m/s`."""
        return Part("speed", span, most)

    def climb(self, span: Span, most: Quantity) -> Part:
        """`climb at most 3 m/s`."""
        return Part("climb", span, most)

    def position_error(self, span: Span, error: Quantity) -> Part:
        """`position error 3 m`."""
        return Part("position error", span, error)

    def endurance(self, span: Span, charge: Quantity, hover: Quantity, flight: Quantity | None) -> Part:
        """`energy 100 % = 18 min hover`, `energy 100 % = 18 min hover, 14 min flight`."""
        if charge.dimension is not Dimension.RATIO or charge.value != FULL:
            written = short(self._source.slice(charge.span))
            self.report(
                SYNTAX,
                f"the hover time is that of a full battery, not of `{written}`",
                charge.span,
                "write it as in `energy 100 % = 18 min hover`",
            )
        return Part("energy", span, (hover, flight))

    def reserve(self, span: Span, charge: Quantity) -> Part:
        """`reserve 15 %`."""
        return Part("reserve", span, charge)

    def cells(self, span: Span, count: Quantity) -> Part:
        """`cells 4`."""
        if not 1 <= count.value <= MOST_CELLS:
            found = f"`{self._source.slice(count.span)}` cells in series, where 1 to {MOST_CELLS} are possible"
            self.report(SYNTAX, found, count.span, "write it as in `cells 4`")
        return Part("cells", span, count)

    def clock(self, span: Span, sign: str, offset: TimeOfDay) -> Part:
        """`clock utc +02:00`."""
        value = -offset.value if sign == "-" else offset.value
        return Part("clock", span, Quantity(span=span, value=value, dimension=Dimension.DURATION))

    def time_zone(self, span: Span, name: str) -> Part:
        """`clock "Europe/Berlin"`."""
        return Part("clock", span, Name(span=span, text=name))

    def elevation(self, span: Span, altitude: Quantity, within: Quantity | None) -> Part:
        """`elevation 408 m above sea within 5 m`."""
        return Part("elevation", span, (altitude, within))

    def return_at(self, span: Span, altitude: Quantity) -> Part:
        """`return at 30 m`."""
        return Part("return", span, altitude)

    def brakes(self, span: Span, speed: Quantity, time: Quantity, reaction: Quantity) -> Part:
        """`brakes from 12 m/s in 6 s after 500 ms`."""
        return Part("brakes", span, Braking(span=span, speed=speed, time=time, reaction=reaction))

    def speeds(self, span: Span, *speeds: NamedSpeed) -> Part:
        """`speeds cruise 5 m/s, climb 1.5 m/s, landing 0.5 m/s below 10 m`."""
        return Part("speeds", span, speeds)

    def named_speed(self, span: Span, name: Name, speed: Quantity, below: Quantity | None) -> NamedSpeed:
        """`climb 1.5 m/s`."""
        return NamedSpeed(span=span, name=name, speed=speed, below=below)

    def accelerates(self, span: Span, speed: Quantity, time: Quantity) -> Part:
        """`accelerates to 5 m/s in 5 s`."""
        return Part("accelerates", span, Acceleration(span=span, speed=speed, time=time))

    def wind(self, span: Span, most: Quantity) -> Part:
        """`wind at most 8 m/s`."""
        return Part("wind", span, most)

    def not_fitted(self, span: Span, names: tuple[Name, ...]) -> Part:
        """`without obstacle.distance, link.quality`."""
        return Part("without", span, names)

    def vehicle(self, span: Span, name: Name, *given: Part) -> None:
        """`vehicle quad { ... }`."""
        self.undotted(name, "vehicle")
        found = self.parts("vehicle", name, given, VEHICLE_PARTS)
        if self.sound:
            self._finish_vehicle(span, name, found)
        else:
            self.abandon(name)

    def _finish_vehicle(self, span: Span, name: Name, found: dict[str, Part]) -> None:
        home, within = found["home"].value
        hover, flight = found["energy"].value
        elevation, elevation_within = found["elevation"].value if "elevation" in found else (None, None)
        clock = found["clock"].value if "clock" in found else None
        self.declare(
            VehicleDecl(
                span=span,
                name=name,
                identity=found["identity"].value,
                home=home,
                within=within,
                speed=found["speed"].value,
                climb=found["climb"].value,
                position_error=found["position error"].value,
                endurance=hover,
                reserve=found["reserve"].value,
                utc_offset=clock if isinstance(clock, Quantity) else None,
                time_zone=clock if isinstance(clock, Name) else None,
                elevation=elevation,
                elevation_within=elevation_within,
                return_altitude=found["return"].value if "return" in found else None,
                braking=found["brakes"].value if "brakes" in found else None,
                without=found["without"].value if "without" in found else (),
                speeds=found["speeds"].value if "speeds" in found else (),
                acceleration=found["accelerates"].value if "accelerates" in found else None,
                wind=found["wind"].value if "wind" in found else None,
                flight=flight,
                cells=found["cells"].value if "cells" in found else None,
            ),
            name,
        )
