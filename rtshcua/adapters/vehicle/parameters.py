"""Parameters of the vehicle, by name: read, or set and seen to be set.

An unknown name is answered by silence, in both flavours, so after a few times it counts as not there; it is asked for
again now and then.
PX4 carries integers as their bytes inside the float, ArduPilot casts them.
"""

import struct
from dataclasses import dataclass
from typing import Any, Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import Message

RETRY_US: Final = 1_000_000
RETRIES: Final = 5
#: How often one that did not answer is asked for again.
AGAIN_US: Final = 10_000_000

_FLOAT: Final = 9  # MAV_PARAM_TYPE_REAL32
#: MAV_PARAM_TYPE of integers, and the bytes that they are in a float's place
_INTEGERS: Final = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}


@dataclass(slots=True)
class _Wanted:
    """A parameter that is asked for, or is to be set to `value`."""

    value: float | None
    tries: int = 0
    sent_us: int = 0
    silent: bool = False


class Parameters:
    """Each name has one request outstanding. `values` holds what was heard of any that was asked for."""

    def __init__(self, *, bytewise: bool, slack: int = 1) -> None:
        self._bytewise = bytewise
        self._slack = slack
        self.values: dict[str, float] = {}
        self._types: dict[str, int] = {}
        self._wanted: dict[str, _Wanted] = {}

    def read(self, name: str) -> None:
        """Ask for one that is not asked for yet."""
        self._wanted.setdefault(name, _Wanted(None))

    def forget(self, name: str) -> None:
        """As if it had never been asked for."""
        self._wanted.pop(name, None)
        self.values.pop(name, None)

    def write(self, name: str, value: float) -> None:
        """Set one that was read before."""
        self._wanted[name] = _Wanted(value)

    def is_absent(self, name: str) -> bool:
        """Whether it did not answer, as often as it was asked."""
        return name in self._wanted and self._wanted[name].silent

    def is_settled(self, name: str) -> bool:
        """Whether nothing about it is outstanding."""
        return name not in self._wanted

    def take(self, message: Any) -> None:
        """A PARAM_VALUE."""
        name, value = _name(message), self._decode(message)
        wanted = self._wanted.get(name)
        if wanted is None and name not in self.values:
            return
        self.values[name], self._types[name] = value, message.param_type
        if wanted is not None and wanted.value in (None, value):
            del self._wanted[name]

    def due(self, system: int, now_us: int) -> list[Message]:
        """The requests to send now."""
        out: list[Message] = []
        for name, wanted in self._wanted.items():
            pause_us = (AGAIN_US if wanted.silent else RETRY_US) * self._slack
            if wanted.tries and now_us - wanted.sent_us < pause_us:
                continue
            wanted.silent = wanted.tries >= RETRIES
            wanted.tries, wanted.sent_us = wanted.tries + 1, now_us
            if wanted.value is None:
                out.append(messages.parameter_read(system, name))
            else:
                kind = self._types[name]
                out.append(messages.parameter_set(system, name, self._encode(wanted.value, kind), kind))
        return out

    def _decode(self, message: Any) -> float:
        shape = _INTEGERS.get(message.param_type)
        if not self._bytewise or shape is None:
            return float(message.param_value)
        return float(struct.unpack(shape, struct.pack("<f", message.param_value))[0])

    def _encode(self, value: float, kind: int) -> float:
        shape = _INTEGERS.get(kind)
        if not self._bytewise or shape is None:
            return value
        encoded: float = struct.unpack("<f", struct.pack(shape, int(value)))[0]
        return encoded


def _name(message: Any) -> str:
    name: str | bytes = message.param_id
    text = name if isinstance(name, str) else name.decode("ascii", "replace")
    return text.rstrip("\0")
