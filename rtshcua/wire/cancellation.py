"""Cancellations: a proposer's signed order to stop its mission, after which the vehicle returns by the contingency.

A cancellation names the flight by its id and one of its missions by its digest. It does not say where the vehicle
goes: the policy's contingency does. The key must have duty `mission`, and the root must allow it to propose every
step that is cancelled.
"""

from collections.abc import Collection

from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.struct import Flat
from rtshcua.wire import names
from rtshcua.wire.bundle import Bundle
from rtshcua.wire.document import DocumentError, check_flight, check_key, check_times, open_document, sign_document
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.replacement import check_set_aside
from rtshcua.wire.trust import TrustRoot


class CancellationDocument(Flat, frozen=True):
    """The content that a mission key signs: the mission of that digest ends in this flight. Times are UTC, us."""

    flight: bytes
    mission: bytes
    issued_at_us: int
    expires_at_us: int


def sign_cancellation(said: CancellationDocument, key: SigningKey) -> bytes:
    """The signed document. Raises `WrongDuty` for a key of another duty."""
    return sign_document(names.CANCELLATION, said, key, Duty.MISSION)


def open_cancellation(
    document: bytes,
    *,
    root: TrustRoot,
    vehicle: str,
    flight: bytes,
    missions: Collection[bytes],
    bundle: Bundle,
    current: int,
    now: Now,
) -> CancellationDocument:
    """The cancellation in a document, if it is trusted now, for a flight of `missions` (the first one and its
    replacements), of which `bundle` is in force. It cancels the steps from `current` on.

    Raises `DocumentError`: its own slugs are `wrong-vehicle`, `key-expired`, `other-flight`, `other-mission`;
    `BundleError` for a key that may not propose a cancelled step; `EnvelopeError` and `ArtefactError`.
    """
    said, opened = open_document(document, names.CANCELLATION, CancellationDocument, Duty.MISSION, root, now)
    check_key(opened.key, vehicle, now)
    check_times(said.issued_at_us, said.expires_at_us, now)
    check_flight(said.flight, flight)
    if said.mission not in missions:
        raise DocumentError("other-mission", "the cancellation is for a mission that does not fly")
    check_set_aside(opened.key, bundle, current)
    return said
