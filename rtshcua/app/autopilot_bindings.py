"""The autopilot bindings beside a log: find them, read them, and say what they show of a verified log."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular, read_regular
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.report import LogReport
from rtshcua.ground.flight.agreement import AGREES_MM, AGREES_US
from rtshcua.model.quantity import Dimension, display
from rtshcua.wire import cose
from rtshcua.wire.autopilot_binding import (
    MAX_AUTOPILOT_BINDING,
    AutopilotBinding,
    open_autopilot_binding,
    read_autopilot_binding,
)
from rtshcua.wire.trust import TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

SUFFIX: Final = ".binding"
#: the limit of the number of bindings in a folder; the rest is ignored
_MOST: Final = 64
_SHOWN: Final = 3  # deviations that a claim names
_NAMES: Final = {"ulog": "a PX4 log", "dataflash": "an ArduPilot log"}
_CONDITIONS: Final = {"whole": "", "cut": ", cut off at its end", "damaged": ", damaged in part"}


class FoundBinding(NamedTuple):
    """A file that should be a binding, its octets, and its unverified content, or why it has none."""

    path: Path
    document: bytes
    content: AutopilotBinding | Untrusted


def binding_name(digest: bytes) -> str:
    """The name of the binding of an autopilot's log with this SHA-256."""
    return f"autopilot-{digest.hex()[:16]}{SUFFIX}"


def read_bindings(folder: Path) -> tuple[FoundBinding, ...]:
    """The bindings in the folder of a run, which are not verified; unreadable files are ignored."""
    return tuple(_found(sorted(folder.glob(f"*{SUFFIX}"))[:_MOST]))


def _found(paths: Sequence[Path]) -> Iterator[FoundBinding]:
    for path in paths:
        with suppress(OSError):
            document = read_regular(path, MAX_AUTOPILOT_BINDING, path.parent)
            try:
                content = read_autopilot_binding(cose.unverified(document, limit=MAX_AUTOPILOT_BINDING).payload)
                yield FoundBinding(path, document, content)
            except Untrusted as error:
                yield FoundBinding(path, document, error)


def genesis_leaf(log: Path) -> bytes:
    """The leaf of the first line of a log. Raises OSError."""
    with open_regular(log) as file:
        return leaf_hash(next(lines(file), b""))


def trusted_binding(document: bytes, roots: Sequence[TrustRoot], vehicle: str) -> AutopilotBinding:
    """The binding, if it is trusted under one of the roots and no root revokes its key. Raises `Untrusted`."""
    kid, refused = cose.unverified(document, limit=MAX_AUTOPILOT_BINDING).kid, None
    if any(kid in root.revocations for root in roots):
        raise Untrusted("revoked-key", f"key {kid.hex()} is revoked")
    for root in roots:
        try:
            return open_autopilot_binding(document, root=root, vehicle=vehicle)
        except Untrusted as error:
            refused = refused or error
    raise refused or Untrusted("no-root", "there is no trust root")


def roots_of(log_root: TrustRoot | None, signed: Sequence[bytes]) -> list[TrustRoot]:
    """The trust root of a log and the other ones that an auditor supplies, the latest first."""
    others = [open_root(each, pinned=cose.unverified(each, limit=len(each)).kid, now_us=0) for each in signed]
    return [*([] if log_root is None else [log_root]), *sorted(others, key=lambda root: -root.version)]


def with_bindings(report: LogReport, log: Path, roots: Sequence[TrustRoot]) -> LogReport:
    """Add to the report of a log without failure what the bindings beside it show. They never change the verdict."""
    if report.failure is not None or report.genesis is None:
        return report
    shown, not_shown = list[Claim](), list[Claim]()
    for found in read_bindings(log.parent):
        claims = _claims(found, report, log, roots)
        shown += claims[0]
        not_shown += claims[1]
    return report._replace(proven=(*report.proven, *shown), unproven=(*report.unproven, *not_shown))


def with_unread_bindings(report: LogReport, log: Path) -> LogReport:
    """Add to the report of a log without failure that the bindings beside it were not compared with it."""
    names = [] if report.failure is not None else [f"`{each.path.name}`" for each in read_bindings(log.parent)]
    if not names:
        return report
    text = f"the autopilot's log by {', '.join(names)}: it was not compared: without `--fast`"
    return report._replace(unproven=(*report.unproven, Claim("autopilot/unread", text)))


def trusted_bindings(report: LogReport, log: Path, roots: Sequence[TrustRoot]) -> list[AutopilotBinding]:
    """The bindings beside a log without failure that are trusted and of this log."""
    if report.failure is not None or report.genesis is None:
        return []
    found = (_bound(each, report, log, roots) for each in read_bindings(log.parent))
    return [each for each in found if isinstance(each, AutopilotBinding)]


def _bound(found: FoundBinding, report: LogReport, log: Path, roots: Sequence[TrustRoot]) -> AutopilotBinding | Claim:
    """The content of a binding that is trusted and of this log; else what is not shown."""
    assert report.genesis is not None
    whose, genesis = f"the autopilot's log by `{found.path.name}`", report.genesis
    try:
        binding = trusted_binding(found.document, roots, genesis.vehicle)
    except Untrusted as error:
        return Claim("autopilot/untrusted", f"{whose}: the document is not trusted: {error}")
    if (binding.flight, binding.genesis) != (bytes.fromhex(genesis.boot), genesis_leaf(log)):
        return Claim("autopilot/other-log", f"{whose}: it is bound to another log")
    if (binding.records, binding.root) != (report.records, report.root):
        text = f"{whose}: it was bound to {binding.records} records, the log has others"
        return Claim("autopilot/other-log", text)
    return binding


def _claims(
    found: FoundBinding, report: LogReport, log: Path, roots: Sequence[TrustRoot]
) -> tuple[list[Claim], list[Claim]]:
    """What a binding shows of a log, and what it does not show."""
    binding = _bound(found, report, log, roots)
    if isinstance(binding, Claim):
        return [], [binding]
    kid = cose.unverified(found.document, limit=MAX_AUTOPILOT_BINDING).kid.hex()
    text = f"log key {kid} binds `{binding.file}`, {described(binding)}, to this log: {agreed(binding)}"
    doubts = [] if binding.agreed == binding.points else [Claim("autopilot/apart", apart(binding))]
    return [Claim("autopilot", text)], [*doubts, *_file(binding, found.path.parent)]


def _file(binding: AutopilotBinding, folder: Path) -> list[Claim]:
    """What is not shown because the autopilot's log is not there, or was changed."""
    whose = f"the contents of `{binding.file}`, the autopilot's log"
    try:
        with open_regular(folder / binding.file, folder) as file:
            same = file_digest(file, "sha256").digest() == binding.digest
    except FileNotFoundError:
        text = f"{whose}: it is not beside the log; its SHA-256 is {binding.digest.hex()}"
        return [Claim("autopilot/missing", text)]
    except OSError:
        return [Claim("autopilot/missing", f"{whose}: the file beside the log cannot be read")]
    return [] if same else [Claim("autopilot/changed", f"{whose}: the file beside the log is not the bound one")]


def described(binding: AutopilotBinding) -> str:
    """What was bound, as text."""
    return f"{_NAMES[binding.kind]}{_CONDITIONS[binding.condition]}"


def agreed(binding: AutopilotBinding) -> str:
    """How far the tracks agree, as text."""
    covered = f"it covers {_percent(binding.covered_us, binding.flown_us)} of the telemetry's track"
    if not binding.compared:
        return covered
    within = f"within {display(AGREES_MM, Dimension.LENGTH)} and {display(AGREES_US, Dimension.DURATION)}"
    share = f"{binding.agreed} of {binding.compared} positions agree {within}"
    return f"{covered}, {share}; deviations are at most {_away(binding.horizontal, binding.vertical)}"


def apart(binding: AutopilotBinding) -> str:
    """Where the tracks do not agree, or could not be compared, as text."""
    text = f"that `{binding.file}` agrees with the whole flight"
    if binding.points > binding.compared:
        text += f": it has nothing of {binding.points - binding.compared} of {binding.points} positions"
    worst = sorted(binding.deviations, key=lambda each: -max(each.horizontal, each.vertical))[:_SHOWN]
    rest = len(binding.deviations) + binding.others - len(worst)
    told = [
        f"{_times(each.from_us, each.to_us)} by {_away(each.horizontal, each.vertical)}"
        for each in sorted(worst, key=lambda each: each.from_us)
    ]
    if told:
        text += f"; they are apart at {', '.join(told)}" + (f", and {rest} more times" if rest else "")
    return text


def _away(horizontal: int, vertical: int) -> str:
    return f"{display(horizontal, Dimension.LENGTH)} across and {display(vertical, Dimension.LENGTH)} in height"


def _percent(part: int, whole: int) -> str:
    tenths = 1_000 * part // whole if whole else 0
    return f"{tenths // 10}.{tenths % 10} %" if tenths % 10 else f"{tenths // 10} %"


def _times(from_us: int, to_us: int) -> str:
    """A time of the flight: `180.4 to 182.9 s`, or one moment."""
    first, last = _s(from_us), _s(to_us)
    return f"{first} s" if first == last else f"{first} to {last} s"


def _s(us: int) -> str:
    return f"{us // 1_000_000}.{us % 1_000_000 // 100_000}"
