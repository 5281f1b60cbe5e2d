"""What was sent home or down without word of a landing, in the summary of a run and in that of an audit."""

from rtshcua.evidence.finding import Claim
from rtshcua.evidence.records import AnyRecord, Effect
from rtshcua.evidence.report import LogReport
from rtshcua.onboard.runtime.dispatcher import UNCONFIRMED
from rtshcua.wire.request import STEP

_MOST = 5


def is_unconfirmed(kind: int, detail: str) -> bool:
    """Whether this is how an effect on a link, not on a step, says that no landing was seen."""
    return kind > STEP and detail == UNCONFIRMED


class UnconfirmedFallbacks:
    """Takes the records of a log that is audited, and adds to the report which fallbacks were not confirmed."""

    def __init__(self) -> None:
        self._records: list[int] = []

    def take(self, record: AnyRecord) -> None:
        """One sound record."""
        if isinstance(record, Effect) and is_unconfirmed(record.kind, record.detail):
            self._records.append(record.seq)

    def told(self, report: LogReport) -> LogReport:
        """The report of a log without failure, with what is not shown."""
        if not self._records or report.failure is not None:
            return report
        many = len(self._records)
        which = ", ".join(map(str, self._records[:_MOST])) + (f" and {many - _MOST} more" if many > _MOST else "")
        what = (
            f"the fallback that ended at record {which}"
            if many == 1
            else f"{many} fallbacks, ended at records {which},"
        )
        claim = Claim("fallback", f"that {what} brought the vehicle down: {UNCONFIRMED}")
        return report._replace(unproven=(*report.unproven, claim))
