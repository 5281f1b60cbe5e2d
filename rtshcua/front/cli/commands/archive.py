"""`rtshcua archive`: store many verified logs and query them."""

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

Archive = Annotated[Path, typer.Option("--archive", "-a", metavar="FOLDER", help="folder of the archive")]
Root = Annotated[
    str | None, typer.Option(metavar="FILE|KEY", help="trust root or its public key [default: the key store's]")
]
Audit = Annotated[bool, typer.Option("--audit", help="also recompute every decision")]
Jobs = Annotated[int | None, typer.Option(min=1, metavar="N", help="number of processes [default: one for each core]")]
Cluster = Annotated[str | None, typer.Option(metavar="ADDRESS", help="verify on this Dask cluster (tcp://HOST:PORT)")]
Json = Annotated[bool, typer.Option("--json", help="print JSON")]
Csv = Annotated[bool, typer.Option("--csv", help="print CSV")]
Limit = Annotated[int | None, typer.Option(min=1, metavar="N", help="maximum number of rows")]
Vehicle = Annotated[str | None, typer.Option(help="only decisions on this vehicle")]
Mission = Annotated[str | None, typer.Option(help="only in this mission")]
Skill = Annotated[str | None, typer.Option(help="only on this skill")]
Outcome = Annotated[str | None, typer.Option(help="only with this outcome: allow, deny, defer or fallback")]
Reason = Annotated[str | None, typer.Option(help="only for reasons with this prefix, such as `safety`")]
Clause = Annotated[str | None, typer.Option(help="only by clauses that contain this text")]
Rule = Annotated[str | None, typer.Option(help="only by this rule: integrity, authority, state, safety, ...")]
Policy = Annotated[str | None, typer.Option(metavar="NAME[@VERSION]", help="only under this policy")]
Since = Annotated[str | None, typer.Option(metavar="TIME", help="from this UTC day or time")]
Until = Annotated[str | None, typer.Option(metavar="TIME", help="before this UTC day or time")]
Witness = Annotated[str | None, typer.Option(help="only witnessed or unwitnessed decisions")]

_DEFAULT: Final = Path("archive")
_LISTED: Final = "log, vehicle, begun_us, mission, policy, policy_version, records, anchored, status, finding"


@app.callback()
def archive() -> None:
    """Store many verified logs and query them."""


@app.command()
def add(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="logs, run folders, or parents of these")],
    archive: Archive = _DEFAULT,
    root: Root = None,
    audit: Audit = False,
    jobs: Jobs = None,
    cluster: Cluster = None,
    as_json: Json = False,
) -> ExitCode:
    """Copy logs into an archive, verify them there, and index those that verify.

    For a log that fails, only the failure is indexed. Exit code: that of `rtshcua verify-log` for the first log that
    fails; otherwise 9 if logs contradict each other, 3 if a folder also contains files that are not logs, 10 if a log
    was not closed.
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
    anew: Annotated[bool, typer.Option("--reindex", help="also rebuild the index from the logs")] = False,
    as_json: Json = False,
) -> ExitCode:
    """Verify again, in place, the logs of an archive that were verified under this trust root.

    Exit code: as for `add`; 4 if no log was verified under this root.
    """
    request = ArchiveRequest(archive, root, audit, jobs, cluster)
    return _shown(service.verify(request, _progress, reindex=anew), as_json=as_json)


@app.command(name="list")
def list_(
    archive: Archive = _DEFAULT,
    vehicle: Annotated[str | None, typer.Option(help="only logs of this vehicle")] = None,
    status: Annotated[
        str | None, typer.Option(help="only logs with this status: verified, incomplete or failed")
    ] = None,
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
    name: Annotated[
        str | None, typer.Argument(metavar="[QUESTION]", help="name of a shipped query; without it, list them")
    ] = None,
    archive: Archive = _DEFAULT,
    sql: Annotated[str | None, typer.Option(metavar="SELECT", help="run your own query")] = None,
    show_sql: Annotated[bool, typer.Option("--show-sql", help="print the SQL of the query without running it")] = False,
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
    """Query an archive with a shipped query, or with your own SELECT over the tables logs, decided, happened, seals.

    Only verified logs are included. Times are in UTC microseconds, except in printed tables.
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
    """Print the number of logs and records of an archive."""
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
