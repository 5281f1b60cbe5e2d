"""Our end of the link: what came, once it proved to be the vehicle's, and what leaves, once the boundary let it."""

from collections.abc import Iterable
from typing import Final

from rtshcua.adapters.vehicle.flavour import Message
from rtshcua.mavlink.frames import Codec, Received, Verifier
from rtshcua.mavlink.framing import unsigned
from rtshcua.mavlink.radio import UnsignedRadio
from rtshcua.onboard.enforcement.frames import OURS, FrameRefusal, Gate

#: what we call ourselves before we know whose system we belong to; nothing is sent under it
_NOBODY: Final = 255
#: what the boundary learns of the vehicle from
_OBSERVED: Final = ("HEARTBEAT", "GLOBAL_POSITION_INT")


class Link:
    """Frames in and out. There is no other way out than through `frames`, the boundary's gate.

    `verifier` holds the link's key, if it has one: what is not signed with it is dropped.
    """

    def __init__(self, frames: Gate, verifier: Verifier | None = None) -> None:
        self._frames = frames
        self._verifier = verifier
        self._codec = Codec(_NOBODY, OURS, verifier=verifier)

    def settle(self, system: int) -> None:
        """From now on be part of this system, and hear nobody else."""
        self._codec = Codec(system, OURS, only={system}, verifier=self._verifier)

    def parse(self, datagram: bytes, now_us: int) -> list[Received]:
        """The good frames in a datagram, in order; never raises, whatever the bytes."""
        # what comes back under our own name says nothing of the vehicle
        received = [each for each in self._codec.parse(datagram, now_us) if each.component != OURS]
        for each in received:
            if each.name in _OBSERVED:
                self._frames.observe(unsigned(each.frame))
            elif each.name == "RADIO_STATUS" and not each.signed and isinstance(self._verifier, UnsignedRadio):
                self._verifier.temper(each.message, now_us)
        return received

    def pack(self, send: Iterable[Message], now_us: int) -> tuple[list[bytes], list[FrameRefusal]]:
        """The frames that may be sent, and why others may not."""
        frames: list[bytes] = []
        refused: list[FrameRefusal] = []
        for message in send:
            sealed = self._frames.seal(self._codec.pack(message), now_us)
            if isinstance(sealed, FrameRefusal):
                refused.append(sealed)
            else:
                frames.append(sealed)
        return frames, refused
