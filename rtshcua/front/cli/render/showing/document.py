"""A signed document for a flight under way, in words: who says what about which step. Nothing is verified here."""

from rtshcua.app.telling.document_prose import body_told, said
from rtshcua.app.wording import utc
from rtshcua.front.cli.render.showing.page import TextPage, named
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Parameter
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.step_number import step_words
from rtshcua.onboard.calls import quantity
from rtshcua.wire import names
from rtshcua.wire.approval import ApprovalDocument
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
    page.row("says", body_told(what.body))
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
