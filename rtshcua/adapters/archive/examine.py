"""The verification of one log of an archive, in whatever process: octets, trust, records, seals, anchors."""

import gc
from hashlib import file_digest, sha256
from pathlib import Path
from typing import BinaryIO, NamedTuple

from msgspec.structs import replace

from rtshcua.adapters.archive.entry import AUDIT, FAILED, Entry, Examined
from rtshcua.adapters.archive.steps import Steps
from rtshcua.adapters.files.anchors import read_anchors
from rtshcua.adapters.files.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.report import Report, Verdict
from rtshcua.ground.auditor.audit import Audit, Auditor

_BLOCK = 1 << 16


class Task(NamedTuple):
    """A log to verify: where it lies, its anchors beside it; its row as far as it is known; the pinned root key."""

    path: Path
    entry: Entry
    pinned: bytes


def examine(task: Task) -> Examined:
    """Verifies a log. Whatever it holds, the answer is a row; OSError where it cannot be read."""
    entry = task.entry
    with open_regular(task.path) as file:
        found = file_digest(file, "sha256").hexdigest()
        if found != entry.log:
            text = "the file in the archive is not the one that was taken in: it was changed where it lies"
            return _failed(entry, Finding("archive/changed", 0, text, found, entry.log))
        file.seek(0)
        audit, steps = _audit(file, task)
        report, described = audit.report, _described(entry, audit)
        if report.failure is not None:
            return _failed(described, report.failure)
        last = _last_line(file)
    assert audit.basis is not None
    finding = report.shortfall
    described = replace(
        described,
        status=report.verdict.value,
        finding=None if finding is None else finding.slug,
        finding_record=None if finding is None else finding.record,
        finding_text=None if finding is None else finding.text,
        records=report.records,
        indexed=report.records if report.verdict is Verdict.VERIFIED else report.sealed,
        anchored=report.anchored,
        recoveries=report.counts.get("recover", 0),
        last_leaf=sha256(b"\0" + last).hexdigest(),
        root=report.root.hex(),
    )
    return Examined(described, steps.all(entry.log, audit.basis.bundle))


def missing(entry: Entry) -> Examined:
    """What comes of a log that does not lie in the archive any more."""
    text = "the archive does not have the log any more: it was taken away from where it lay"
    return _failed(entry, Finding("archive/missing", 0, text, "no file", entry.log))


def _audit(file: BinaryIO, task: Task) -> tuple[Audit, Steps]:
    auditor = Auditor(task.pinned, derive=task.entry.checked == AUDIT, anchors=read_anchors(task.path))
    steps = Steps()
    enabled = gc.isenabled()
    gc.disable()  # nothing here makes cycles, and looking for them costs a tenth
    try:
        for line in lines(file):
            if not auditor.take(line):
                break
            steps.follow(line)
    finally:
        if enabled:
            gc.enable()
    return auditor.audit(), steps


def _described(entry: Entry, audit: Audit) -> Entry:
    """The row with what the log says of its flight, if the pinned root vouches for its beginning."""
    report, genesis = audit.report, audit.report.genesis
    if genesis is None or audit.basis is None:
        return entry
    bundle = audit.basis.bundle
    return replace(
        entry,
        vehicle=genesis.vehicle,
        boot=genesis.boot,
        mission=genesis.mission,
        mode=genesis.mode,
        policy=bundle.policy.name,
        policy_version=bundle.policy.version,
        policy_digest=bundle.policy_digest.hex(),
        bundle_digest=bundle.digest.hex(),
        log_key=genesis.log_kid,
        begun_us=genesis.utc_us,
        lasted_us=_lasted_us(report),
        ending=None if report.close is None else report.close.ending,
        before=genesis.before,
    )


def _lasted_us(report: Report) -> int | None:
    """Monotonic time begins anew at a recover: then nobody knows."""
    if report.genesis is None or report.counts.get("recover", 0):
        return None
    return report.last_us - report.genesis.at_us


def _failed(entry: Entry, finding: Finding) -> Examined:
    """Nothing of such a log is indexed; what it said of its flight stays, where that much was to be trusted."""
    return Examined(
        replace(
            entry,
            status=FAILED,
            finding=finding.slug,
            finding_record=finding.record,
            finding_text=finding.text,
        )
    )


def _last_line(file: BinaryIO) -> bytes:
    """The last whole line of a log that verified."""
    size, length = file.seek(0, 2), _BLOCK
    while True:
        start = max(0, size - length)
        file.seek(start)
        tail = file.read()
        end = tail.rfind(b"\n")
        before = tail.rfind(b"\n", 0, max(end, 0))
        if before >= 0 or not start:
            return tail[before + 1 : end + 1]
        length *= 4
