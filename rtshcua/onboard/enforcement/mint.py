"""The mint: makes permits under the session key, each with a serial of its own."""

from typing import Final

from rtshcua.wire.permit import Permit, seal
from rtshcua.wire.request import STEP, Ref

#: how often a standing permit lets the last link of the contingency be sent again: landing twice harms nothing, and
#: nothing else is left to a vehicle whose boundary does not answer any more
AGAIN: Final = 16


class Mint:
    """Seals permits. Only a boundary has one, and only what decides calls it."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._serial = 1

    def step(self, step: int, not_after_us: int, fallbacks: int, contingencies: int) -> bytes:
        """A step's permit, which stands for so many links of its chain and of the contingency too."""
        serial = self._serial
        self._serial += 1 + fallbacks + contingencies + AGAIN
        return seal(Permit(STEP, step, -1, serial, fallbacks, contingencies, not_after_us), self._key)

    def link(self, ref: Ref, not_after_us: int) -> bytes:
        """A permit for a link that was just decided; the `link` of a degrade rule's target is `-1 - rule`."""
        kind, step, number = ref
        serial = self._serial
        self._serial += 1
        return seal(Permit(kind, step, number, serial, 0, 0, not_after_us), self._key)
