"""`rtshcua archive add` and `verify`: logs go through the verifier, and what came of each is told."""

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import duckdb
from msgspec import to_builtins

from rtshcua.app.pin import Pin, pin
from rtshcua.app.wording import many
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.archiving.given import Skipped, VerifyingOptions
from rtshcua.front.cli.faults import distrust, fail
from rtshcua.front.cli.render.archive_tables import code_of, counted
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.wire.untrusted import Untrusted

if TYPE_CHECKING:
    from rtshcua.adapters.archive.adding import Done, VerificationOptions
    from rtshcua.adapters.archive.examine import LogVerifiers
    from rtshcua.adapters.archive.folder import ArchiveFolder

_TOLD = 20  # logs that are told of one by one


def checked(
    where: Path,
    work: "Callable[[ArchiveFolder, VerificationOptions], Iterator[Done]]",
    how: VerifyingOptions,
    skipped: list[Skipped] | None = None,
) -> ExitCode:
    """Does `work` on an archive, and tells what came of it; the archive is made where logs come with it, of which some
    may be `skipped`.
    """
    from rtshcua.adapters.archive.adding import VerificationOptions
    from rtshcua.adapters.archive.entry import AUDIT, RECORDS
    from rtshcua.adapters.archive.folder import ArchiveFolder

    try:
        pinned = pin(how.root)
    except Untrusted as error:
        return distrust(error, "`--root` takes the trust root of whoever flew, or its public key")
    folder = ArchiveFolder(where, make=skipped is not None)
    done: list[Done] = []
    try:
        with closing(_workers(how.jobs, how.cluster)) as workers:
            check = VerificationOptions(pinned.key, AUDIT if how.audit else RECORDS, time.time_ns() // 1000, workers)
            for each in work(folder, check):
                done.append(each)
                _progress(len(done))
    except duckdb.IOException as error:  # not an OSError
        return fail(ExitCode.FULL, f"the index could not be written: {' '.join(str(error).split())}")
    except BlockingIOError:
        return fail(ExitCode.REFUSED, f"another process is changing `{where}`", "only one at a time may")
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = str(where)
        raise
    finally:
        _progress(0)
    return _told(folder, done, skipped or [], pinned, check.root, as_json=how.as_json)


def _workers(jobs: int | None, cluster: str | None) -> "LogVerifiers":
    if cluster is not None:
        from rtshcua.adapters.archive.examine import SchedulerWorkers

        return SchedulerWorkers(cluster)
    from rtshcua.adapters.archive.examine import VerifierProcesses

    return VerifierProcesses(jobs)


def _progress(count: int) -> None:
    if sys.stderr is not None and sys.stderr.isatty():
        sys.stderr.write(f"\r\033[K{count} logs" if count else "\r\033[K")
        sys.stderr.flush()


def _told(
    folder: "ArchiveFolder", done: "list[Done]", skipped: list[Skipped], pinned: Pin, root: str, *, as_json: bool
) -> ExitCode:
    from rtshcua.adapters.archive.asking import ArchiveReader, canned

    asker = ArchiveReader(folder)
    try:
        missing = asker.ask(canned()["missing"].sql)
        conflicts = asker.ask(canned()["conflicts"].sql)
        others = len(asker.ask(f"SELECT log FROM logs WHERE pinned <> '{root}'").rows)
        names = {str(log): str(name) for log, name in asker.ask("SELECT log, name FROM logs").rows}
    finally:
        asker.close()
    pairs = [(str(one), str(other), seq) for _, _, seq, one, other in conflicts.rows]
    code = _code(done, skipped, pairs, others)
    counts = Counter(each.entry.status for each in done)
    if as_json:
        said = {
            "archive": str(folder.path),
            "exit_code": int(code),
            "pinned": {"key": pinned.key.hex(), "source": pinned.source},
            "counts": dict(counts),
            "known": sum(each.known for each in done),
            "skipped": [{"path": str(each.path), "why": each.why} for each in skipped],
            "logs": [{"path": str(e.path), "known": e.known, **to_builtins(e.entry)} for e in done],
            "other_roots": others,
            "missing": [dict(zip(missing.columns, row, strict=True)) for row in missing.rows],
            "conflicts": [dict(zip(conflicts.columns, row, strict=True)) for row in conflicts.rows],
        }
        out_json(json.dumps(said, ensure_ascii=False))
        return code
    for left in skipped[:_TOLD]:
        out(f"skipped     {visible(str(left.path))}: {left.why}")
    if len(skipped) > _TOLD:
        out(f"... and {len(skipped) - _TOLD} more that are no logs")
    wrong = [each for each in done if each.entry.status != "verified"]
    for each in wrong[:_TOLD]:
        what = f"{each.entry.finding}, {visible(each.entry.finding_text or '')}"
        out(f"{each.entry.status:<10}  {visible(str(each.path))}: {what}")
    if len(wrong) > _TOLD:
        out(f"... and {len(wrong) - _TOLD} more: `rtshcua archive query findings`")
    new = sum(not each.known for each in done)
    out(f"{many(len(done), 'log')}, {new} of them verified now, under {visible(pinned.source)}: {counted(counts)}")
    if others:
        rest = "rests on another root" if others == 1 else "rest on other roots"
        out(f"{many(others, 'log')} in the archive {rest}: `--root` takes the one that they were verified under")
    if missing.rows:
        out(f"missing: logs before {len(missing.rows)} of these: `rtshcua archive query missing`")
    for one, other, seq in pairs[:_TOLD]:
        out(f"conflict: `{visible(names[one])}` and `{visible(names[other])}` were signed differently at record {seq}")
    if pairs:
        out(f"conflict: {many(len(pairs), 'pair')} of logs, told by `rtshcua archive query conflicts`")
    return code


def _code(
    done: "list[Done]", skipped: list[Skipped], conflicts: list[tuple[str, str, object]], others: int
) -> ExitCode:
    """That of the first log that fails, else of logs that contradict, of what is no log, of one that was not closed."""
    if not done and others:
        return ExitCode.UNTRUSTED  # none rests on this root: nothing was verified
    codes = [code_of(each.entry.status, each.entry.finding) for each in done]
    mine = {each.entry.log for each in done}
    if any({one, other} & mine for one, other, _ in conflicts):
        codes.append(ExitCode.EVIDENCE)
    if skipped:
        codes.append(ExitCode.INPUT)
    failed = (code for code in codes if code not in (ExitCode.OK, ExitCode.INCOMPLETE))
    return next(failed, ExitCode.INCOMPLETE if ExitCode.INCOMPLETE in codes else ExitCode.OK)
