"""Statements: the boundary's signature over its own evidence (`boundary_chain`) so far, and whether it ends there.

A COSE_Sign1 by a key of duty `boundary`, around an artefact whose body is the fields below in their order.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Final

import msgspec

from rtshcua.model.flat.situation import Now
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.boundary_chain import MARK_BYTES, MOST_MARKS
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.digest import DIGEST_BYTES
from rtshcua.wire.document import FLIGHT_BYTES
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.untrusted import Untrusted

#: the largest statement, in octets
MAX_STATEMENT: Final = 2048


class StatementError(Untrusted):
    """A statement that is refused: `malformed`."""


class Statement(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """The boundary's evidence at one moment of a flight (its id, 16 octets).

    `session` counts the sessions of one boundary, 0 if unknown; `before` is the last digest of the previous
    session, 32 zero octets if there is none. `digest` is the digest after `count` entries, and `marks` the first
    octets of the digests after each entry since the previous statement, of the first `MOST_MARKS` of them. `left`
    is the digest of the `frames` that carry out commands, `aside` that of what is only counted: `repeated`
    answers, `declined` documents, `stopped` frames, and frames signed `ahead`. `source` (`wire.clock`) is the
    source of the boundary's time of day, and the next three are its reading at the statement: monotonic, UTC, and
    the greatest error of the latter, in us. Nothing follows a `final` statement.
    """

    flight: bytes
    session: int
    before: bytes
    count: int
    digest: bytes
    marks: bytes
    frames: int
    left: bytes
    repeated: int
    declined: int
    stopped: int
    ahead: int
    aside: bytes
    source: int
    at_us: int
    utc_us: int
    utc_error_us: int
    final: bool

    @property
    def now(self) -> Now:
        """The moment of the statement, by the boundary's own clock."""
        return Now(self.at_us, self.utc_us, self.utc_error_us)


def counted(said: Statement) -> tuple[int, int, int, int, int]:
    """The counters of a statement, which only grow, besides its entries."""
    return said.frames, said.repeated, said.declined, said.stopped, said.ahead


def sign(statement: Statement, key: SigningKey) -> bytes:
    """The signed statement. Raises `WrongDuty`."""
    payload = artefact.pack(names.STATEMENT, statement)
    return cose.sign1(payload, key=key, duty=Duty.BOUNDARY, content_type=names.STATEMENT.content_type)


def claimed(data: bytes) -> Statement:
    """The content of an unverified statement. Raises as `open_statement`."""
    return _read(cose.unverified(data, limit=MAX_STATEMENT).payload)


def open_statement(data: bytes, keys: Mapping[bytes, VerificationKey]) -> Statement:
    """The statement that one of the keys (by `kid`) signed. Raises `EnvelopeError`, `ArtefactError` and
    `StatementError`.
    """
    opened = cose.open1(
        data, keys=keys, duty=Duty.BOUNDARY, content_type=names.STATEMENT.content_type, limit=MAX_STATEMENT
    )
    return _read(opened.payload)


@lru_cache(maxsize=1)  # an audit that also tells the flight reads each statement twice in a row
def _read(payload: bytes) -> Statement:
    said = artefact.unpack(names.STATEMENT, payload, Statement, StatementError, "statement of a boundary")
    digests = {len(said.before), len(said.digest), len(said.left), len(said.aside)}
    numbers = (said.session, said.count, *counted(said), said.at_us, said.utc_us, said.utc_error_us)
    fits = len(said.marks) % MARK_BYTES == 0 and len(said.marks) <= MARK_BYTES * MOST_MARKS
    if len(said.flight) != FLIGHT_BYTES or digests != {DIGEST_BYTES} or not fits:
        raise StatementError("malformed", "a flight, digest or mark has the wrong length")
    if min(numbers) < 0 or not 0 <= said.source <= max(ClockSource):
        raise StatementError("malformed", "a number is out of range")
    return said
