"""The boundary's signature over its own evidence: who signs, and what is kept of one session for the next.

In mode `software` the key is in this process, and so in reach of whoever takes it over.
"""

from hashlib import sha256

from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire import boundary_chain
from rtshcua.wire.boundary_chain import BoundaryChain, Tag
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.statement import Statement, sign


class Attestation:
    """Signs how far one boundary's chain got. Nothing is signed before it has begun, or without a key."""

    def __init__(self, chain: BoundaryChain, flight: bytes, bundle: bytes, *, enforced: bool) -> None:
        self._chain = chain
        self._flight = flight
        self._bundle = sha256(bundle).digest()
        self._enforced = enforced
        self._key: BoundaryKey | None = None
        self._signs: SigningKey | None = None

    @property
    def digest(self) -> bytes:
        """The digest to keep for the next session, 32 octets."""
        return self._chain.digest

    def begin(self, key: BoundaryKey | None) -> int | None:
        """The flight's log begins: the number of the session, None without a key. Raises RuntimeError for a second
        time: a chain has one beginning.
        """
        if self._key is not None:
            raise RuntimeError("the boundary's session has begun already")
        if key is None or key.key is None:
            return None
        self._key, self._signs = key, key.key
        payload = boundary_chain.begin(key.session, key.before, self._flight, self._bundle, enforced=self._enforced)
        self._chain.add(Tag.BEGIN, payload)
        return key.session

    def statement(self, now: Now, *, final: bool = False) -> bytes | None:
        """A signed statement at a moment, None without a key or after the final one. After that nothing is dispatched,
        and no frame leaves that moves the vehicle: else an end could be signed before the end. The boundary shares the
        runtime's clock.
        """
        key, chain = self._key, self._chain
        if key is None or self._signs is None or chain.over:
            return None
        chain.over = final
        said = Statement(
            self._flight, key.session, key.before, chain.count, chain.digest, chain.marks(), chain.frames, chain.left,
            chain.repeated, chain.declined, chain.stopped, chain.ahead, chain.aside,
            ClockSource.SHARED, now.monotonic_us, now.utc_us, now.utc_error_us, final,
        )  # fmt: skip
        return sign(said, self._signs)
