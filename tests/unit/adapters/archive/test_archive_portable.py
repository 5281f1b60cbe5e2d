"""The shipped queries give the same answers on other engines over the same Parquet files.

SQLite is always there, fed with the rows. DataFusion (the engine under Ballista, which spreads queries over machines)
and ClickHouse (`chdb`) read the files themselves; they are tried where they are installed (group `engines`).
"""

import sqlite3
from collections.abc import Callable, Sequence

import pytest

from rtshcua.adapters.archive.asking import VIEWS, ArchiveReader, canned, view
from rtshcua.adapters.archive.folder import TABLES, ArchiveFolder

Rows = Sequence[Sequence[object]]
Engine = Callable[[str], Rows]


def sqlite(folder: ArchiveFolder) -> Engine:
    engine = sqlite3.connect(":memory:")
    asker = ArchiveReader(folder)
    for name in ("logs", *TABLES):
        answer = asker.ask(f"SELECT * FROM {name}")
        engine.execute(f"CREATE TABLE {name} ({', '.join(answer.columns)})")
        marks = ", ".join("?" * len(answer.columns))
        engine.executemany(f"INSERT INTO {name} VALUES ({marks})", answer.rows)
    asker.close()
    for name in VIEWS:
        engine.execute(f"CREATE VIEW {name} AS {view(name)}")
    return lambda sql: engine.execute(sql).fetchall()


def datafusion(folder: ArchiveFolder) -> Engine:
    engine = pytest.importorskip("datafusion").SessionContext()
    engine.register_parquet("logs", str(folder.catalogue))
    for name in TABLES:
        engine.register_parquet(name, str(folder.table(name)))
    for name in VIEWS:
        engine.sql(f"CREATE VIEW {name} AS {view(name)}")

    def ask(sql: str) -> Rows:
        return [tuple(row.values()) for row in engine.sql(sql).to_pylist()]

    return ask


def clickhouse(folder: ArchiveFolder) -> Engine:
    import json

    engine = pytest.importorskip("chdb.session").Session()
    engine.query("CREATE DATABASE archive; USE archive")
    engine.query(f"CREATE VIEW logs AS SELECT * FROM file('{folder.catalogue}', Parquet)")
    for name in TABLES:
        engine.query(f"CREATE VIEW {name} AS SELECT * FROM file('{folder.table(name)}/*.parquet', Parquet)")
    for name in VIEWS:
        engine.query(f"CREATE VIEW {name} AS {view(name)}")

    def ask(sql: str) -> Rows:
        settings = "SETTINGS join_use_nulls = 1, output_format_json_quote_64bit_integers = 0"
        return json.loads(str(engine.query(f"{sql} {settings}", "JSONCompact")))["data"]  # type: ignore[no-any-return]

    return ask


@pytest.mark.slow
@pytest.mark.parametrize("engine", [sqlite, datafusion, clickhouse], ids=lambda engine: engine.__name__)
def test_every_question_has_the_same_answer(engine: Callable[[ArchiveFolder], Engine], filled: ArchiveFolder) -> None:
    ask, asker = engine(filled), ArchiveReader(filled)
    try:
        for question in canned().values():
            wanted = [list(row) for row in asker.ask(question.sql).rows]
            assert [list(row) for row in ask(question.sql)] == wanted, question.name
    finally:
        asker.close()


def test_no_question_needs_more_than_standard_sql() -> None:
    """The queries contain no keyword that only some engines support."""
    own = ("QUALIFY", "LIMIT", "::", "GROUP BY ALL", "EXCLUDE", "FILTER (", "UNNEST", "ILIKE", "//", "STRFTIME")
    for question in canned().values():
        assert not [word for word in own if word in question.sql.upper()]
