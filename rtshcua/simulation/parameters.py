"""The parameters of the simulated vehicle, and how each flavour encodes integers."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.simulation.handling import Handling

INT8 = mavlink.MAV_PARAM_TYPE_INT8
INT16 = mavlink.MAV_PARAM_TYPE_INT16
INT32 = mavlink.MAV_PARAM_TYPE_INT32
REAL32 = mavlink.MAV_PARAM_TYPE_REAL32
_UNNUMBERED = 65_535
_LEAST = 0.1
"""The least speed or height that can be set: the model does not support 0."""
_MAY_BE_ZERO = frozenset({"return_speed", "near_m", "cone_deg", "cone_slope", "climb_least"})
"""The attributes for which 0 has a meaning."""


@dataclass(frozen=True, slots=True)
class AutopilotParameter:
    """A parameter: its type, and the attribute of `Handling` that it sets, if any, in 1/`scale` metres or seconds."""

    name: str
    type: int = REAL32
    attribute: str | None = None
    scale: int = 1
    value: float = 0.0
    """The initial value if it sets no attribute."""


class Parameters:
    """The parameters of one vehicle. `bytewise`: integers are encoded bytewise in the float field, otherwise cast."""

    def __init__(self, table: tuple[AutopilotParameter, ...], handling: Handling, bytewise: bool) -> None:
        self._table = {parameter.name: parameter for parameter in table}
        self._names = [parameter.name for parameter in table]
        self._handling = handling
        self._bytewise = bytewise
        self._values = {
            parameter.name: parameter.value
            if parameter.attribute is None
            else getattr(handling, parameter.attribute) * parameter.scale
            for parameter in table
        }

    def all(self) -> Iterator[Message]:
        """Return PARAM_VALUE of each parameter."""
        return (self._message(name, listed=True) for name in self._names)

    def read(self, name: str, index: int) -> Message | None:
        """Return PARAM_VALUE of the parameter at `index`, or by name if `index` is -1; None if there is none."""
        if index >= 0:
            name = self._names[index] if index < len(self._names) else ""
        return self._message(name, listed=index >= 0) if name in self._table else None

    def value(self, name: str) -> float:
        """Return the value of a parameter of the table."""
        return self._values[name]

    def assign(self, name: str, value: float) -> Message | None:
        """Set a parameter from inside the vehicle, if it exists; return PARAM_VALUE."""
        if name not in self._table:
            return None
        self._values[name] = value
        return self._message(name)

    def write(self, name: str, raw: float, type_: int) -> Message | None:
        """Handle PARAM_SET; return PARAM_VALUE, or None if the autopilot does not answer.

        PX4 ignores a wrong type ("param types mismatch", on its console only), ArduPilot NaN and infinity, and both an
        unknown name (`mavlink_parameters.cpp`, `GCS_Param.cpp`).
        """
        parameter = self._table.get(name)
        if parameter is None or (self._bytewise and type_ != parameter.type):
            return None
        value = self._decode(raw, type_)
        if not self._bytewise and not isfinite(value):
            return None
        if value == value and abs(value) < 1e9:  # NaN and nonsense change nothing
            self._store(parameter, value)
        return self._message(name)

    def own(self, name: str, value: float) -> None:
        """Set a parameter as the vehicle's owner. Raise ValueError if there is no parameter of this name."""
        if name not in self._table:
            raise ValueError(f"this vehicle has no parameter `{name}`")
        self._store(self._table[name], value)

    def _store(self, parameter: AutopilotParameter, value: float) -> None:
        stored = self._values[parameter.name] = value if parameter.type == REAL32 else float(round(value))
        if parameter.attribute is not None:
            least = 0.0 if parameter.attribute in _MAY_BE_ZERO else _LEAST
            setattr(self._handling, parameter.attribute, max(least, stored / parameter.scale))

    def _decode(self, raw: float, type_: int) -> float:
        if self._bytewise and type_ == mavlink.MAV_PARAM_TYPE_INT32:
            return float(struct.unpack("<i", struct.pack("<f", raw))[0])
        return raw

    def _message(self, name: str, listed: bool = False) -> Message:
        """Return PARAM_VALUE. ArduCopter sends a parameter's index only in a list."""
        value, parameter = self._values[name], self._table[name]
        if parameter.type != REAL32 and self._bytewise:
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        number = self._names.index(name) if listed or self._bytewise else _UNNUMBERED
        return mavlink.MAVLink_param_value_message(name.encode(), value, parameter.type, len(self._names), number)
