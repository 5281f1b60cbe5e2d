"""The report of a verification: what was proven, what was not, and the first record with a flaw."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from enum import Enum
from typing import NamedTuple

from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.gaps import RecordGap, told
from rtshcua.evidence.records import Close, Genesis
from rtshcua.evidence.seal_verification import Recoveries
from rtshcua.evidence.witnessing.anchors import AnchoredExtent

_LAST_S = 253_402_300_799  # the end of the year 9999
_NONE = Recoveries()


class LogVerdict(Enum):
    """`VERIFIED`: complete up to a signed close. `INCOMPLETE`: correct as far as it goes. `FAILED`: not to be
    trusted.
    """

    VERIFIED = "verified"
    INCOMPLETE = "incomplete"
    FAILED = "failed"


class LogReport(NamedTuple):
    """The verification of one log.

    `records` is the number of correct records, `counts` the number of each kind: record types, and outcomes of the
    decisions. `failure` is the first flaw; `shortfall` says why a log without a flaw is incomplete. `root` is the
    RFC 9162 root over the correct records; `last_us` the last record's monotonic time. `sealed` counts the records
    up to the last signature, in `epochs` epochs; `anchored` those that the threshold of witnesses has cosigned.
    `outside` is what all witnesses saw, of a log without a flaw; `gaps` are the times without records.
    """

    records: int
    counts: Mapping[str, int]
    failure: Finding | None
    shortfall: Finding | None
    genesis: Genesis | None
    close: Close | None
    last_us: int
    root: bytes
    proven: tuple[Claim, ...]
    unproven: tuple[Claim, ...]
    sealed: int = 0
    epochs: int = 0
    anchored: int = 0
    outside: AnchoredExtent | None = None
    gaps: tuple[RecordGap, ...] = ()

    @property
    def verdict(self) -> LogVerdict:
        """The verdict."""
        if self.failure is not None:
            return LogVerdict.FAILED
        return LogVerdict.VERIFIED if self.shortfall is None else LogVerdict.INCOMPLETE


def claims(
    records: int, sealed: int, epochs: int, genesis: Genesis | None, close: Close | None, failure: Finding | None,
    recoveries: Recoveries = _NONE,
) -> tuple[tuple[Claim, ...], tuple[Claim, ...]]:  # fmt: skip
    """What the chain of `records` correct records proves, and what it does not; `sealed` of them are signed for."""
    if failure is not None:
        text = (
            f"a log that fails verification proves nothing, neither about record {failure.record} nor about the others"
        )
        return (), (Claim("log", text),)
    assert genesis is not None
    chain = Claim("chain", f"{_span(0, records)} intact, in order, and follow{_s(records)} one another without a gap")
    seals = Claim("seals", f"{_span(0, sealed)} signed for, in {epochs} sealed epoch{'' if epochs == 1 else 's'}")
    if close is None:
        text = "no signed close: a removal of records from the end cannot be detected"
        unproven = [Claim("signed-close", text)]
        if records > sealed:
            text = f"{_span(sealed, records)} chained but not yet signed for: anyone could have rewritten them"
            unproven.append(Claim("seals", text))
        return (chain, seals), (*unproven, unanchored(records, 0))
    text = (
        f"closed and signed by log key {genesis.log_kid} and the keys of the epochs after it: nobody "
        "without the log key, or the epoch keys of the time, changed, added or removed a "
        f"record{_loose(recoveries)}"
    )
    return (chain, seals, Claim("signed-close", text)), (unanchored(records, 0),)


def _loose(recoveries: Recoveries) -> str:
    """The records that no key covered before a recovery."""
    if not recoveries.crashes:
        return ""
    many = f"{recoveries.unsigned} record{'' if recoveries.unsigned == 1 else 's'}"
    return f"; except {many}, unsigned when the log broke off, and the data after them"


def unsealed(recoveries: Recoveries) -> tuple[Claim, ...]:
    """What is not proven of a recovered log."""
    crashes = recoveries.crashes
    if not crashes:
        return ()
    after = "a crash" if crashes == 1 else f"{crashes} crashes"
    text = (
        f"recovered after {after}: that the last records before it (unsigned then: "
        f"{recoveries.unsigned}) are unchanged, and that no others followed them (discarded: "
        f"{recoveries.discarded} octets)"
    )
    return (Claim("recovered", text),)


def with_anchors(report: LogReport, anchored: AnchoredExtent) -> LogReport:
    """A report without a flaw, with what witnesses saw of its log."""
    count = min(anchored.records, report.records)
    unproven = tuple(claim for claim in report.unproven if claim.slug != "anchor")
    if count < report.records:
        unproven = (unanchored(report.records, count, anchored), *unproven)
    if anchored.rejected:
        unproven = (*unproven, rejected(anchored))
    proven = report.proven
    if count:
        saw = [seen for seen in anchored.witnessed if seen.size + 1 >= count]
        text = f"{_span(0, count)} as seen by {_list([f'`{seen.name}`' for seen in saw])}"
        when = max(seen.time_s for seen in saw)
        proven = (*proven, Claim("anchor", f"{text}, outside of the vehicle, {utc_of(when)}"))
    return report._replace(anchored=count, proven=proven, unproven=unproven, outside=anchored)


def with_boundary(report: LogReport, signed: Mapping[int, int]) -> LogReport:
    """A report without a flaw, with the gaps for which the boundary signed too, by the numbers of their records."""
    gaps = tuple(gap._replace(boundary=signed.get(gap.record)) for gap in report.gaps)
    unproven = (*(claim for claim in report.unproven if claim.slug != "gap"), *map(told, gaps))
    return report._replace(gaps=gaps, unproven=unproven)


def rejected(anchored: AnchoredExtent) -> Claim:
    """The claim that is not proven because notes of witnesses are damaged or forged."""
    many = "1 note" if anchored.rejected == 1 else f"{anchored.rejected} notes"
    text = f"{many} of witnesses, damaged or forged and ignored: {anchored.first}"
    return Claim("anchor/signature", text)


def cosigned(anchored: AnchoredExtent) -> str:
    """How many of the witnesses cosigned more than what is anchored, as text; empty if none did."""
    if not anchored.ahead:
        return ""
    return f"cosigned by {len(anchored.ahead)} of {anchored.threshold} required witnesses"


def utc_of(time_s: int) -> str:
    """A moment in seconds since the Unix epoch, for a person."""
    if time_s > _LAST_S:
        return f"{time_s} s after the Unix epoch"
    return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=time_s)).strftime("%Y-%m-%d %H:%M:%SZ")


def unanchored(records: int, anchored: int, outside: AnchoredExtent | None = None) -> Claim:
    """What is not proven because only the first `anchored` of `records` records are held by witnesses. `outside` says
    whether too few witnesses cosigned some of the others.
    """
    tail = f"unanchored tail: {records - anchored} record{'' if records - anchored == 1 else 's'}"
    since = "the beginning" if not anchored else f"record {anchored - 1}"
    few = "no witness holds them"
    if outside is not None and outside.ahead:
        end = min(outside.ahead[0].size + 1, records)
        few = f"{_span(anchored, end)} {cosigned(outside)}"
    text = f"{tail}: {few}; a holder of the log key, or of the keys since {since}, could have removed or rewritten them"
    return Claim("anchor", text)


def _span(first: int, end: int) -> str:
    return f"record {first} is" if end - first == 1 else f"records {first} to {end - 1} are"


def _s(count: int) -> str:
    return "s" if count == 1 else ""


def _list(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
