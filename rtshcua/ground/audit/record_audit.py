"""Checks the meaning of a log's records: each decision follows from its inputs, and each command from a record."""

from rtshcua.decision.session import Session
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import AnyRecord, DecisionRecord, Effect
from rtshcua.ground.audit.decisions import DecisionAudit
from rtshcua.ground.audit.dispatches import DispatchCover, DispatchOrder, is_withdrawn, ref_words
from rtshcua.ground.audit.documents import DocumentAudit
from rtshcua.ground.audit.frames import FrameAudit
from rtshcua.ground.audit.preparations import ListedParameters
from rtshcua.ground.audit.trust import Basis

UNENFORCED = "none"


class RecordAudit:
    """Checks the records of one log after its genesis, in order. Its memory is bounded by the bundle."""

    def __init__(self, basis: Basis, mode: str, frames: FrameAudit | None = None) -> None:
        self.mode = mode
        self._frames = frames
        if frames is not None:
            frames.begin(basis)
        self.derived = 0
        session = self._session = Session(basis.in_force, enforced=mode != UNENFORCED)
        self._deriver = DecisionAudit(basis, session)
        self._documents = DocumentAudit(session, basis.root)
        self._cover = DispatchCover()
        self.preparations = ListedParameters()
        self._turns = DispatchOrder(basis)

    @property
    def dispatches(self) -> int:
        """The number of commands that were sent."""
        return self._cover.dispatches

    @property
    def documents(self) -> dict[str, int]:
        """The number of verified documents by kind."""
        return self._documents.counts

    @property
    def people(self) -> dict[str, list[str]]:
        """The names in the trust root of those who signed documents, by kind."""
        return self._documents.people

    def check(self, record: AnyRecord) -> Flaw | None:
        """Return a flaw in the next record, or None."""
        if isinstance(record, DecisionRecord):
            return self._decided(record)
        if isinstance(record, Effect):
            return self._happened(record)
        return None

    def _decided(self, record: DecisionRecord) -> Flaw | None:
        if record.mode != self.mode:
            text = "the mode of the decision is not that of the log's beginning"
            return Flaw("decision/mode", text, record.mode, self.mode)
        flaw = self._deriver.check(record)
        if flaw is None:
            self.derived += 1
            self._cover.decided(record)
        return flaw

    def _happened(self, record: Effect) -> Flaw | None:
        flaw = self._documents.check(record) or self.preparations.check(record)
        if flaw is None and self.mode != UNENFORCED:
            self._cover.recalled = self._documents.counts["recall"] > 0
            self._cover.cancelled = self._documents.counts["cancellation"] > 0
            flaw = self._cover.check(record) or self._turns.check(record)
            if flaw is None and is_withdrawn(record):
                flaw = self._withdrawn(record)
        if flaw is None and self._frames is not None:
            self._frames.happened(record, self.preparations.listed)
        return flaw

    def _withdrawn(self, record: Effect) -> Flaw | None:
        flaw = self._turns.withdrawn(record)
        if flaw is None and not self._session.give_back(record.step):
            text = "a step was withdrawn that is not the last admitted one"
            flaw = Flaw("dispatch/was-sent", text, ref_words(record.ref))
        if flaw is None:
            self._cover.withdrawn(record)
        return flaw
