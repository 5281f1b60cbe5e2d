"""The service `verify-log`: verify a log and the files beside it under a pinned root key."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.verification import Progress, VerificationInputs, verify_carefully, verify_quickly
from rtshcua.app.autopilot_bindings import roots_of, with_bindings, with_unread_bindings
from rtshcua.app.fly.simulated_flight import with_simulated
from rtshcua.app.sidecar_files import (
    FrameListener,
    RawFrames,
    anchors_beside,
    bundle_beside,
    raw_frames,
    with_summary,
    with_unread,
)
from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.records import AnyRecord, Effect
from rtshcua.evidence.report import LogReport, LogVerdict, cosigned
from rtshcua.ground.audit.audit import Audit
from rtshcua.ground.audit.revoked_keys import RevokedKeys
from rtshcua.onboard.runtime.dispatcher import UNCONFIRMED
from rtshcua.wire.request import STEP

_MOST = 5


class VerifyRequest(NamedTuple):
    """The pinned root key, the trust roots with later revocations, further notes of witnesses, the depth of the
    verification, the number of processes, and whether the log must be anchored to its end.
    """

    key: bytes
    roots: tuple[bytes, ...] = ()
    anchors: tuple[Path, ...] = ()
    audit: bool = False
    derive: bool = True
    fast: bool = False
    jobs: int = 0
    anchored: bool = False


def verify_log(
    path: Path, request: VerifyRequest, progress: Progress, each: Callable[[AnyRecord], None] = lambda _: None,
    heard: Callable[[], FrameListener | None] = lambda: None,
) -> Audit:  # fmt: skip
    """Verify a log and the files beside it. An audit passes each valid record to `each`, and the raw frames that it
    reads to what `heard` returns once it reads the first. Raises OSError.
    """
    raw = raw_frames(path, heard)
    unconfirmed = UnconfirmedFallbacks()

    def take(record: AnyRecord) -> None:
        unconfirmed.take(record)
        each(record)

    audit = audited(path, request, progress, take, raw)
    report = audit.report
    if raw is not None:
        followed = request.audit and request.derive
        report = raw.unread(report) if request.fast else raw.judged(report, followed=followed)
        raw.close()
    report = with_summary(_required(report) if request.anchored else report, path)
    report = unconfirmed.told(with_unread(with_simulated(report, path), path))
    if request.fast:
        report = with_unread_bindings(report, path)
    elif audit.basis is not None:
        report = with_bindings(report, path, roots_of(audit.basis.root, request.roots))
    return audit._replace(report=report)


def audited(
    path: Path,
    request: VerifyRequest,
    progress: Progress = lambda _: None,
    each: Callable[[AnyRecord], None] = lambda _: None,
    raw: RawFrames | None = None,
) -> Audit:
    """Verify a log without its other files; an audit passes each valid record to `each`. Raises OSError."""
    inputs = VerificationInputs(request.key, bundle_beside(path), anchors_beside(path, request.anchors))
    revoked = RevokedKeys(request.roots)

    def take(record: AnyRecord) -> None:
        each(record)
        revoked.take(record)

    if not request.audit:
        return revoked.judged(verify_quickly(path, inputs, fast=request.fast, jobs=request.jobs, progress=progress))
    frames = raw.frames if raw is not None and request.derive else None
    found = verify_carefully(path, inputs, derive=request.derive, frames=frames, each=take, progress=progress)
    return revoked.judged(found)


def _required(report: LogReport) -> LogReport:
    """Add a shortfall to the report if the log is not anchored to its end."""
    if report.verdict is not LogVerdict.VERIFIED or report.anchored == report.records:
        return report
    text = "witnesses did not cosign the log to its end, as `--anchored` requires"
    few = "" if report.outside is None else cosigned(report.outside)
    found, expected = f"{report.anchored} records{few and f', the rest {few}'}", f"{report.records} records"
    return report._replace(shortfall=Finding("anchor/missing", report.anchored, text, found, expected))


class UnconfirmedFallbacks:
    """Collects the unconfirmed fallbacks of an audited log, and adds them to the report."""

    def __init__(self) -> None:
        self._records: list[int] = []

    def take(self, record: AnyRecord) -> None:
        """Take a valid record."""
        if isinstance(record, Effect) and record.kind > STEP and record.detail == UNCONFIRMED:
            self._records.append(record.seq)

    def told(self, report: LogReport) -> LogReport:
        """Add the unconfirmed fallbacks to the report of a log without failure."""
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
