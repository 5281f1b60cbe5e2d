"""Our end of the link: what came, once it proved to be the vehicle's, and what leaves, once the boundary let it."""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle.company import Company
from rtshcua.adapters.vehicle.flavour import Message
from rtshcua.codec.frames import Codec, Received
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.mavlink.signing import Verifier
from rtshcua.onboard.enforcement.frames import OURS, Gate
from rtshcua.onboard.ports import Event

#: what we call ourselves before we know whose system we belong to; nothing is sent under it
_NOBODY: Final = 255
#: what the boundary learns of the vehicle from
_OBSERVED: Final = ("HEARTBEAT", "GLOBAL_POSITION_INT")


class Heard(NamedTuple):
    """What a datagram brought: events, frames that answer it, and its good frames, for the raw log."""

    events: Sequence[Event]
    answers: Sequence[bytes]
    frames: Sequence[Received]


class Link:
    """Frames in and out. There is no other way out than through `frames`, the boundary's gate.

    `verifier` holds the link's key, if it has one: what is not signed with it is dropped. With a `system`, nobody else
    is heard from the beginning.
    """

    def __init__(self, frames: Gate, verifier: Verifier | None = None, system: int | None = None) -> None:
        self._frames = frames
        self._verifier = verifier
        self._named = system is not None
        self._company: Company | None = None
        self._begun = False
        self._codec = Codec(_NOBODY, OURS, only=None if system is None else {system}, verifier=verifier)

    def settle(self, system: int) -> None:
        """From now on be part of this system, and hear nobody else."""
        self._codec = Codec(system, OURS, only={system}, verifier=self._verifier)
        self._company = Company(system, self._verifier, named=self._named)

    def begin(self) -> None:
        """The flight begins: from now on nothing is made of other vehicles."""
        self._begun = True

    @property
    def crowd(self) -> str | None:
        """Another vehicle that was heard on the link before the flight, in words."""
        return None if self._company is None else self._company.found

    def overhear(self, datagram: bytes, now_us: int) -> None:
        """Take in a datagram of another sender than the vehicle's."""
        if self._company is not None and not self._begun:
            self._company.hear(datagram, now_us, elsewhere=True)

    def parse(self, datagram: bytes, now_us: int) -> list[Received]:
        """The good frames in a datagram, in order; never raises, whatever the bytes."""
        received: list[Received] = []
        if self._company is not None and not self._begun:
            self._company.hear(datagram, now_us, elsewhere=False)
        for each in self._codec.parse(datagram, now_us):
            if each.component == OURS:
                continue  # what comes back under our own name says nothing of the vehicle
            received.append(each)
            if each.name in _OBSERVED:
                self._frames.observe(unsigned(each.frame))
            elif each.name == "RADIO_STATUS" and not each.signed and isinstance(self._verifier, UnsignedRadio):
                self._verifier.temper(each.message, now_us)
        return received

    def pack(self, send: Iterable[Message], now_us: int) -> tuple[list[bytes], list[Refusal]]:
        """The frames that may be sent, and why others may not."""
        frames: list[bytes] = []
        refused: list[Refusal] = []
        for message in send:
            sealed = self._frames.seal(self._codec.pack(message), now_us)
            if isinstance(sealed, Refusal):
                refused.append(sealed)
            else:
                frames.append(sealed)
        return frames, refused
