"""What a signal as it is read on board may report, and which members of an enumeration mean that it is not known."""

from rtshcua.ground.checker.ranges import OPEN, Carrier, carried
from rtshcua.ground.checker.symbols import Extent
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.flat.signal import ENUMERATION, NUMBER, Signal
from rtshcua.model.quantity import Dimension


def means_unknown(signal: Signal, value: int) -> bool:
    """Whether the value of an enumeration is one that each of its sources lists under `unknown at`."""
    return signal.kind == ENUMERATION and all(value in source.unknown for source in signal.sources)


def extent(signal: Signal, dialect: Dialect) -> Extent:
    """From the least to the greatest value of a number; open for what is none, or is read from an unknown message."""
    if signal.kind != NUMBER or any(source.message not in dialect.messages for source in signal.sources):
        return OPEN
    carriers = (
        Carrier(source.message, source.fields, source.numerator, source.denominator) for source in signal.sources
    )
    return carried(dialect, Dimension(signal.dimension), carriers)
