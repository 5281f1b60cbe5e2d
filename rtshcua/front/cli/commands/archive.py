"""`rtshcua archive`: keep many logs, verified, and ask them questions."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.archiving.given import VerifyingOptions, logs_in, time_of, unknown, with_extra
from rtshcua.front.cli.faults import distrust, fail
from rtshcua.front.cli.render.archive_tables import Shape, tell
from rtshcua.front.cli.stdout import out_rendered
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

Archive = Annotated[Path, typer.Option("--archive", "-a", metavar="FOLDER", help="the archive's folder")]
Root = Annotated[
    str | None, typer.Option(metavar="FILE|KEY", help="the trust root or its key [default: your key store's]")
]
Audit = Annotated[bool, typer.Option("--audit", help="derive every decision again, too")]
Jobs = Annotated[int | None, typer.Option(min=1, metavar="N", help="processes that verify [default: one a core]")]
Cluster = Annotated[str | None, typer.Option(metavar="ADDRESS", help="verify on this Dask cluster, tcp://HOST:PORT")]
Json = Annotated[bool, typer.Option("--json", help="JSON on the standard output")]
Csv = Annotated[bool, typer.Option("--csv", help="CSV on the standard output")]
Limit = Annotated[int | None, typer.Option(min=1, metavar="N", help="no more rows than this")]

_DEFAULT = Path("archive")
_STATUSES = ("verified", "incomplete", "failed")
_OUTCOMES = ("allow", "deny", "defer", "fallback")
_WITNESS = ("witnessed", "unwitnessed")
_INPUT = frozenset({"malformed", "no-archive", "archive-version", "archive-path", "archive-index"})
_HELPS = {
    "archive-index": "`rtshcua archive verify --reindex` makes it anew",
    "no-archive": "`rtshcua archive add LOG...` makes one; `--archive` says where it is",
}


@app.callback()
def archive() -> None:
    """Keep many logs, verified, and ask them questions."""


@app.command()
def add(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="logs, folders of runs, or folders of these")],
    archive: Archive = _DEFAULT,
    root: Root = None,
    audit: Audit = False,
    jobs: Jobs = None,
    cluster: Cluster = None,
    as_json: Json = False,
) -> ExitCode:
    """Copy logs into an archive, verify them there, and index those that are to be believed.

    Of a log that fails nothing is indexed but that it fails, and why. The exit code is what `rtshcua verify-log` says
    of the first that fails; else 9 where logs contradict each other, 3 where a folder also holds what is no log, 10
    where a log was not closed.
    """
    found = logs_in(logs)
    if isinstance(found, ExitCode):
        return found

    def work() -> ExitCode:
        from rtshcua.adapters.archive import adding
        from rtshcua.front.cli.archiving.checking import checked

        how = VerifyingOptions(root, audit, jobs, cluster, as_json)
        return checked(archive, lambda folder, check: adding.add(folder, found.logs, check), how, found.skipped)

    return _answered(work)


@app.command()
def verify(
    archive: Archive = _DEFAULT,
    root: Root = None,
    audit: Audit = False,
    jobs: Jobs = None,
    cluster: Cluster = None,
    anew: Annotated[bool, typer.Option("--reindex", help="and make the index anew from the logs")] = False,
    as_json: Json = False,
) -> ExitCode:
    """Verify all logs of an archive once more, where they lie: those that were verified under this root.

    The exit code is that of `add`; 4 where none rests on this root.
    """

    def work() -> ExitCode:
        from rtshcua.adapters.archive import adding
        from rtshcua.front.cli.archiving.checking import checked

        how = VerifyingOptions(root, audit, jobs, cluster, as_json)
        return checked(archive, adding.reindex if anew else adding.verify, how)

    return _answered(work)


@app.command(name="list")
def list_(
    archive: Archive = _DEFAULT,
    vehicle: Annotated[str | None, typer.Option(help="of this vehicle")] = None,
    status: Annotated[str | None, typer.Option(help="verified, incomplete or failed")] = None,
    limit: Limit = None,
    as_json: Json = False,
    as_csv: Csv = False,
) -> ExitCode:
    """List the logs of an archive."""

    def work() -> ExitCode:
        from rtshcua.adapters.archive.asking import matching

        if refused := unknown("--status", status, _STATUSES):
            return refused
        shape = _shape(as_json, as_csv)
        what = "log, vehicle, begun_us, mission, policy, policy_version, records, anchored, status, finding"
        where = matching(vehicle=vehicle, status=status)
        columns = what if shape is Shape.TABLE else "*"
        return _ask(archive, f"SELECT {columns} FROM logs WHERE {where} ORDER BY begun_us, log", None, limit, shape)

    return _answered(work)


@app.command()
def query(
    name: Annotated[str | None, typer.Argument(metavar="[QUESTION]", help="one that ships; none lists them")] = None,
    archive: Archive = _DEFAULT,
    sql: Annotated[str | None, typer.Option(metavar="SELECT", help="a question of your own")] = None,
    show_sql: Annotated[bool, typer.Option("--show-sql", help="print the question's SQL instead")] = False,
    vehicle: Annotated[str | None, typer.Option(help="decisions on this vehicle")] = None,
    mission: Annotated[str | None, typer.Option(help="in this mission")] = None,
    skill: Annotated[str | None, typer.Option(help="on this skill")] = None,
    outcome: Annotated[str | None, typer.Option(help="allow, deny, defer or fallback")] = None,
    reason: Annotated[str | None, typer.Option(help="for this reason, or its beginning: `safety`")] = None,
    clause: Annotated[str | None, typer.Option(help="by a clause with this in it")] = None,
    rule: Annotated[str | None, typer.Option(help="by this rule: integrity, authority, state, safety, ...")] = None,
    policy: Annotated[str | None, typer.Option(metavar="NAME[@VERSION]", help="under this policy")] = None,
    since: Annotated[str | None, typer.Option(metavar="TIME", help="from this day (UTC) or time on")] = None,
    until: Annotated[str | None, typer.Option(metavar="TIME", help="before this day (UTC) or time")] = None,
    witness: Annotated[str | None, typer.Option(help="witnessed or unwitnessed")] = None,
    limit: Limit = None,
    as_json: Json = False,
    as_csv: Csv = False,
) -> ExitCode:
    """Ask an archive a question: one that ships, or one SELECT of your own over logs, decided, happened, seals.

    Only logs that verified answer. Times are UTC in microseconds but in tables.
    """

    def work() -> ExitCode:
        from rtshcua.adapters.archive.asking import DecisionQuery, canned

        shape, asked = _shape(as_json, as_csv), canned()
        if sql is None and name is None:
            tell(("question", "tells"), [(each.name, each.tells) for each in asked.values()], shape)
            return ExitCode.OK
        if sql is not None and name is not None:
            return fail(ExitCode.USAGE, "either a question that ships or `--sql`, not both")
        for option, value, known in (("--outcome", outcome, _OUTCOMES), ("--witness", witness, _WITNESS)):
            if refused := unknown(option, value, known):
                return refused
        question = None if name is None else asked.get(name)
        if name is not None and question is None:
            return fail(ExitCode.USAGE, f"no such question: `{name}`", "`rtshcua archive query` lists them")
        if show_sql and question is not None:
            out_rendered(question.sql)
            return ExitCode.OK
        times = [None if text is None else time_of(text) for text in (since, until)]
        for text, time in zip((since, until), times, strict=True):
            if text is not None and time is None:
                return fail(
                    ExitCode.USAGE, f"`{text}` is neither a day nor a time", "`2026-03-01`, `2026-03-01T12:00Z`"
                )
        policy_name, _, version = (policy or "").partition("@")
        if version and not (version.isascii() and version.isdigit()):
            return fail(ExitCode.USAGE, f"`{policy}` names no version of a policy", "`bridge_inspection@7`")
        conditions = DecisionQuery(
            vehicle, mission, skill, outcome, reason, rule, clause, policy_name or None,
            int(version) if version else None, times[0], times[1], witness,
        )  # fmt: skip
        if question is not None and not question.filtered and any(value is not None for value in conditions):
            return fail(ExitCode.USAGE, f"`{question.name}` is not about decisions, and takes no conditions on them")
        return _ask(archive, sql if question is None else question.sql, conditions, limit, shape)

    return _answered(work)


@app.command()
def stats(archive: Archive = _DEFAULT, as_json: Json = False, as_csv: Csv = False) -> ExitCode:
    """Count what an archive holds."""

    def work() -> ExitCode:
        from rtshcua.adapters.archive.asking import STATS

        return _ask(archive, STATS, None, None, _shape(as_json, as_csv))

    return _answered(work)


def _ask(where: Path, sql: str | None, conditions: object, limit: int | None, shape: Shape) -> ExitCode:
    from rtshcua.adapters.archive.asking import ArchiveReader, DecisionQuery
    from rtshcua.adapters.archive.folder import ArchiveFolder

    asker = ArchiveReader(ArchiveFolder(where), conditions if isinstance(conditions, DecisionQuery) else None)
    try:
        answer = asker.ask(sql or "", limit)
    finally:
        asker.close()
    tell(answer.columns, answer.rows, shape)
    return ExitCode.OK


def _shape(as_json: bool, as_csv: bool) -> Shape:
    return Shape.JSON if as_json else Shape.CSV if as_csv else Shape.TABLE


def _answered(work: Callable[[], ExitCode]) -> ExitCode:
    """What `work` says, or what stands in its way: a package, an archive that is none, a question without sense."""
    try:
        return with_extra(work)
    except Untrusted as error:
        if error.slug not in _INPUT:
            return distrust(error)
        return fail(ExitCode.INPUT, str(error), _HELPS.get(error.slug), slug=error.slug)
