"""Query an archive: SQL over its tables, shipped or the caller's own."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import duckdb

from rtshcua.adapters.archive.folder import NOTHING, TABLES, ArchiveFolder
from rtshcua.adapters.archive.index import is_digest, misleading, quoted
from rtshcua.wire.untrusted import Untrusted

#: the content of an archive, by status of its logs
STATS: Final = """
SELECT l.status, COUNT(*) AS logs, COUNT(DISTINCT l.vehicle) AS vehicles, SUM(l.bytes) AS bytes,
  SUM(l.records) AS records, SUM(l.anchored) AS anchored, SUM(d.decisions) AS decisions, SUM(d.refusals) AS refusals,
  MIN(l.begun_us) AS first_us, MAX(l.begun_us) AS last_us
FROM logs l
LEFT JOIN (
  SELECT log, COUNT(*) AS decisions, SUM(CASE WHEN outcome <> 'allow' THEN 1 ELSE 0 END) AS refusals
  FROM decided GROUP BY log
) d ON d.log = l.log
GROUP BY l.status
ORDER BY l.status"""

_HERE: Final = Path(__file__).parent
VIEWS: Final = ("decided", "happened")
#: a reason may be given by its beginning, a clause by a part
_FORMS: Final = {
    "reason": "(reason = {0} OR starts_with(reason, {0} || '/'))",
    "clause": "contains(clause, {0})",
    "since": "utc_us >= {0}",
    "until": "utc_us < {0}",
}


class Canned(NamedTuple):
    """A shipped query: its name, its description, its SQL."""

    name: str
    tells: str
    sql: str

    @property
    def filtered(self) -> bool:
        """Whether conditions on decisions affect its result."""
        return "FROM decided" in self.sql


def canned() -> dict[str, Canned]:
    """All shipped queries, by name."""
    found = {}
    for path in sorted((_HERE / "sql").glob("*.sql")):
        text = path.read_text(encoding="utf-8")
        first, _, sql = text.partition("\n")
        found[path.stem] = Canned(path.stem, first.removeprefix("-- "), sql.strip())
    return found


def view(name: str) -> str:
    """The portable SELECT of a view."""
    return (_HERE / "views" / f"{name}.sql").read_text(encoding="utf-8")


class QueryRows(NamedTuple):
    """Rows with the names of their columns."""

    columns: tuple[str, ...]
    rows: Sequence[tuple[object, ...]]


class DecisionQuery(NamedTuple):
    """Conditions on decisions; None is any. `since` and `until` are UTC in us, `until` excluded."""

    vehicle: str | None = None
    mission: str | None = None
    skill: str | None = None
    outcome: str | None = None
    reason: str | None = None
    rule: str | None = None
    clause: str | None = None
    policy: str | None = None
    policy_version: int | None = None
    since: int | None = None
    until: int | None = None
    witness: str | None = None

    def sql(self) -> str:
        """The condition on `decided`."""
        return matching(**self._asdict())


def matching(**values: object) -> str:
    """The condition that columns have these values; None is any. `_FORMS` holds those that are compared otherwise."""
    given = {name: value for name, value in values.items() if value is not None}
    terms = (_FORMS.get(name, f"{name} = {{0}}").format(quoted(value)) for name, value in given.items())
    return " AND ".join(terms) or "TRUE"


#: records hold the index of a step, from 0; people number steps from 1
_NUMBER: Final = ", CASE WHEN step >= 0 THEN step + 1 END AS step_number"
_ABOUT_STEPS: Final = frozenset({"decisions", "effects"})


class ArchiveReader:
    """A read-only connection to an archive."""

    def __init__(self, folder: ArchiveFolder, conditions: DecisionQuery | None = None) -> None:
        self._engine = duckdb.connect()
        try:
            self._begin(folder, conditions or DecisionQuery())
        except duckdb.Error as error:
            text = f"the index of `{folder.path}` cannot be read: {' '.join(str(error).split())}"
            raise Untrusted("archive-index", text) from None

    def _begin(self, folder: ArchiveFolder, conditions: DecisionQuery) -> None:
        engine = self._engine
        if not folder.catalogue.exists():
            raise Untrusted("no-archive", f"`{folder.path}` is an empty archive: no log was added yet")
        engine.execute(f"CREATE VIEW logs AS SELECT * FROM read_parquet({quoted(folder.catalogue)})")
        parts = engine.execute("SELECT DISTINCT part FROM logs WHERE part <> '' ORDER BY part").fetchall()
        if not all(is_digest(part, 32) for (part,) in parts):
            raise misleading(folder)
        for table in TABLES:
            files = ", ".join(
                quoted(folder.table(table) / f"{part}.parquet") for part in (NOTHING, *(p for (p,) in parts))
            )
            number = _NUMBER if table in _ABOUT_STEPS else ""
            engine.execute(f"CREATE VIEW {table} AS SELECT *{number} FROM read_parquet([{files}])")
        for name in VIEWS:
            where = conditions.sql() if name == "decided" else "TRUE"
            engine.execute(f"CREATE VIEW {name} AS SELECT * FROM ({view(name)}) v WHERE {where}")
        engine.execute(f"SET allowed_directories = [{quoted(folder.path / 'index')}]")
        engine.execute(f"SET temp_directory = {quoted(folder.scratch)}")
        engine.execute("SET enable_external_access = false")
        engine.execute("SET lock_configuration = true")

    def ask(self, sql: str, limit: int | None = None) -> QueryRows:
        """The result of one SELECT. Raises `Untrusted` (`malformed`) for anything else, and for an invalid one."""
        try:
            statements = duckdb.extract_statements(sql)
            if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
                raise Untrusted("malformed", "an archive query must be a single SELECT statement")
            cursor = self._engine.execute(statements[0])
            columns = tuple(column[0] for column in cursor.description or ())
            rows = cursor.fetchall() if limit is None else cursor.fetchmany(limit)
        except duckdb.Error as error:
            said = str(error).partition("\n\nLINE ")[0]  # the rest repeats the query, with a caret under it
            raise Untrusted("malformed", " ".join(said.split())) from None
        return QueryRows(columns, rows)

    def close(self) -> None:
        """Close the connection."""
        self._engine.close()
