"""The units in which the values of a flight's signals are shown and exported."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from rtshcua.ground.flight.flown import SignalSeries
from rtshcua.model.flat.signal import DRAIN
from rtshcua.model.quantity import Dimension


class SignalUnit(NamedTuple):
    """A unit for people, and as a suffix of names; one of it is `10**digits` canonical units."""

    symbol: str
    suffix: str
    digits: int

    @property
    def title(self) -> str:
        """The suffix with its separator."""
        return f"_{self.suffix}" if self.suffix else ""


_NONE: Final = SignalUnit("", "", 0)
_UNITS: Final[Mapping[str, SignalUnit]] = {
    Dimension.LENGTH.value: SignalUnit("m", "m", 3),
    Dimension.ALTITUDE.value: SignalUnit("m", "m", 3),
    Dimension.SPEED.value: SignalUnit("m/s", "m_s", 3),
    Dimension.DURATION.value: SignalUnit("s", "s", 6),
    Dimension.ANGLE.value: SignalUnit("deg", "deg", 7),
    Dimension.RATIO.value: SignalUnit("%", "percent", 2),
    Dimension.VOLTAGE.value: SignalUnit("V", "V", 3),
    Dimension.COUNT.value: _NONE,
}


def unit_of(series: SignalSeries) -> SignalUnit:
    """The unit of a signal; that of an altitude names its datum. The drain of the battery is in % of it per minute."""
    unit = _UNITS.get(series.dimension, _NONE)
    if series.name == DRAIN:
        return unit._replace(symbol=f"{unit.symbol} per minute", suffix=f"{unit.suffix}_per_min")
    if series.datum:
        return unit._replace(symbol=f"{unit.symbol} above {series.datum}", suffix=f"above_{series.datum}_{unit.suffix}")
    return unit
