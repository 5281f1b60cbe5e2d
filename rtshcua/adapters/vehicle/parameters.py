"""Parameters of the vehicle by name: read them, or set them and verify the value. Both flavours do not answer unknown
names, so a parameter without an answer counts as absent after a few requests; it is requested again from time to time.
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
#: How often an unanswered parameter is requested again.
AGAIN_US: Final = 10_000_000


@dataclass(slots=True)
class _Wanted:
    """A parameter to read, or to set to `value`."""

    value: float | None
    tries: int = 0
    sent_us: int = 0
    silent: bool = False


class VehicleParameters:
    """Has one request outstanding for each name. `values` holds the reported values of requested parameters."""

    def __init__(self, *, bytewise: bool, slack: int = 1) -> None:
        self._bytewise = bytewise
        self._slack = slack
        self.values: dict[str, float] = {}
        self._types: dict[str, int] = {}
        #: parameters to read or set that were not answered yet
        self.outstanding: dict[str, _Wanted] = {}
        #: parameters that were set: the previous and the wanted value
        self.changed: dict[str, tuple[float, float]] = {}
        #: why the boundary last refused to set a parameter
        self.refused: Refusal | None = None

    def read(self, name: str) -> None:
        """Request a parameter, unless it was requested already."""
        self.outstanding.setdefault(name, _Wanted(None))

    def forget(self, name: str) -> None:
        """Forget a parameter as if it had never been requested."""
        self.outstanding.pop(name, None)
        self.values.pop(name, None)

    def drop(self, name: str) -> None:
        """Stop reading or setting it; its reported value stays."""
        self.outstanding.pop(name, None)
        self.refused = None

    def write(self, name: str, value: float) -> None:
        """Set a parameter that was read before."""
        before, _ = self.changed.get(name, (self.values[name], 0.0))
        self.changed[name] = before, value
        self.outstanding[name] = _Wanted(value)

    def fits(self, name: str, value: float) -> bool:
        """Whether a parameter that was read can hold this value exactly, by its reported type."""
        return fits(value, self._types[name])

    def has(self, name: str, bits: int) -> bool:
        """Whether a parameter that was read has all these bits."""
        return self._bits(name) & bits == bits

    def ensure(self, name: str, bits: int) -> None:
        """Read it if necessary, and set the missing bits."""
        if name not in self.values:
            self.read(name)
        elif self.is_settled(name) and not self.has(name, bits):
            self.write(name, float(self._bits(name) | bits))

    def _bits(self, name: str) -> int:
        value = self.values.get(name, 0.0)
        return int(value) if isfinite(value) else 0

    def is_absent(self, name: str) -> bool:
        """Whether it never answered, after all requests."""
        return name in self.outstanding and self.outstanding[name].silent

    def is_known(self, name: str) -> bool:
        """Whether it answered or was given up for now."""
        return name in self.values or self.is_absent(name)

    def is_settled(self, name: str) -> bool:
        """Whether no request about it is outstanding."""
        return name not in self.outstanding

    def take(self, message: Any) -> None:
        """Take in a PARAM_VALUE."""
        name, value = message.param_id, decode(message.param_value, message.param_type, bytewise=self._bytewise)
        wanted = self.outstanding.get(name)
        if wanted is None and name not in self.values:
            return
        self.values[name], self._types[name] = value, message.param_type
        if wanted is not None and wanted.value in (None, value):
            del self.outstanding[name]

    def due(self, system: int, now_us: int) -> list[Message]:
        """The requests to send now. A value that no message can hold, by the type reported now, is given up."""
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
