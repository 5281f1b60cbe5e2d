"""Signals for the state monitor: their MAVLink fields, their scale, and when a value is unknown or stale."""

from rtshcua.model.flat.struct import Flat

NUMBER, ENUMERATION, POSITION = 0, 1, 2

#: The name of the signal whose value is the measured drain per minute of its field.
DRAIN = "battery.drain"
#: The name of the signal whose value is its field divided by the number of cells of the vehicle.
CELL = "battery.cell"


class SignalSource(Flat, frozen=True):
    """One message and its field or fields; a raw value `v` is `v * numerator / denominator` in the canonical unit.

    `where` are fields with the raw values that they must have for a message to count, ascending by field.
    """

    message: str
    fields: tuple[str, ...]
    numerator: int
    denominator: int
    unknown: tuple[int, ...]
    where: tuple[tuple[str, int], ...] = ()


class Signal(Flat, frozen=True):
    """A signal owns state slot `slot`; a position owns `slot` (x, local mm) and `slot + 1` (y).

    `kind` is NUMBER (a pair of fields is the length of the vector), ENUMERATION or POSITION (latitude, longitude).
    `dimension` is a `Dimension` value, the enumeration's name, or `position`; `labels` name an enumeration's values.
    """

    name: str
    slot: int
    kind: int
    dimension: str
    stale_us: int
    labels: tuple[tuple[int, str], ...]
    sources: tuple[SignalSource, ...]

    @property
    def slots(self) -> range:
        """The state slots that the signal owns."""
        return range(self.slot, self.slot + (2 if self.kind == POSITION else 1))
