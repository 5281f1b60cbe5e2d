"""The ports to what must outlive a run: the evidence, and which missions were opened. Part of `ports`."""

from enum import StrEnum
from typing import Protocol

from rtshcua.onboard.frozen import Frozen


class EvidenceSink(Protocol):
    """Where evidence lines go, in their order. It takes them over and never makes the caller wait for the disk."""

    @property
    def kept(self) -> int:
        """How many lines, from the first on, are written: they survive the death of this process."""
        ...

    @property
    def synced(self) -> int:
        """How many lines, from the first on, are on the disk: they survive a loss of power."""
        ...

    def append(self, line: bytes, durability: int) -> int:
        """Take one line over, of a class of `evidence.durability`; it is written, or on the disk, once `kept`, or
        `synced`, reaches the number that is given back.

        Raises OSError when the line could not be written at once, or when more wait than may. It is not lost by that:
        the chain needs it, and it is written as soon as the disk takes it.
        """
        ...

    def trouble(self) -> str | None:
        """Why lines that were taken over are not kept, each failure told once; None while nothing went wrong."""
        ...

    def late(self) -> str | None:
        """That a line was not on the disk within the time promised for its class, told once; None while all are."""
        ...

    def close(self) -> None:
        """Flush and close. Waits for the disk, but not for ever."""
        ...


class EvidenceFailed(Frozen, frozen=True):
    """An event: the evidence sink cannot take records any more (disk full, I/O error), or not in time."""

    at_us: int
    reason: str


class EvidenceKept(Frozen, frozen=True):
    """An event: after `EvidenceFailed`, the sink took everything again. All that was given to it is written, and what
    was given up to the failure is on the disk.
    """

    at_us: int


class Opening(StrEnum):
    """What became of opening a mission on a vehicle."""

    OPENED = "opened"
    REPLAYED = "replayed"  # opened before, also by a run that crashed; or it might have been
    OLD_POLICY = "old-policy"  # a higher version of its policy was in force there


class ReplayStore(Protocol):
    """Which missions were opened on this vehicle, and the versions of their policies: on disk before any flies."""

    def open_once(self, digest: bytes, expires_us: int, now_utc_us: int, policy: str, version: int) -> Opening:
        """Open the mission of this digest, under a version of a policy."""
        ...
