"""Evidence before effect: nothing was dispatched without an earlier record that permits it (design 4.5, 6)."""

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.records import DecisionRecord, Effect
from rtshcua.ground.audit.named import ref_words
from rtshcua.model.step_number import step_words
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP, Ref

DISPATCHED = "dispatched"


class Cover:
    """Follows permits through a log. What is kept is bounded by the steps and links of the bundle.

    An `allow` covers one dispatch of what it was asked for, up to its `valid_until_us`. The `allow` of a step covers
    the links of its fallback chain and of the contingency too: these are standing permits.
    """

    def __init__(self) -> None:
        self.recalled = False  # no step may be sent any more,
        self.cancelled = False  # nor then
        self.dispatches = 0
        self._until_us: dict[Ref, int] = {}
        self._standing: set[int] = set()

    def decided(self, record: DecisionRecord) -> None:
        """Takes note of a decision that was derived again."""
        key = record.ref
        if record.outcome != "allow":
            self._until_us.pop(key, None)
            return
        self._until_us[key] = record.valid_until_us
        if record.kind == STEP:
            self._standing.add(record.step)

    def withdrawn(self, record: Effect) -> None:
        """Takes note of a step of which nothing was sent: its permit is good for nothing any more."""
        self._until_us.pop(record.ref, None)
        self._standing.discard(record.step)

    def check(self, record: Effect) -> Flaw | None:
        """What is wrong with an effect, or None."""
        if record.event != DISPATCHED:
            return None
        self.dispatches += 1
        if self.recalled and record.kind == STEP:
            return Flaw("dispatch/recalled", "a step was sent after the mission was recalled", step_words(record.step))
        if self.cancelled and record.kind == STEP:
            return Flaw(
                "dispatch/cancelled", "a step was sent after the mission was cancelled", step_words(record.step)
            )
        until_us = self._until_us.pop(record.ref, None)
        if until_us is not None:
            if record.at_us <= until_us or self._stands(record):
                return None
            text = "it was sent when its permit was over"
            return Flaw("dispatch/late", text, f"{record.at_us} us", f"at most {until_us} us")
        if self._stands(record):
            return None
        text = "it was sent without an earlier record that permits it"
        return Flaw("dispatch/not-permitted", text, ref_words(record.ref))

    def _stands(self, record: Effect) -> bool:
        if record.kind == FALLBACK_LINK:
            return record.step in self._standing and record.link != DEGRADE
        return record.kind == CONTINGENCY_LINK and bool(self._standing)
