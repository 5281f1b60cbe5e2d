"""Verifies the documents of a log (approvals, recalls, replacements, cancellations) as of the time of their receipt."""

from typing import Final

from rtshcua.decision.session import Session
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import Effect
from rtshcua.model.flat.situation import Now
from rtshcua.wire import cose
from rtshcua.wire.receipt import APPROVAL, CANCELLATION, RECALL, REPLACEMENT
from rtshcua.wire.trust import TrustRoot

#: the documents of a flight, by the event that records one
DOCUMENT_KINDS: Final = {
    "approval": APPROVAL, "recall": RECALL, "replacement": REPLACEMENT, "cancellation": CANCELLATION,
}  # fmt: skip


class DocumentAudit:
    """Verifies the documents that a log records as accepted. `counts` has their number by kind, and `people` the
    persons of the trust root who signed them, in order.
    """

    def __init__(self, session: Session, root: TrustRoot) -> None:
        self._session = session
        self._persons = {key.kid: key.person for key in root.keys if key.person}
        self.people: dict[str, list[str]] = {kind: [] for kind in DOCUMENT_KINDS}
        self.counts = dict.fromkeys(DOCUMENT_KINDS, 0)

    def check(self, record: Effect) -> Flaw | None:
        """Return a flaw if an effect is a document that is not valid, else None."""
        kind = DOCUMENT_KINDS.get(record.event)
        if kind is None:
            return None
        document = octets(record.detail)
        if document is None:
            return Flaw("document/base64", f"the {record.event} is not canonical base64")
        now = Now(record.at_us, record.utc_us, record.utc_error_us)
        receipt = self._session.take(document, now)
        if not receipt.accepted:
            return Flaw(f"document/{receipt.slug}", f"the {record.event} is not trusted: {receipt.text}")
        if receipt.kind != kind or receipt.step != record.step:
            return Flaw("document/other", f"the document is not the {record.event} that its record names")
        self.counts[record.event] += 1
        person, people = self._persons.get(cose.unverified(document).kid), self.people[record.event]
        if person is not None and person not in people:
            people.append(person)
        return None
