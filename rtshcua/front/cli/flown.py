"""How long a flight is known to have lasted: what a recovery added later, by another clock, does not count."""

from pathlib import Path

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.report import LogReport

_RECOVER = b',"type":"recover"'


def lasted_us(report: LogReport, log: Path) -> int:
    """From the first record of a verified log to the last one that the flight wrote, in us."""
    assert report.genesis is not None
    last_us = report.last_us
    if report.failure is None and report.counts.get("recover"):
        last_us = _before_recovery_us(log, last_us)
    return last_us - report.genesis.at_us


def _before_recovery_us(log: Path, otherwise_us: int) -> int:
    before = b""
    with open_regular(log) as file:
        for line in lines(file):
            if _RECOVER in line:
                break
            before = line
    record = read(before)
    return otherwise_us if isinstance(record, Flaw) else record.at_us
