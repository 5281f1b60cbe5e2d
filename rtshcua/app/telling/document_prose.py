"""A signed document for a flight under way, in words: who says what about which step. Nothing is verified here."""

from base64 import b64decode
from typing import NamedTuple

from rtshcua.app.telling.people import NOBODY, People
from rtshcua.app.wording import utc
from rtshcua.model.flat.struct import Flat
from rtshcua.model.step_number import step_words
from rtshcua.wire import cose, names
from rtshcua.wire.approval import ApprovalDocument
from rtshcua.wire.bundle import parse_unverified
from rtshcua.wire.cancellation import CancellationDocument
from rtshcua.wire.document import kind_of
from rtshcua.wire.names import Artefact
from rtshcua.wire.recall import RecallDocument
from rtshcua.wire.replacement import ReplacementDocument
from rtshcua.wire.untrusted import Untrusted

_SHAPES: dict[Artefact, type[Flat]] = {
    names.APPROVAL: ApprovalDocument,
    names.RECALL: RecallDocument,
    names.REPLACEMENT: ReplacementDocument,
    names.CANCELLATION: CancellationDocument,
}


class Said(NamedTuple):
    """What a document says, and the key that it says signed it."""

    kind: Artefact
    kid: bytes
    body: Flat

    @property
    def text(self) -> str:
        """One line: the answer, who gives it, and until when it is good."""
        return self.told(NOBODY)

    def told(self, people: People) -> str:
        """The same, by whom among these people."""
        return f"{body_told(self.body)}; by {people.signer(self.kid)}"


def said(document: bytes) -> Said:
    """Parse a document without verifying it. Raises `Untrusted`."""
    kind = kind_of(document)
    envelope = cose.unverified(document)
    return Said(kind, envelope.kid, parse_unverified(kind, envelope.payload, _SHAPES[kind]))


def recorded(detail: str, people: People = NOBODY) -> str:
    """What a document in a log says, in one line, and who signed it; what is wrong where it makes no sense."""
    try:
        return said(b64decode(detail, validate=True)).told(people)
    except (ValueError, Untrusted):
        return "the document is malformed"


def body_told(body: Flat) -> str:
    """What the body of a document says, in one line."""
    match body:
        case ApprovalDocument(granted=granted, role=role, expires_at_us=until):
            return f"{'granted' if granted else 'refused'} as {role}, good until {utc(until)}"
        case RecallDocument(mission=mission, policy=policy, expires_at_us=until):
            whom = f"the mission {mission.hex()}" if mission else f"all under the policy {policy.hex()}"
            return f"calls home {whom}, good until {utc(until)}"
        case ReplacementDocument(mission=mission, kept=kept):
            return f"`{mission.name}`, {len(mission.invocations)} steps, new from {step_words(kept)}"
        case CancellationDocument(mission=mission, expires_at_us=until):
            return f"cancels the mission {mission.hex()}, good until {utc(until)}"
        case _:
            return ""
