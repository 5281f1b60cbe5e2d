"""How the audit of a log is told: to a person, and as JSON."""

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

#: what a kind of failure means to whoever must act on it, by the first part of its slug
MEANINGS = {
    "log": "There is nothing to verify.",
    "genesis": "The beginning of the log is not what this program writes, or belongs to another flight.",
    "record": "A line was damaged or written by something else: it is not what this program writes.",
    "chain": "The log was changed after it was written, or records were taken out, added or moved.",
    "clock": "The recorded times contradict each other: records were put together from elsewhere, or the clock failed.",
    "seal": "What stands here is not what was signed: it was changed by someone who did not hold the key of the time.",
    "close": "The end of the log was forged or damaged: it is not the end of these records.",
    "trust": "Not trusted here: the log may be sound in itself, but it does not rest on the root that you trust.",
    "decision": "The record does not follow from its own inputs: it was forged, or the onboard software is faulty.",
    "document": "What somebody signed for the flight was forged, or taken in where it should have been refused.",
    "dispatch": "The vehicle was commanded without the permission that the log should show first.",
    "preparation": "Parameters of the autopilot were set otherwise than their record says, or when they may not be.",
    "frames": "The raw frames show a command that the log does not: it went out without a record before it.",
    "anchor": "A witness outside saw another log: this one was rewritten or cut, by someone who held its keys.",
    "boundary": "The enforcement boundary decided, accepted or sent something else, or did not sign that it did this.",
    "telemetry": "The raw frames beside the log are not those of this flight. The log itself is sound.",
    "tail": "The log was cut, or the program stopped while it wrote. What came after is not known.",
}
#: the same, of what makes a log incomplete
_SHORT = {
    "boundary": "The enforcement boundary was lost in flight, says who wrote the log: it signed nothing of the rest.",
    "anchor": "The log is whole, and witnesses outside did not see all of it: `rtshcua witness` cosigns it.",
    "close": "The program stopped before it closed the log, or its end was cut off. What came after is not known.",
    "tail": MEANINGS["tail"],
    "trust": "The log is whole, and a key that it rests on was revoked since: it may have been signed after that.",
}
#: the same, of a slug that says something else than its kind
_OF_SLUG = {
    "archive/changed": "The file was damaged or changed in the archive, after it was taken in.",
    "archive/missing": "The file was moved or removed; nothing says that the log itself was bad.",
    "close/junk-after": (
        "The signed log ends before it, and its records are as they were signed: a file system that pads, a copy, or "
        "somebody added the rest."
    ),
    "seal/missing": "Whoever wrote the log did not sign in time, or a seal was taken out: no gap explains it.",
    "seal/gap": "The record of a gap contradicts the records beside it: whoever wrote the log, wrote it wrongly.",
}
#: what to do about a failure, by its slug
HELPS = {
    "archive/changed": "add the sound log again: `rtshcua archive add`",
    "archive/missing": "add the log again: `rtshcua archive add`",
    "close/junk-after": "`head -c BYTE LOG > COPY`, with the byte at which it begins, gives the log alone: verify that",
    "trust/root-unknown-key": "if another root flew it: `--root` takes that trust root, or its public key",
    "trust/root-revoked-key": "`--root` or `--revocations` takes the very trust root that was flown under",
    "trust/revoked-log-key": "what witnesses cosigned before counts: `--anchors`",
    "trust/revoked-when": "`--revocations` takes the trust roots between too, one by one",
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
    """The whole, for a program. Keys are only ever added."""
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
    """Prints the whole for a person."""
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
    """That nothing was recorded for a while, for how long, and who says so."""
    longest = max(gap.us for gap in report.gaps)
    both = all(gap.boundary is not None for gap in report.gaps)
    by = "the epoch keys and by the boundary" if both else "the epoch keys"
    if len(report.gaps) == 1:
        return f"gap of {seconds(longest)}, vouched for by {by}"
    return f"{len(report.gaps)} gaps, of {seconds(longest)} at most, vouched for by {by}"


def meaning_of(slug: str, *, failed: bool) -> str:
    """What a finding means to whoever must act on it."""
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
        yield "", f"  {many(report.records, 'record')}{epochs}; those that sign were read"
        return
    outcomes = ", ".join(f"{counts[name]} {name}" for name in _OUTCOMES if counts.get(name))
    decisions = f"{many(counts.get('decision', 0), 'decision')}{f' ({outcomes})' if outcomes else ''}"
    yield (
        "",
        f"  {many(report.records, 'record')} read: {decisions}, {many(counts.get('effect', 0), 'effect')}{epochs}",
    )
