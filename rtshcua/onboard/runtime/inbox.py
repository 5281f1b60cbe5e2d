"""Documents on their way to the boundary, and what its receipts change in the run.

The boundary alone says what is to be trusted. What it accepted is recorded whole, so that an audit can verify it again;
what it refused is recorded by its slug, and no more often than `REFUSED_EVERY_US`.
"""

from base64 import b64encode
from typing import Final

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Ending, Presented, Reply
from rtshcua.onboard.runtime.conduct import Conduct
from rtshcua.onboard.runtime.flight import Stage
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.wire import names
from rtshcua.wire.document import kind_of
from rtshcua.wire.receipt import APPROVAL, RECALL, UNKNOWN, Receipt, decode
from rtshcua.wire.request import STEP, Ref
from rtshcua.wire.untrusted import Untrusted

#: how often a refused document leaves a record, in us: whoever floods the vehicle must not fill its disk
REFUSED_EVERY_US: Final = 1_000_000


class Inbox:
    """Presents documents to the boundary, in the order in which they came."""

    def __init__(self, conduct: Conduct, journal: Journal) -> None:
        self._conduct = conduct
        self._journal = journal
        self._refused_us: int | None = None
        self._unrecorded = 0

    def take(self, now: Now, event: Presented) -> None:
        """Present one document, act on what became of it, and answer."""
        receipt = self._present(now, event.document)
        if receipt.accepted:
            self._accepted(now, receipt, event.document)
        else:
            self._refused(now, receipt)
        self._journal.add(Reply(event.sender, receipt.slug, receipt.text))

    def _present(self, now: Now, document: bytes) -> Receipt:
        conduct = self._conduct
        if conduct.stage is Stage.FALLING and not _recalls(document):
            return Receipt(UNKNOWN, "falling-back", "the mission is over: the vehicle falls back")
        receipt = decode(conduct.loaded.boundary.present(document, now, conduct.queue.released))
        return Receipt(UNKNOWN, "unanswered", receipt.text) if isinstance(receipt, Refusal) else receipt

    def _accepted(self, now: Now, receipt: Receipt, document: bytes) -> None:
        conduct = self._conduct
        conduct.fresh = True
        envelope = b64encode(document).decode()
        if receipt.kind == APPROVAL:
            self._journal.effect(now, "approval", Ref(STEP, receipt.step, -1), detail=envelope)
            conduct.admission.answered(receipt, now)
        elif receipt.kind == RECALL:
            self._journal.effect(now, "recall", detail=envelope)
            conduct.call_back(now, Ending.RECALLED)
        else:
            self._journal.effect(now, "replacement", Ref(STEP, receipt.step, -1), detail=envelope)
            conduct.replaced(receipt.step)

    def _refused(self, now: Now, receipt: Receipt) -> None:
        at_us = now.monotonic_us
        if self._refused_us is not None and at_us - self._refused_us < REFUSED_EVERY_US:
            self._unrecorded += 1
            return
        more = f" ({self._unrecorded} before it were refused too)" if self._unrecorded else ""
        self._refused_us, self._unrecorded = at_us, 0
        self._journal.effect(now, "document-refused", detail=f"{receipt.slug}: {receipt.text}{more}")


def _recalls(document: bytes) -> bool:
    try:
        return kind_of(document) is names.RECALL
    except Untrusted:
        return False
