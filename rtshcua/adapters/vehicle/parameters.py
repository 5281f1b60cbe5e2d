"""Parameters of the vehicle, by name: read, or set and seen to be set.

An unknown name is answered by silence, in both flavours, so after a few times it counts as not there; it is asked for
again now and then.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Any, Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.parameters import decode, encode, fits

RETRY_US: Final = 1_000_000
RETRIES: Final = 5
#: How often one that did not answer is asked for again.
AGAIN_US: Final = 10_000_000


@dataclass(slots=True)
class _Wanted:
    """A parameter that is asked for, or is to be set to `value`."""

    value: float | None
    tries: int = 0
    sent_us: int = 0
    silent: bool = False


class VehicleParameters:
    """Each name has one request outstanding. `values` holds what was heard of any that was asked for."""

    def __init__(self, *, bytewise: bool, slack: int = 1) -> None:
        self._bytewise = bytewise
        self._slack = slack
        self.values: dict[str, float] = {}
        self._types: dict[str, int] = {}
        #: what was asked for, or is to be set, and was not answered yet
        self.outstanding: dict[str, _Wanted] = {}
        #: what was set: the value that was found, and the one that is wanted
        self.changed: dict[str, tuple[float, float]] = {}
        #: why the boundary did not let out what was to be set, last
        self.refused: Refusal | None = None

    def read(self, name: str) -> None:
        """Ask for one that is not asked for yet."""
        self.outstanding.setdefault(name, _Wanted(None))

    def forget(self, name: str) -> None:
        """As if it had never been asked for."""
        self.outstanding.pop(name, None)
        self.values.pop(name, None)

    def drop(self, name: str) -> None:
        """Ask for it, or set it, no more; what was heard of it stays."""
        self.outstanding.pop(name, None)
        self.refused = None

    def write(self, name: str, value: float) -> None:
        """Set one that was read before."""
        before, _ = self.changed.get(name, (self.values[name], 0.0))
        self.changed[name] = before, value
        self.outstanding[name] = _Wanted(value)

    def fits(self, name: str, value: float) -> bool:
        """Whether one that was read keeps this value as it is, by the type that the vehicle says it has."""
        return fits(value, self._types[name])

    def has(self, name: str, bits: int) -> bool:
        """Whether one that was read has all these bits set."""
        return self._bits(name) & bits == bits

    def ensure(self, name: str, bits: int) -> None:
        """Read it if it was not, and set the bits that it lacks."""
        if name not in self.values:
            self.read(name)
        elif self.is_settled(name) and not self.has(name, bits):
            self.write(name, float(self._bits(name) | bits))

    def _bits(self, name: str) -> int:
        value = self.values.get(name, 0.0)
        return int(value) if isfinite(value) else 0

    def is_absent(self, name: str) -> bool:
        """Whether it did not answer, as often as it was asked."""
        return name in self.outstanding and self.outstanding[name].silent

    def is_known(self, name: str) -> bool:
        """Whether it answered, or is given up for now."""
        return name in self.values or self.is_absent(name)

    def is_settled(self, name: str) -> bool:
        """Whether nothing about it is outstanding."""
        return name not in self.outstanding

    def take(self, message: Any) -> None:
        """A PARAM_VALUE."""
        name, value = message.param_id, decode(message.param_value, message.param_type, bytewise=self._bytewise)
        wanted = self.outstanding.get(name)
        if wanted is None and name not in self.values:
            return
        self.values[name], self._types[name] = value, message.param_type
        if wanted is not None and wanted.value in (None, value):
            del self.outstanding[name]

    def due(self, system: int, now_us: int) -> list[Message]:
        """The requests to send now. What no message can carry, by the type that the vehicle says now, is given up."""
        out: list[Message] = []
        unfit: list[str] = []
        for name, wanted in self.outstanding.items():
            pause_us = (AGAIN_US if wanted.silent else RETRY_US) * self._slack
            if wanted.tries and now_us - wanted.sent_us < pause_us:
                continue
            wanted.silent = wanted.tries >= RETRIES
            wanted.tries, wanted.sent_us = wanted.tries + 1, now_us
            if wanted.value is None:
                out.append(messages.parameter_read(system, name))
            else:
                kind = self._types[name]
                raw = encode(wanted.value, kind, bytewise=self._bytewise)
                if raw is None:
                    unfit.append(name)
                else:
                    out.append(messages.parameter_set(system, name, raw, kind))
        for name in unfit:
            del self.outstanding[name]
        return out
