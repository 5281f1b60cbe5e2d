"""Print the result of a log verification, as text or JSON."""

from collections.abc import Iterable
from pathlib import Path

from rtshcua.app.logs import lasted_us
from rtshcua.app.pin import Pin
from rtshcua.app.wording import many, shorten, utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.gaps import seconds
from rtshcua.evidence.report import LogReport, LogVerdict, cosigned
from rtshcua.front.cli.render.claims import listed, write
from rtshcua.ground.audit.audit import Audit

#: the meaning of each kind of failure, by the first part of its slug
MEANINGS = {
    "log": "There is nothing to verify.",
    "genesis": "The beginning of the log is invalid, or belongs to another flight.",
    "record": "A line is damaged, or was not written by this program.",
    "chain": "The log was changed after it was written, or records were removed, added or moved.",
    "clock": "The recorded times contradict each other: records come from another log, or the clock failed.",
    "seal": "The records differ from the signed ones: they were changed by someone without the key of this epoch.",
    "close": "The end of the log was forged or damaged, or belongs to other records.",
    "trust": "The log may be valid, but it is not signed under the trust root that you pinned.",
    "decision": "The record does not follow from its own inputs: it was forged, or the onboard software is faulty.",
    "document": "A signed document was forged, or was accepted although it should have been refused.",
    "dispatch": "The vehicle was commanded without an earlier record of the permission.",
    "image": "The records about images contradict each other: one was added, removed or changed.",
    "preparation": "Autopilot parameters were set differently from their record, or at a forbidden time.",
    "frames": "The raw frames contain a command that is not in the log: it was sent without an earlier record.",
    "anchor": "A witness saw a different log: this one was rewritten or cut by a holder of its keys.",
    "attested": "The attestation of the boundary's home does not fit the log, or is not trusted.",
    "boundary": "The log contradicts what the enforcement boundary decided, accepted or sent, or lacks its signature.",
    "telemetry": "The raw frames file belongs to another flight. The log itself is valid.",
    "tail": "The log was cut, or the program stopped while it was writing. Later events are unknown.",
}
#: the meaning of findings that make a log incomplete
_SHORT = {
    "boundary": "According to the log, the enforcement boundary was lost in flight: the rest lacks its signature.",
    "anchor": "The log is complete, but witnesses did not see all of it: cosign it with `rtshcua witness`.",
    "close": "The program stopped before it closed the log, or the end was cut off. Later events are unknown.",
    "tail": MEANINGS["tail"],
    "trust": "The log is complete, but one of its keys was revoked later: the log may have been signed after that.",
}
#: the meaning of slugs that differ from their kind
_OF_SLUG = {
    "archive/changed": "The file was damaged or changed after it was added to the archive.",
    "archive/missing": "The file was moved or removed; the log itself may have been valid.",
    "close/junk-after": (
        "The signed log before it is valid and complete: the rest was added by padding of the file system, by a copy, "
        "or by somebody."
    ),
    "seal/missing": "The log was not signed in time, or a seal was removed: no recorded gap explains it.",
    "seal/gap": "The record of a gap contradicts the adjacent records: the log was written incorrectly.",
}
#: the remedy of a failure, by its slug
HELPS = {
    "archive/changed": "add a valid copy of the log with `rtshcua archive add`",
    "archive/missing": "add the log again with `rtshcua archive add`",
    "close/junk-after": "run `head -c BYTE LOG > COPY` with the byte at which the extra data begins; verify the copy",
    "trust/root-unknown-key": "if the flight used another trust root, name it or its public key with `--root`",
    "trust/root-revoked-key": "name the trust root of the flight with `--root` or `--revocations`",
    "trust/revoked-log-key": "name the anchors from before the revocation with `--anchors`",
    "trust/revoked-when": "name all trust roots in between with `--revocations`",
}

_SHOWN = 160
_TITLES = {
    LogVerdict.VERIFIED: ("VERIFIED", "bold green"),
    LogVerdict.INCOMPLETE: ("INCOMPLETE", "bold yellow"),
    LogVerdict.FAILED: ("FAILED", "bold red"),
}
_SIGNED = {"genesis", "seal", "recover", "close"}
_OUTCOMES = ("allow", "deny", "defer", "fallback")


def as_object(audit: Audit, path: Path, pinned: Pin, code: ExitCode) -> dict[str, object]:
    """Return the result as a JSON object. Members are only ever added."""
    report = audit.report
    genesis, close = report.genesis, report.close
    return {
        "log": str(path),
        "verdict": report.verdict.value,
        "exit_code": int(code),
        "pinned": {"key": pinned.key.hex(), "source": pinned.source},
        "records": report.records,
        "signed": report.sealed,
        "epochs": report.epochs,
        "anchored": report.anchored,
        "unanchored_tail": report.records - report.anchored,
        "witness_threshold": None if report.outside is None else report.outside.threshold,
        "witnesses": [
            {"name": each.name, "records": each.size + 1, "time_s": each.time_s}
            for each in (() if report.outside is None else report.outside.witnessed)
        ],
        "gaps": [gap._asdict() for gap in report.gaps],
        "counts": dict(report.counts),
        "failure": _finding(report.failure),
        "shortfall": _finding(report.shortfall),
        "flight": None
        if genesis is None
        else {
            "vehicle": genesis.vehicle,
            "mission": genesis.mission,
            "mode": genesis.mode,
            "boot": genesis.boot,
            "log_key": genesis.log_kid,
            "begun_utc_us": genesis.utc_us,
            "lasted_us": lasted_us(report, path),
            "ending": None if close is None else close.ending,
        },
        "root": report.root.hex(),
        "proven": [claim._asdict() for claim in report.proven],
        "unproven": [claim._asdict() for claim in report.unproven],
    }


def _finding(finding: Finding | None) -> dict[str, object] | None:
    if finding is None:
        return None
    return {**finding._asdict(), "line": finding.record + 1, "help": HELPS.get(finding.slug)}


def as_text(audit: Audit, path: Path, pinned: Pin, *, first: bool) -> None:
    """Print the result for a person."""
    report = audit.report
    lines: list[tuple[str, str]] = [] if first else [("", "")]
    lines += [("", f"log     {visible(str(path))}"), *_flight(report, path)]
    lines += [("", f"pinned  {visible(pinned.source)}"), ("", "")]
    title, style = _TITLES[report.verdict]
    finding = report.failure or report.shortfall
    if finding is None:
        lines.append((style, f"{title}  {many(report.records, 'record')}, closed and signed; {_anchored(report)}"))
        lines += [("yellow", f"  {_gapped(report)}")] if report.gaps else []
    else:
        lines.append((style, f"{title}  at record {finding.record}, line {finding.record + 1}: {finding.slug}"))
        lines += _why(finding, failed=report.failure is not None)
    lines += _counts(report)
    lines += listed("shown", "green", "+", report.proven) + listed("not shown", "yellow", "-", report.unproven)
    write(lines)


def _flight(report: LogReport, path: Path) -> list[tuple[str, str]]:
    genesis, close = report.genesis, report.close
    if genesis is None:
        return []
    seconds = lasted_us(report, path) / 1_000_000
    ending = f", {visible(close.ending)}" if close is not None else ""
    what = f"`{visible(genesis.mission)}` on `{visible(genesis.vehicle)}`, {utc(genesis.utc_us)}, {seconds:.1f} s"
    return [("", f"flight  {what}, mode {visible(genesis.mode)}{ending}")]


def _why(finding: Finding, *, failed: bool) -> Iterable[tuple[str, str]]:
    yield "", f"  {visible(finding.text)}"
    if finding.offset >= 0:
        yield "", f"  begins    at byte {finding.offset} of the log"
    if finding.expected:
        yield "", f"  expected  {shorten(visible(finding.expected), _SHOWN)}"
    if finding.found:
        yield "", f"  found     {shorten(visible(finding.found), _SHOWN)}"
    yield "", f"  {meaning_of(finding.slug, failed=failed)}"
    if finding.slug in HELPS:
        yield "", f"  help      {HELPS[finding.slug]}"


def _gapped(report: LogReport) -> str:
    """Return a line about the gaps of the log, their length, and the keys that signed them."""
    longest = max(gap.us for gap in report.gaps)
    both = all(gap.boundary is not None for gap in report.gaps)
    by = "the epoch keys and by the boundary" if both else "the epoch keys"
    if len(report.gaps) == 1:
        return f"gap of {seconds(longest)}, vouched for by {by}"
    return f"{len(report.gaps)} gaps, of {seconds(longest)} at most, vouched for by {by}"


def meaning_of(slug: str, *, failed: bool) -> str:
    """Return the meaning of a finding."""
    return _OF_SLUG.get(slug) or (MEANINGS if failed else _SHORT)[slug.partition("/")[0]]


def _anchored(report: LogReport) -> str:
    if not report.anchored:
        return (report.outside and cosigned(report.outside)) or "unanchored"
    tail = report.records - report.anchored
    return f"anchored but for the last {many(tail, 'record')}" if tail else "anchored to its end"


def _counts(report: LogReport) -> Iterable[tuple[str, str]]:
    counts = report.counts
    if not counts:
        return
    epochs = f", in {many(report.epochs, 'sealed epoch')}" if report.epochs else ""
    if set(counts) <= _SIGNED:
        yield "", f"  {many(report.records, 'record')}{epochs}; only signed records were read"
        return
    outcomes = ", ".join(f"{counts[name]} {name}" for name in _OUTCOMES if counts.get(name))
    decisions = f"{many(counts.get('decision', 0), 'decision')}{f' ({outcomes})' if outcomes else ''}"
    yield (
        "",
        f"  {many(report.records, 'record')} read: {decisions}, {many(counts.get('effect', 0), 'effect')}{epochs}",
    )
