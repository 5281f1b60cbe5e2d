"""The documents of a log (approvals, recalls, replacements, cancellations): each is verified again, as of when it came,
before it counts.
"""

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
    """Follows the documents that a log says were accepted. `counts` has how many there were of each kind, and `people`
    who of the trust root's persons signed some of each, in the order in which they did.
    """

    def __init__(self, session: Session, root: TrustRoot) -> None:
        self._session = session
        self._persons = {key.kid: key.person for key in root.keys if key.person}
        self.people: dict[str, list[str]] = {kind: [] for kind in DOCUMENT_KINDS}
        self.counts = dict.fromkeys(DOCUMENT_KINDS, 0)

    def check(self, record: Effect) -> Flaw | None:
        """What is wrong with an effect, if it is a document."""
        kind = DOCUMENT_KINDS.get(record.event)
        if kind is None:
            return None
        document = octets(record.detail)
        if document is None:
            return Flaw("document/base64", f"the {record.event} is not canonical base64")
        now = Now(record.at_us, record.utc_us, record.utc_error_us)
        receipt = self._session.take(document, now)
        if not receipt.accepted:
            return Flaw(f"document/{receipt.slug}", f"the {record.event} was not to be trusted: {receipt.text}")
        if receipt.kind != kind or receipt.step != record.step:
            return Flaw("document/other", f"the document is not the {record.event} that its record says it is")
        self.counts[record.event] += 1
        person, people = self._persons.get(cose.unverified(document).kid), self.people[record.event]
        if person is not None and person not in people:
            people.append(person)
        return None
