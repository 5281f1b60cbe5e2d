"""Recalls: a person's signed order to bring a vehicle home. A recall ends a mission and starts none.

It names one mission by its digest and the flight by its id, or all flights under one policy. The key must have
duty `approval`, and the root must allow it to act in person on this vehicle, in any role.
"""

from collections.abc import Collection

from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.struct import Flat
from rtshcua.wire import names
from rtshcua.wire.document import (
    DocumentError,
    check_flight,
    check_key,
    check_times,
    check_vehicle,
    open_document,
    sign_document,
)
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import HUMAN, TrustRoot


class RecallDocument(Flat, frozen=True):
    """The content that a person signs: `flight` and `mission`, or `policy` for all flights under it; the others are
    empty.

    Times are UTC, us.
    """

    vehicle: str
    flight: bytes
    mission: bytes
    policy: bytes
    issued_at_us: int
    expires_at_us: int


def sign_recall(recall: RecallDocument, key: SigningKey) -> bytes:
    """The signed document. Raises `WrongDuty` for a key of another duty."""
    return sign_document(names.RECALL, recall, key, Duty.APPROVAL)


def open_recall(
    document: bytes,
    *,
    root: TrustRoot,
    vehicle: str,
    flight: bytes,
    missions: Collection[bytes],
    policy: bytes,
    issued_at_us: int,
    now: Now,
) -> RecallDocument:
    """The recall in a document, if it is trusted now, for a flight of `missions` (the first one and its replacements)
    under the policy of that digest.

    A recall of a whole policy does not apply to a mission that was issued (`issued_at_us`) after it. Raises
    `DocumentError`: its own slugs are `wrong-vehicle`, `wrong-source`, `key-expired`, `other-flight`,
    `other-mission`, `other-policy`, `before-mission`; and `EnvelopeError`, `BundleError` and `ArtefactError`.
    """
    said, opened = open_document(document, names.RECALL, RecallDocument, Duty.APPROVAL, root, now)
    if bool(said.mission) == bool(said.policy) or bool(said.mission) != bool(said.flight):
        raise DocumentError("malformed", "a recall must name either a mission with its flight, or a policy")
    check_vehicle(said.vehicle, vehicle)
    check_key(opened.key, vehicle, now)
    if HUMAN not in opened.key.sources:
        raise DocumentError("wrong-source", f"key {opened.key.kid.hex()} is not authorised to act in person")
    check_times(said.issued_at_us, said.expires_at_us, now)
    if said.flight:
        check_flight(said.flight, flight)
    if said.mission and said.mission not in missions:
        raise DocumentError("other-mission", "the recall is for a mission that does not fly")
    if said.policy and said.policy != policy:
        raise DocumentError("other-policy", "the recall is for another policy than the one in force")
    if said.policy and said.issued_at_us < issued_at_us:
        raise DocumentError("before-mission", "the recall of the policy is older than this mission")
    return said
