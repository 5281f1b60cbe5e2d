"""`rtshcua archive`: keep many logs, verified, and ask them questions."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from rtshcua.app import log_archive as service
from rtshcua.app.log_archive import ArchiveQuery, ArchiveRequest, ArchiveResult
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import refuse
from rtshcua.front.cli.render.archive_tables import Shape, tell, tell_result
from rtshcua.front.cli.stdout import out_rendered

if TYPE_CHECKING:
    from rtshcua.adapters.archive.asking import QueryRows

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
Vehicle = Annotated[str | None, typer.Option(help="decisions on this vehicle")]
Mission = Annotated[str | None, typer.Option(help="in this mission")]
Skill = Annotated[str | None, typer.Option(help="on this skill")]
Outcome = Annotated[str | None, typer.Option(help="allow, deny, defer or fallback")]
Reason = Annotated[str | None, typer.Option(help="for this reason, or its beginning: `safety`")]
Clause = Annotated[str | None, typer.Option(help="by a clause with this in it")]
Rule = Annotated[str | None, typer.Option(help="by this rule: integrity, authority, state, safety, ...")]
Policy = Annotated[str | None, typer.Option(metavar="NAME[@VERSION]", help="under this policy")]
Since = Annotated[str | None, typer.Option(metavar="TIME", help="from this day (UTC) or time on")]
Until = Annotated[str | None, typer.Option(metavar="TIME", help="before this day (UTC) or time")]
Witness = Annotated[str | None, typer.Option(help="witnessed or unwitnessed")]

_DEFAULT: Final = Path("archive")
_LISTED: Final = "log, vehicle, begun_us, mission, policy, policy_version, records, anchored, status, finding"


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
    found = service.logs_in(logs)
    if isinstance(found, Refusal):
        return refuse(found)
    request = ArchiveRequest(archive, root, audit, jobs, cluster)
    return _shown(service.add(request, found, _progress), as_json=as_json)


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
    request = ArchiveRequest(archive, root, audit, jobs, cluster)
    return _shown(service.verify(request, _progress, reindex=anew), as_json=as_json)


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
    shape = _shape(as_json, as_csv)
    columns = _LISTED if shape is Shape.TABLE else "*"
    return _told(service.list_logs(archive, vehicle, status, limit, columns), shape)


@app.command()
def query(
    name: Annotated[str | None, typer.Argument(metavar="[QUESTION]", help="one that ships; none lists them")] = None,
    archive: Archive = _DEFAULT,
    sql: Annotated[str | None, typer.Option(metavar="SELECT", help="a question of your own")] = None,
    show_sql: Annotated[bool, typer.Option("--show-sql", help="print the question's SQL instead")] = False,
    vehicle: Vehicle = None,
    mission: Mission = None,
    skill: Skill = None,
    outcome: Outcome = None,
    reason: Reason = None,
    clause: Clause = None,
    rule: Rule = None,
    policy: Policy = None,
    since: Since = None,
    until: Until = None,
    witness: Witness = None,
    limit: Limit = None,
    as_json: Json = False,
    as_csv: Csv = False,
) -> ExitCode:
    """Ask an archive a question: one that ships, or one SELECT of your own over logs, decided, happened, seals.

    Only logs that verified answer. Times are UTC in microseconds but in tables.
    """
    shape = _shape(as_json, as_csv)
    if sql is None and name is None:
        found = service.questions()
        if isinstance(found, Refusal):
            return refuse(found)
        tell(("question", "tells"), [(each.name, each.tells) for each in found], shape)
        return ExitCode.OK
    conditions = {
        "vehicle": vehicle, "mission": mission, "skill": skill, "outcome": outcome, "reason": reason, "rule": rule,
        "clause": clause, "policy": policy, "since": since, "until": until, "witness": witness,
    }  # fmt: skip
    asked = ArchiveQuery(archive, conditions, name, sql, limit)
    question = service.question_of(asked) if show_sql else None
    if isinstance(question, Refusal):
        return refuse(question)
    if question is not None:
        out_rendered(question.sql)
        return ExitCode.OK
    return _told(service.ask(asked), shape)


@app.command()
def stats(archive: Archive = _DEFAULT, as_json: Json = False, as_csv: Csv = False) -> ExitCode:
    """Count what an archive holds."""
    return _told(service.statistics(archive), _shape(as_json, as_csv))


def _told(answer: "QueryRows | Refusal", shape: Shape) -> ExitCode:
    if isinstance(answer, Refusal):
        return refuse(answer)
    tell(answer.columns, answer.rows, shape)
    return ExitCode.OK


def _shown(result: ArchiveResult | Refusal, *, as_json: bool) -> ExitCode:
    if isinstance(result, Refusal):
        return refuse(result)
    tell_result(result, as_json=as_json)
    return result.code()


def _progress(count: int) -> None:
    if sys.stderr is not None and sys.stderr.isatty():
        sys.stderr.write(f"\r\033[K{count} logs" if count else "\r\033[K")
        sys.stderr.flush()


def _shape(as_json: bool, as_csv: bool) -> Shape:
    return Shape.JSON if as_json else Shape.CSV if as_csv else Shape.TABLE
