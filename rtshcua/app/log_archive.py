"""The service `archive`: store many verified logs and query them. Requires the extra `archive`."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

from rtshcua.adapters.archive.folder import LogSource
from rtshcua.adapters.store.logs import begins_as_log
from rtshcua.adapters.store.runs import LOG, logs_of
from rtshcua.app.documents import no_log
from rtshcua.app.exit_codes import untrusted
from rtshcua.app.logs import finding_code
from rtshcua.app.pin import Pin, pin
from rtshcua.app.wording import moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire.untrusted import Untrusted

if TYPE_CHECKING:
    from rtshcua.adapters.archive.adding import Done, VerificationOptions
    from rtshcua.adapters.archive.asking import Canned, DecisionQuery, QueryRows
    from rtshcua.adapters.archive.examine import LogVerifiers
    from rtshcua.adapters.archive.folder import ArchiveFolder

_EXTRAS: Final = {"duckdb": "archive", "distributed": "cluster"}
_INPUT: Final = frozenset({"malformed", "no-archive", "archive-version", "archive-path", "archive-index"})
_HELPS: Final = {
    "archive-index": "rebuild it with `rtshcua archive verify --reindex`",
    "no-archive": "create one with `rtshcua archive add LOG...`, or name its folder with `--archive`",
}
#: the accepted values of filters
_KNOWN: Final[Mapping[str, Sequence[str]]] = {
    "status": ("verified", "incomplete", "failed"),
    "outcome": ("allow", "deny", "defer", "fallback"),
    "witness": ("witnessed", "unwitnessed"),
}

T = TypeVar("T")


class ArchiveRequest(NamedTuple):
    """How the logs of an archive are verified: trust root, recomputed decisions, number of processes or cluster."""

    archive: Path
    root: str | None
    audit: bool
    jobs: int | None
    cluster: str | None


class Skipped(NamedTuple):
    """A file in a folder that is not a readable log, and why."""

    path: Path
    why: str


class LogsFound(NamedTuple):
    """The logs in files and folders, and the skipped files of the folders."""

    logs: list[LogSource]
    skipped: list[Skipped]


class ArchiveResult(NamedTuple):
    """The results of adding or verifying logs, and the state of the archive.

    `others`: number of logs verified under other roots; `missing`: logs whose predecessors are missing; `conflicts`:
    logs that contradict each other; `names`: the file names of logs by their digests.
    """

    folder: Path
    pinned: Pin
    done: "list[Done]"
    skipped: list[Skipped]
    others: int
    missing: "QueryRows"
    conflicts: "QueryRows"
    names: dict[str, str]

    @property
    def pairs(self) -> list[tuple[str, str, object]]:
        """The pairs of logs that contradict each other, and the record of each."""
        return [(str(one), str(other), seq) for _, _, seq, one, other in self.conflicts.rows]

    def code(self) -> ExitCode:
        """Return the exit code of the first failed log; otherwise of conflicts, skipped files or an unclosed log."""
        if not self.done and self.others:
            return ExitCode.UNTRUSTED  # no log was verified under this root
        codes = [code_of(each.entry.status, each.entry.finding) for each in self.done]
        mine = {each.entry.log for each in self.done}
        if any({one, other} & mine for one, other, _ in self.pairs):
            codes.append(ExitCode.EVIDENCE)
        if self.skipped:
            codes.append(ExitCode.INPUT)
        failed = (code for code in codes if code not in (ExitCode.OK, ExitCode.INCOMPLETE))
        return next(failed, ExitCode.INCOMPLETE if ExitCode.INCOMPLETE in codes else ExitCode.OK)


class ArchiveQuery(NamedTuple):
    """A shipped query, by `name`, or a SELECT statement `sql`; with filters on decisions."""

    archive: Path
    conditions: Mapping[str, str | None]
    name: str | None = None
    sql: str | None = None
    limit: int | None = None


def code_of(status: str, finding: str | None) -> ExitCode:
    """Return the exit code for a log, as `rtshcua verify-log` does."""
    if status != "failed":
        return ExitCode.OK if status == "verified" else ExitCode.INCOMPLETE
    return finding_code(finding or "")


def logs_in(paths: Iterable[Path]) -> LogsFound | Refusal:
    """Return the logs in files and folders; a refusal if there are none.

    A named file must be a log. Files in a folder that are not logs are skipped. Raises OSError.
    """
    found = LogsFound([], [])
    for path in paths:
        root = path if path.is_dir() else None
        below = logs_of(path)
        if not below:
            return Refusal("input", f"no `{LOG}` found in `{path}`")
        for log in below:
            wrong = _no_log(log, root)
            if wrong is None:
                found.logs.append(LogSource(log, root))
            elif root is None:
                return Refusal("input", *no_log(log, log, "name logs or run folders"))
            else:
                found.skipped.append(Skipped(log, wrong))
    if not found.logs:
        first = found.skipped[0]
        return Refusal("input", f"cannot add `{first.path}`: {first.why}")
    return found


def _no_log(path: Path, root: Path | None) -> str | None:
    """Return why a file cannot be added; None if it can."""
    try:
        return None if begins_as_log(path, root) else "it is not a log of this program"
    except OSError as error:
        if root is None:
            raise
        return (error.strerror or str(error)).lower()


def add(request: ArchiveRequest, found: LogsFound, progress: Callable[[int], None]) -> ArchiveResult | Refusal:
    """Copy logs into an archive, which is created if missing, and verify them there. Raises OSError."""

    def work() -> ArchiveResult | Refusal:
        from rtshcua.adapters.archive import adding

        return _verified(request, lambda folder, check: adding.add(folder, found.logs, check), progress, found.skipped)

    return answered(work)


def verify(request: ArchiveRequest, progress: Callable[[int], None], *, reindex: bool) -> ArchiveResult | Refusal:
    """Verify again the logs of an archive that were verified under this root. Raises OSError."""

    def work() -> ArchiveResult | Refusal:
        from rtshcua.adapters.archive import adding

        return _verified(request, adding.reindex if reindex else adding.verify, progress)

    return answered(work)


def _verified(
    request: ArchiveRequest,
    work: "Callable[[ArchiveFolder, VerificationOptions], Iterator[Done]]",
    progress: Callable[[int], None],
    skipped: list[Skipped] | None = None,
) -> ArchiveResult | Refusal:
    import duckdb

    from rtshcua.adapters.archive.adding import VerificationOptions
    from rtshcua.adapters.archive.entry import AUDIT, RECORDS
    from rtshcua.adapters.archive.folder import ArchiveFolder

    where = request.archive
    try:
        pinned = pin(request.root)
    except Untrusted as error:
        return Refusal(
            error.slug, str(error), "name the trust root of the flight's operator, or its public key, with `--root`"
        )
    folder = ArchiveFolder(where, make=skipped is not None)
    done: list[Done] = []
    try:
        with closing(_workers(request)) as workers:
            depth = AUDIT if request.audit else RECORDS
            check = VerificationOptions(pinned.key, depth, time.time_ns() // 1000, workers)
            for each in work(folder, check):
                done.append(each)
                progress(len(done))
    except duckdb.IOException as error:  # not an OSError
        code = ExitCode.FULL
        return Refusal(code.slug, f"the index could not be written: {' '.join(str(error).split())}", "", code)
    except BlockingIOError:
        code, text = ExitCode.REFUSED, f"another process is changing `{where}`"
        return Refusal(code.slug, text, "wait until it has finished", code)
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = str(where)
        raise
    finally:
        progress(0)
    return _result(folder, pinned, check.root, done, skipped or [])


def _workers(request: ArchiveRequest) -> "LogVerifiers":
    from rtshcua.adapters.archive.examine import SchedulerWorkers, VerifierProcesses

    return VerifierProcesses(request.jobs) if request.cluster is None else SchedulerWorkers(request.cluster)


def _result(
    folder: "ArchiveFolder", pinned: Pin, root: str, done: "list[Done]", skipped: list[Skipped]
) -> ArchiveResult:
    from rtshcua.adapters.archive.asking import ArchiveReader, canned

    with closing(ArchiveReader(folder)) as reader:
        missing, conflicts = (reader.ask(canned()[name].sql) for name in ("missing", "conflicts"))
        others = len(reader.ask(f"SELECT log FROM logs WHERE pinned <> '{root}'").rows)
        names = {str(log): str(name) for log, name in reader.ask("SELECT log, name FROM logs").rows}
    return ArchiveResult(folder.path, pinned, done, skipped, others, missing, conflicts, names)


def list_logs(
    archive: Path, vehicle: str | None, status: str | None, limit: int | None, columns: str
) -> "QueryRows | Refusal":
    """Return the logs of an archive, ordered by start time."""

    def work() -> "QueryRows | Refusal":
        from rtshcua.adapters.archive.asking import matching

        where = matching(vehicle=vehicle, status=status)
        return _ask(archive, f"SELECT {columns} FROM logs WHERE {where} ORDER BY begun_us, log", None, limit)

    return answered(lambda: _unknown({"status": status}) or work())


def statistics(archive: Path) -> "QueryRows | Refusal":
    """Return the numbers of logs, records and decisions of an archive."""

    def work() -> "QueryRows":
        from rtshcua.adapters.archive.asking import STATS

        return _ask(archive, STATS, None, None)

    return answered(work)


def questions() -> "list[Canned] | Refusal":
    """Return the shipped queries."""

    def work() -> "list[Canned]":
        from rtshcua.adapters.archive.asking import canned

        return [*canned().values()]

    return answered(work)


def question_of(query: ArchiveQuery) -> "Canned | Refusal | None":
    """Return the shipped query that is named; None if the request has its own SQL."""
    if query.sql is not None and query.name is not None:
        return Refusal("usage", "a shipped query and `--sql` cannot be combined")
    unknown = _unknown(query.conditions)
    if unknown is not None:
        return unknown
    found = questions()
    if isinstance(found, Refusal) or query.name is None:
        return found if isinstance(found, Refusal) else None
    named = next((each for each in found if each.name == query.name), None)
    return named or Refusal("usage", f"no such query: `{query.name}`", "run `rtshcua archive query` for a list")


def ask(query: ArchiveQuery) -> "QueryRows | Refusal":
    """Return the result of a query."""
    question = question_of(query)
    if isinstance(question, Refusal):
        return question
    conditions = _conditions(query.conditions)
    if isinstance(conditions, Refusal):
        return conditions
    if question is not None and not question.filtered and any(value is not None for value in conditions):
        return Refusal("usage", f"`{question.name}` does not query decisions, so filters on decisions do not apply")
    sql = query.sql if question is None else question.sql
    return answered(lambda: _ask(query.archive, sql or "", conditions, query.limit))


def _conditions(values: Mapping[str, str | None]) -> "DecisionQuery | Refusal":
    """Return the filters on decisions."""
    from rtshcua.adapters.archive.asking import DecisionQuery

    times = {name: None if values.get(name) is None else _time_of(str(values[name])) for name in ("since", "until")}
    for name, time_us in times.items():
        if values.get(name) is not None and time_us is None:
            help = "accepted: `2026-03-01`, `2026-03-01T12:00Z`"
            return Refusal("usage", f"`{values[name]}` is neither a day nor a time", help)
    policy = values.get("policy") or ""
    name, _, version = policy.partition("@")
    if version and not (version.isascii() and version.isdigit()):
        return Refusal("usage", f"`{policy}` has no valid version", "accepted: as in `bridge_inspection@7`")
    get, number = values.get, int(version) if version else None
    return DecisionQuery(
        get("vehicle"), get("mission"), get("skill"), get("outcome"), get("reason"), get("rule"), get("clause"),
        name or None, number, times["since"], times["until"], get("witness"),
    )  # fmt: skip


def _unknown(values: Mapping[str, str | None]) -> Refusal | None:
    """Return the refusal of an unknown filter value; None if all are known."""
    for name, known in _KNOWN.items():
        value = values.get(name)
        if value is not None and value not in known:
            return Refusal("usage", f"unknown value `{value}` of `--{name}`", f"accepted: {', '.join(known)}")
    return None


def _time_of(text: str) -> int | None:
    """Return UTC in us of an ISO 8601 day (its beginning) or time with an offset; None if it is neither."""
    try:
        day = date.fromisoformat(text)
    except ValueError:
        return moment(text)
    return (day - date(1970, 1, 1)).days * 86_400_000_000


def _ask(archive: Path, sql: str, conditions: "DecisionQuery | None", limit: int | None) -> "QueryRows":
    from rtshcua.adapters.archive.asking import ArchiveReader
    from rtshcua.adapters.archive.folder import ArchiveFolder

    with closing(ArchiveReader(ArchiveFolder(archive), conditions)) as reader:
        return reader.ask(sql, limit)


def answered(work: Callable[[], T | Refusal]) -> T | Refusal:
    """Return the result of `work`; a refusal for a missing package, an invalid archive or a malformed query."""
    try:
        return work()
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").partition(".")[0])
        if extra is None:
            raise
        help = f"run `pip install '.[{extra}]'` in the checkout"
        return Refusal("input", f"the package `{error.name}` is required and not installed", help)
    except Untrusted as error:
        if error.slug not in _INPUT:
            return untrusted(error)
        return Refusal(error.slug, str(error), _HELPS.get(error.slug, ""), ExitCode.INPUT)
