"""The catalogue: a row a log, in one Parquet file that each change replaces as a whole."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, get_args

import duckdb
import msgspec

from rtshcua.adapters.archive.entry import Entry
from rtshcua.adapters.archive.folder import NOTHING, TABLES, Folder
from rtshcua.adapters.store.writing import publish, replacing

#: names and SQL types of the columns, in their order
COLUMNS: Final = {
    field.name: "BIGINT" if int in (field.type, *get_args(field.type)) else "VARCHAR"
    for field in msgspec.structs.fields(Entry)
}
_SPECIFIED: Final = "{" + ", ".join(f"{name}: '{kind}'" for name, kind in COLUMNS.items()) + "}"


def read(folder: Folder) -> dict[str, Entry]:
    """The rows by log."""
    if not folder.catalogue.exists():
        return {}
    with duckdb.connect() as engine:
        rows = engine.execute(f"SELECT {', '.join(COLUMNS)} FROM read_parquet(?)", [str(folder.catalogue)]).fetchall()
    return {row[0]: Entry(*row) for row in rows}


def write(folder: Folder, entries: Iterable[Entry]) -> None:
    """Puts these rows in the place of all that were there, in one step."""
    fresh = folder.scratch / "logs.parquet"
    with as_lines(entries, folder.scratch / "logs.jsonl") as rows, duckdb.connect() as engine:
        read = f"read_ndjson(?, columns={_SPECIFIED})" if rows.stat().st_size else _empty()
        copy = f"COPY (SELECT * FROM {read} ORDER BY begun_us, log) TO {quoted(fresh)} (FORMAT parquet)"
        engine.execute(copy, [str(rows)] if rows.stat().st_size else [])
    publish(fresh, folder.catalogue)


@contextmanager
def as_lines(rows: Iterable[msgspec.Struct], place: Path) -> Iterator[Path]:
    """A file with rows for the engine to read, a line each; gone afterwards."""
    try:
        with replacing(place, synced=False) as handle, os.fdopen(handle, "wb", closefd=False) as file:
            file.writelines(msgspec.json.encode(row) + b"\n" for row in rows)
        yield place
    finally:
        place.unlink(missing_ok=True)


def forget_unfinished(folder: Folder, entries: dict[str, Entry]) -> None:
    """Removes the rows of records that a crash left, before the catalogue named them."""
    parts = {entry.part for entry in entries.values()}
    for table in TABLES:
        for path in folder.table(table).glob("*.parquet"):
            if path.stem not in parts and path.stem != NOTHING:
                path.unlink()


def quoted(value: object) -> str:
    """A text as SQL has it."""
    return "'" + str(value).replace("'", "''") + "'"


def _empty() -> str:
    return f"(SELECT {', '.join(f'CAST(NULL AS {kind}) AS {name}' for name, kind in COLUMNS.items())} LIMIT 0)"
