"""A signed document for a flight under way, in words: who says what about which step. Nothing is verified here."""

from base64 import b64decode
from typing import NamedTuple

from rtshcua.app.wording import utc
from rtshcua.front.cli.render.showing.page import TextPage, named
from rtshcua.front.cli.render.showing.people import NOBODY, People
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Parameter
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.struct import Flat
from rtshcua.model.step_number import step_words
from rtshcua.onboard.calls import quantity
from rtshcua.wire import cose, names
from rtshcua.wire.approval import ApprovalDocument
from rtshcua.wire.bundle import parse_unverified
from rtshcua.wire.cancellation import CancellationDocument
from rtshcua.wire.document import kind_of
from rtshcua.wire.names import Artefact
from rtshcua.wire.recall import RecallDocument
from rtshcua.wire.replacement import ReplacementDocument
from rtshcua.wire.untrusted import Untrusted

#: how each kind is handed to a flight
HANDED_IN = {
    names.APPROVAL: "`rtshcua approve --to` hands one to a flight",
    names.RECALL: "`rtshcua recall --to` hands one to a flight",
    names.REPLACEMENT: "`rtshcua replace` hands it to a flight under way",
    names.CANCELLATION: "`cancel` of `rtshcua mcp` hands one to a flight",
}
_NAMES = {
    names.APPROVAL: "approval", names.RECALL: "recall", names.REPLACEMENT: "replacement",
    names.CANCELLATION: "cancellation",
}  # fmt: skip
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
        return f"{_body(self.body)}; by {people.signer(self.kid)}"


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


def kind_of_document(data: bytes) -> Artefact | None:
    """Return the kind of a document; None if the bytes are not a document."""
    try:
        return kind_of(data)
    except Untrusted:
        return None


def show_document(page: TextPage, data: bytes) -> dict[str, object]:
    """Add a document to the page, and return it as JSON. Raises `Untrusted`."""
    what = said(data)
    kind = _NAMES[what.kind]
    page.head(f"{kind.capitalize()} of {len(data)} bytes (not verified: the flight does that)")
    page.row("says", _body(what.body))
    page.row("signed by", f"key {what.kid.hex()}")
    match what.body:
        case ApprovalDocument() as answer:
            page.row("vehicle", answer.vehicle)
            page.row("flight", answer.flight.hex())
            page.row("mission", answer.mission.hex())
            page.row("step's id", answer.invocation_id.hex())
            page.row("issued", utc(answer.issued_at_us))
        case RecallDocument() as recall:
            page.row("vehicle", recall.vehicle)
            page.row("flight", recall.flight.hex() or "any")
            page.row("issued", utc(recall.issued_at_us))
        case ReplacementDocument() as newer:
            page.row("flight", newer.flight.hex())
            page.row("supersedes", newer.supersedes.hex())
            for step in newer.mission.invocations:
                page.row("stays" if step.step < newer.kept else "new", f"{step_words(step.step)} {_called(step)}")
        case CancellationDocument() as cancelled:
            page.row("flight", cancelled.flight.hex())
            page.row("issued", utc(cancelled.issued_at_us))
    page.row("use", HANDED_IN[what.kind])
    return {"kind": kind, "verified": False, "key": what.kid.hex(), "text": what.text, "said": named(what.body)}


def _called(one: Invocation) -> str:
    """A step as it is bound, by its own contract, for the policy is not here: a zone by its number there."""
    told = (f"{each.name} = {_argument(each, one.arguments)}" for each in one.contract.parameters)
    return f"{one.contract.name}({', '.join(told)})"


def _argument(parameter: Parameter, cells: tuple[int, ...]) -> str:
    values = cells[parameter.cell : parameter.cell + (2 if parameter.kind == PLACE else 1)]
    if parameter.kind == PLACE and len(values) == 2:
        return f"{quantity(values[0], 'length')} east and {quantity(values[1], 'length')} north of home"
    if parameter.kind == PLACE or not values:
        return "missing"
    if parameter.kind == CHOICE and 0 <= values[0] < len(parameter.labels):
        return parameter.labels[values[0]]
    return f"zone {values[0]}" if parameter.kind == ZONE else quantity(values[0], parameter.dimension)


def _body(body: Flat) -> str:
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
