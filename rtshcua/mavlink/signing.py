"""MAVLink 2 message signing, both ends, pure: https://mavlink.io/en/guide/message_signing.html ("the guide").

A signed frame has the bit `FLAG_SIGNED`, and 13 octets after its checksum: link id, timestamp, and the first 48
bits of SHA-256 over key, header, payload, checksum, link id and timestamp (guide, "Signature").

This module is stricter than pymavlink's own signing in two ways. Pymavlink stores a timestamp before it checks the
signature, so that a forged frame can lock out a stream for ever; and it stores nothing across a restart, so that
old frames can be replayed. `SigningState` is the stored state; `rtshcua.adapters.store.signing` stores it.
"""

import hashlib
import hmac
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS, SIGNATURE, with_flags

KEY_OCTETS: Final = 32
EPOCH_US: Final = 1_420_070_400_000_000  # 1 January 2015 in UTC us (guide, "Timestamp Handling")
UNIT_US: Final = 10
MINUTE: Final = 6_000_000
_SECOND: Final = 100_000
#: The distance, in timestamps, of frames signed ahead from those signed now: they stay valid for that long while
#: normal frames continue.
LEAD: Final = 3_000_000
#: The least interval between two batches, in us: an attacker who sends them raises time by `LEAD + MOST_AHEAD` a
#: second.
_LEADS_EVERY_US: Final = 1_000_000
#: The most timestamps reserved above `LEAD`, one per frame. A batch needs some hundreds.
MOST_AHEAD: Final = _SECOND
#: the same number as in the C library (MAVLINK_MAX_SIGNING_STREAMS)
MOST_STREAMS: Final = 16
#: Timestamps have 48 bits, until 2104; timestamps of the last year are refused, so that ours cannot run out.
LAST: Final = (1 << 48) - 366 * 24 * 60 * MINUTE

_TAG: Final = 6
_STAMP: Final = 6

Stream = tuple[int, int, int]
"""System id, component id, link id (guide, "Link IDs")."""


def timestamp_of(utc_us: int) -> int:
    """A UTC time as a timestamp: units of 10 us since the epoch."""
    return (utc_us - EPOCH_US) // UNIT_US


class SigningState(NamedTuple):
    """The state that must survive a restart: the local timestamp, and the last one of each received stream."""

    timestamp: int
    streams: Mapping[Stream, int]


@dataclass(slots=True)
class Counts:
    """How many frames were accepted, and the reasons of the refusals."""

    accepted: int = 0
    unsigned: int = 0
    forged: int = 0
    strayed: int = 0  # our own, or sent by its sender on another link than this one
    stale: int = 0
    crowded: int = 0  # correctly signed, of a stream for which there is no room
    unverified: int = 0  # accepted while nothing could verify them


class FrameVerifier(Protocol):
    """Verifies the origin of frames."""

    @property
    def counts(self) -> Counts:
        """How many frames were accepted, and the reasons of the refusals."""
        ...

    def accept(self, frame: bytes, now_us: int) -> bool:
        """Whether a frame with a correct checksum is accepted at a monotonic time."""
        ...


class SignedLink:
    """One link with a key: signs outgoing frames as `link`, and verifies incoming ones.

    `stored` is the state of the previous run. `utc_us` and `monotonic_us` are the present; after that only
    monotonic time counts, so that setting a clock back has no effect. `as_library`: behave as the C library of
    both autopilots (`mavlink_signature_check`): of a known stream every frame newer than the last one is accepted,
    a sender may sign on several links, and no stream is forgotten in favour of another.
    """

    def __init__(
        self,
        key: bytes,
        stored: SigningState,
        utc_us: int,
        monotonic_us: int,
        link: int = 0,
        *,
        as_library: bool = False,
    ) -> None:
        if len(key) != KEY_OCTETS:
            raise ValueError(f"a link key must have {KEY_OCTETS} octets, not {len(key)}")
        self._key = key
        self._link = link
        self._as_library = as_library
        # "The timestamp used on startup should be the maximum of the timestamp implied by the system clock and the
        # stored timestamp."
        self._ahead = max(timestamp_of(utc_us), stored.timestamp)
        self._since_us = monotonic_us - self._ahead * UNIT_US
        self._streams = dict(stored.streams)
        self._promised = 0  # the last timestamp of a frame that was signed ahead,
        self._promised_us = 0  # and when the batch began
        self._own: Stream | None = None
        recent = [stream for stream, last in stored.streams.items() if last >= self._ahead - MINUTE]
        self._heard_by = {stream[:2]: stream[2] for stream in sorted(recent, key=stored.streams.__getitem__)}
        self._counts = Counts()
        #: called when the stored state changes by more than the passing of time: a new stream, or a leap of the
        #: local time
        self.on_news: Callable[[], object] = lambda: None
        #: called with the stream and the timestamp of each frame that is accepted
        self.on_heard: Callable[[Stream, int], object] = lambda stream, timestamp: None

    @property
    def counts(self) -> Counts:
        return self._counts

    @property
    def state(self) -> SigningState:
        """The state to store. May be called by another thread than the one that signs."""
        return SigningState(max(self._ahead, self._promised), self._streams.copy())

    def sign(self, frame: bytes, now_us: int) -> bytes:
        """The signed frame for an unsigned one."""
        # "All timestamps generated must be at least 1 more than the previous timestamp sent."
        self._ahead = max(self._ahead + 1, self._clock(now_us))
        return self._signed_at(frame, self._ahead)

    def sign_ahead(self, frame: bytes, now_us: int) -> bytes | None:
        """The signed frame for use only when nothing more is signed: its timestamp is above all earlier ones, and
        `LEAD` to `LEAD + MOST_AHEAD` above those signed now. A later regular frame with a greater timestamp voids
        it. None if too many were signed ahead.
        """
        begins = max(self._ahead, self._clock(now_us)) + LEAD
        if self._promised >= begins + MOST_AHEAD:
            return None
        if not self._promised or now_us - self._promised_us >= _LEADS_EVERY_US:
            self._promised = max(self._promised, begins)
            self._promised_us = now_us
            self.on_news()
        self._promised += 1
        return self._signed_at(frame, self._promised)

    def _signed_at(self, frame: bytes, timestamp: int) -> bytes:
        signed = with_flags(frame, FLAG_SIGNED) + bytes([self._link]) + timestamp.to_bytes(_STAMP, "little")
        self._own = frame[5], frame[6], self._link
        return signed + self._tag(signed)

    def accept(self, frame: bytes, now_us: int) -> bool:
        """Whether a complete frame with a correct checksum is accepted at a monotonic time; only then is it
        remembered.
        """
        # 1. it is signed
        if not frame[FLAGS] & FLAG_SIGNED:
            self._counts.unsigned += 1
            return False
        # 2. "Computed 48 bit signature does not match": checked before any of its fields is used
        if not hmac.compare_digest(self._tag(frame[:-_TAG]), frame[-_TAG:]):
            self._counts.forged += 1
            return False
        # 3. it is not one of ours, sent back to us, nor one that its sender sent on another link: it signs there too,
        # and a frame overheard there would be accepted here for a minute
        stream = stream_of(frame)
        astray = not self._as_library and self._heard_by.get(stream[:2], stream[2]) != stream[2]
        if stream == self._own or astray:
            self._counts.strayed += 1
            return False
        # 4. "Timestamp is older than the previous packet from the same logical stream", or the same: a replay;
        #    "more than 1 minute (6,000,000) behind the local system's timestamp"
        timestamp = timestamp_in(frame)
        local = max(self._ahead, self._clock(now_us))
        last = self._streams.get(stream, -1)
        least = local - MINUTE if last < 0 or not self._as_library else 0
        if timestamp <= last or timestamp < least or timestamp > LAST:
            self._counts.stale += 1
            return False
        if not self._has_room(stream, local):
            self._counts.crowded += 1
            return False
        # 5. "the timestamp should be replaced by the timestamp of the incoming message if that is greater"
        is_news = stream not in self._streams or timestamp > local + _SECOND
        self._streams[stream] = timestamp
        self._heard_by[stream[:2]] = stream[2]
        self._ahead = max(self._ahead, timestamp)
        self._counts.accepted += 1
        self.on_heard(stream, timestamp)
        if is_news:
            self.on_news()
        return True

    def _clock(self, now_us: int) -> int:
        return (now_us - self._since_us) // UNIT_US

    def _tag(self, octets: bytes) -> bytes:
        return hashlib.sha256(self._key + octets).digest()[:_TAG]

    def _has_room(self, stream: Stream, local: int) -> bool:
        """A stream whose last frame is over a minute old needs no memory, because step 4 refuses the same frames
        without it. The number of senders is limited to that of streams.
        """
        streams, heard_by, sender = self._streams, self._heard_by, stream[:2]
        if self._as_library:
            return stream in streams or len(streams) < MOST_STREAMS
        if stream not in streams and len(streams) >= MOST_STREAMS:
            streams = self._streams = {each: last for each, last in streams.items() if last >= local - MINUTE}
        if sender not in heard_by and len(heard_by) >= MOST_STREAMS:
            recent = {each for each, last in streams.items() if last >= local - MINUTE}
            heard_by = self._heard_by = {each: link for each, link in heard_by.items() if (*each, link) in recent}
        in_streams = stream in streams or len(streams) < MOST_STREAMS
        return in_streams and (sender in heard_by or len(heard_by) < MOST_STREAMS)


def stream_of(frame: bytes) -> Stream:
    """The stream of a signed frame."""
    return frame[5], frame[6], frame[-SIGNATURE]


def timestamp_in(frame: bytes) -> int:
    """The timestamp of a signed frame."""
    return int.from_bytes(frame[-_TAG - _STAMP : -_TAG], "little")
