"""What a verification says: what was proven, what was not, and the first record that fails."""

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.records import Close, Genesis


class Verdict(Enum):
    """`VERIFIED`: whole up to a signed close. `INCOMPLETE`: sound as far as it goes. `FAILED`: not to be believed."""

    VERIFIED = "verified"
    INCOMPLETE = "incomplete"
    FAILED = "failed"


class Report(NamedTuple):
    """The verification of one log.

    `records` is how many were sound, `counts` how many of each kind: record types, and outcomes of the decisions.
    `failure` is the first record that fails; `shortfall` says why a log without failure is incomplete. `root` is the
    RFC 9162 root over the sound records (for a closed log, the signed one); `last_us` the last record's monotonic time.
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

    @property
    def verdict(self) -> Verdict:
        """The whole in one word."""
        if self.failure is not None:
            return Verdict.FAILED
        return Verdict.VERIFIED if self.shortfall is None else Verdict.INCOMPLETE


def claims(
    records: int, genesis: Genesis | None, close: Close | None, failure: Finding | None
) -> tuple[tuple[Claim, ...], tuple[Claim, ...]]:
    """What the chain of `records` sound records proves, and what it does not, whoever holds the keys."""
    if failure is not None:
        text = f"a log that fails proves nothing, neither about record {failure.record} nor about those around it"
        return (), (Claim("log", text),)
    first = "record 0 is" if records == 1 else f"records 0 to {records - 1} are"
    chain = Claim("chain", f"{first} whole, in order, and follow one another without a gap")
    if genesis is None or close is None:
        text = "no signed close: whatever was cut off the end, or rewritten from any record on, cannot be seen"
        return (chain,), (Claim("signed-close", text),)
    text = f"closed and signed by log key {genesis.log_kid}: nothing was changed, added or taken out since"
    anchor = "unanchored: no witness outside holds this log's root, so the log key's holder could have written it anew"
    return (chain, Claim("signed-close", text)), (Claim("anchor", anchor),)
