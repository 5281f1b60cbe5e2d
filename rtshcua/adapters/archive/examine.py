"""Verify the logs of an archive in any process: octets, trust, records, seals, anchors."""

import errno
import os
from base64 import b64decode
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from hashlib import file_digest
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple, Protocol

from distributed import Client
from msgspec.structs import replace

from rtshcua.adapters.archive.entry import AUDIT, FAILED, ArchiveEntry, StepRecords, VerifiedLog
from rtshcua.adapters.store.logs import read_anchors
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.verification import follow
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.records import AnyRecord, Effect, Genesis
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.ground.audit.audit import Audit, Auditor
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.calls import call
from rtshcua.wire import cose, names
from rtshcua.wire.bundle import Bundle, envelopes, parse
from rtshcua.wire.replacement import ReplacementDocument
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.untrusted import Untrusted

_END = 1 << 62
#: octets of logs below which no processes are started
_LITTLE = 4 << 20


class Task(NamedTuple):
    """A log to verify: its path, its anchors, its row so far, and the pinned root key."""

    path: Path
    entry: ArchiveEntry
    pinned: bytes


def examine(task: Task) -> VerifiedLog:
    """Verify a log. Returns a row for any content; raises OSError where it cannot be read."""
    entry = task.entry
    replacements: list[Effect] = []
    last = b""

    def take(line: bytes, record: AnyRecord) -> None:
        nonlocal last
        last = line
        if isinstance(record, Effect) and record.event == "replacement":
            replacements.append(record)

    with open_regular(task.path, task.path.parents[3]) as file:  # the archive's folder: see `Folder`
        found = file_digest(file, "sha256").hexdigest()
        if found != entry.log:
            text = "the file in the archive was changed after it was added"
            return _failed(entry, Finding("archive/changed", 0, text, found, entry.log))
        file.seek(0)
        auditor = Auditor(task.pinned, derive=entry.checked == AUDIT, anchors=read_anchors(task.path))
        audit = follow(file, auditor, take)
    report, described = audit.report, _described(entry, audit)
    if report.failure is not None:
        return _failed(described, report.failure)
    assert audit.basis is not None
    described = replace(
        _with_finding(described, report.verdict.value, report.shortfall),
        records=report.records,
        indexed=report.records if report.verdict is LogVerdict.VERIFIED else report.sealed,
        anchored=report.anchored,
        recoveries=report.counts.get("recover", 0),
        last_leaf=leaf_hash(last).hex(),
        root=report.root.hex(),
    )
    assert report.genesis is not None
    return VerifiedLog(described, _steps(entry.log, audit.basis.bundle, report.genesis, replacements))


def missing(entry: ArchiveEntry) -> VerifiedLog:
    """The result for a log that is no longer in the archive."""
    text = "the log was removed from the archive"
    return _failed(entry, Finding("archive/missing", 0, text, "no file", entry.log))


def _described(entry: ArchiveEntry, audit: Audit) -> ArchiveEntry:
    """The row with the log's description of its flight, if the pinned root vouches for its beginning."""
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


def _lasted_us(report: LogReport) -> int | None:
    """The duration; unknown after a recover, where monotonic time restarts."""
    if report.genesis is None or report.counts.get("recover", 0):
        return None
    return report.last_us - report.genesis.at_us


def _failed(entry: ArchiveEntry, finding: Finding) -> VerifiedLog:
    """The row of an invalid log, which is not indexed; its description of the flight stays if that part was trusted."""
    return VerifiedLog(_with_finding(entry, FAILED, finding))


def _with_finding(entry: ArchiveEntry, status: str, finding: Finding | None) -> ArchiveEntry:
    if finding is None:
        return replace(entry, status=status)
    return replace(entry, status=status, finding=finding.slug, finding_record=finding.record, finding_text=finding.text)


# --------------------------------------------------- the skills of the steps and links of a log


def _steps(log: str, bundle: Bundle, genesis: Genesis, replacements: Sequence[Effect]) -> tuple[StepRecords, ...]:
    """The steps and links of a verified log, each for the records in which its mission was in force. `bundle` is that
    of the log, with or without later replacements.
    """
    missions = [(0, bundle.mission)]
    if replacements:
        mission = cose.unverified(envelopes(b64decode(genesis.bundle))[1]).payload
        missions = [(0, parse(names.MISSION, mission, Mission))]
    for record in replacements:
        replaced = _replacing(missions[-1][1], record)
        if replaced is not None:
            missions.append((record.seq, replaced))
    ends = [first for first, _ in missions[1:]] + [_END]
    return tuple(
        StepRecords(log, first, until, *row)
        for (first, mission), until in zip(missions, ends, strict=True)
        for row in _rows(bundle.policy, mission)
    )


def _replacing(mission: Mission, record: Effect) -> Mission | None:
    """The mission after a recorded replacement; None where the record is invalid, which an audit reports."""
    try:
        said = parse(names.REPLACEMENT, cose.unverified(b64decode(record.detail)).payload, ReplacementDocument)
    except (Untrusted, ValueError):
        return None
    kept = max(said.kept, 0)
    return replace(said.mission, invocations=(*mission.invocations[:kept], *said.mission.invocations[kept:]))


def _rows(policy: Policy, mission: Mission) -> Iterator[tuple[int, int, int, str, str]]:
    yield from _links(CONTINGENCY_LINK, -1, policy.contingency, policy)
    for number, step in enumerate(mission.invocations):
        yield STEP, number, -1, _skill(policy, step.skill), call(policy, step)
        yield from _links(FALLBACK_LINK, number, step.contract.fallback, policy)


def _links(kind: int, step: int, chain: tuple[Link, ...], policy: Policy) -> Iterator[tuple[int, int, int, str, str]]:
    for number, link in enumerate(chain):
        yield kind, step, number, _skill(policy, link.skill), link.text


def _skill(policy: Policy, index: int) -> str:
    return policy.contracts[index].name if 0 <= index < len(policy.contracts) else ""


# ------------------------------------------------------------------------------------------ verifying processes


class LogVerifiers(Protocol):
    """Verifies logs; the results come in the order of the tasks."""

    def examine(self, tasks: Sequence[Task]) -> Iterator[VerifiedLog]:
        """Verifies these logs."""

    def close(self) -> None:
        """Release its resources."""


class VerifierProcesses:
    """One process for each core, or `jobs`; they start with the first work that is large enough."""

    def __init__(self, jobs: int | None = None) -> None:
        self._jobs = jobs or _cores()
        self._pool: ProcessPoolExecutor | None = None

    def examine(self, tasks: Sequence[Task]) -> Iterator[VerifiedLog]:
        """Verify these logs, the largest first."""
        if self._jobs == 1 or len(tasks) == 1 or (self._pool is None and sum(t.entry.bytes for t in tasks) < _LITTLE):
            return map(examine, tasks)
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self._jobs, mp_context=get_context("spawn"))
        return self._pool.map(examine, tasks)

    def close(self) -> None:
        """End the processes."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


def _cores() -> int:
    """The number of cores for this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class SchedulerWorkers:
    """The workers of a scheduler at an address like `tcp://10.0.0.1:8786`. Raises OSError where there is none."""

    def __init__(self, address: str) -> None:
        try:
            self._client = Client(address, timeout=10)
        except (OSError, ValueError):
            raise OSError(errno.EHOSTUNREACH, "no cluster answered", address) from None

    def examine(self, tasks: Sequence[Task]) -> Iterator[VerifiedLog]:
        """Verify these logs; a log whose worker is lost is given to another."""
        futures = self._client.map(examine, tasks, pure=False)
        yield from self._client.gather(futures)

    def close(self) -> None:
        """Disconnect from the cluster."""
        self._client.close()
