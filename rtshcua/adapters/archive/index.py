"""The index of an archive: the catalogue with a row for each log, and the rows of their records, as Parquet files.

Each change replaces the whole catalogue. DuckDB reads the lines of verified logs itself, and writes a part of each
table of records. The verifier has read every line before, in its one canonical form, so the same octets have the same
meaning here. The number of records is checked again.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Final, get_args

import duckdb
import msgspec
from msgspec.structs import replace

from rtshcua.adapters.archive.entry import ArchiveEntry, StepRecords, VerifiedLog
from rtshcua.adapters.archive.folder import NOTHING, TABLES, ArchiveFolder
from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.writing import PRIVATE_FOLDER, publish, replacing
from rtshcua.evidence.reading import LONGEST
from rtshcua.wire.untrusted import Untrusted

#: the fields that are read of a line, with their SQL types
_FIELDS: Final = {
    "BIGINT": (
        "at_us", "durability", "epoch", "kind", "link", "records", "rule_step", "seq", "step", "token", "utc_error_us",
        "utc_us",
    ),
    "VARCHAR": ("checkpoint", "clause", "detail", "event", "outcome", "reason", "target", "type"),
    "STRUCT(policy_version BIGINT)": ("context",),
    "BIGINT[]": ("clause_at",),
}  # fmt: skip
_KINDS: Final = {name: kind for kind, names in _FIELDS.items() for name in names}
_DIGITS: Final = frozenset("0123456789abcdef")
_LOG: Final = "string_split(filename, '/')[-2]"
_LONGEST_DETAIL: Final = 1_000  # characters; the log has the rest

_DAY: Final = "strftime(make_timestamp(r.utc_us), '%Y-%m-%d') AS utc_day"
_SKILL: Final = """
    LEFT JOIN steps s ON r.log = s.log AND r.kind = s.kind AND r.step = s.step AND r.link = s.link
         AND r.seq >= s.first AND r.seq < s.until"""
_ROWS: Final = {
    "decisions": f"""
        SELECT r.log, r.seq, e.vehicle, e.mission, e.policy, r.context.policy_version AS policy_version, r.at_us,
               r.utc_us, r.utc_error_us, {_DAY}, r.kind, r.step, r.link, s.skill, s.what, r.outcome, r.reason,
               split_part(r.reason, '/', 1) AS rule, r.rule_step, r.clause, r.clause_at[1] AS clause_source,
               r.clause_at[2] AS clause_start, r.target, r.durability
        FROM raw r JOIN entries e ON r.log = e.log {_SKILL} WHERE r.type = 'decision' ORDER BY r.log, r.seq""",
    "effects": f"""
        SELECT r.log, r.seq, e.vehicle, e.mission, r.at_us, r.utc_us, r.utc_error_us, {_DAY}, r.event,
               substr(r.detail, 1, {_LONGEST_DETAIL}) AS detail, r.kind, r.step, r.link, s.skill, r.token, r.durability
        FROM raw r JOIN entries e ON r.log = e.log {_SKILL} WHERE r.type = 'effect' ORDER BY r.log, r.seq""",
    "seals": f"""
        SELECT r.log, r.seq, e.vehicle, e.boot, r.type, r.utc_us, {_DAY}, coalesce(r.epoch, -1) AS epoch,
               coalesce(r.records, 0) AS records, split_part(r.checkpoint, chr(10), 3) AS root,
               split_part(r.checkpoint, chr(10), 4) AS self
        FROM raw r JOIN entries e ON r.log = e.log WHERE r.checkpoint IS NOT NULL ORDER BY r.log, r.seq""",
}  # fmt: skip


def _engine() -> duckdb.DuckDBPyConnection:
    """A shared engine for small queries, because making one takes longer; objects made in a cursor end with it."""
    return _engine_of(os.getpid())


@cache
def _engine_of(_process: int) -> duckdb.DuckDBPyConnection:
    """The engine of one process: one that a fork took over waits for ever for threads that it does not have. It caches
    no file: the catalogue is replaced under the same name.
    """
    return duckdb.connect(config={"enable_external_file_cache": "false"})


def read_catalogue(folder: ArchiveFolder) -> dict[str, ArchiveEntry]:
    """The rows by log. Raises `Untrusted` (`archive-index`) where one leads out of the archive."""
    if not folder.catalogue.exists():
        return {}
    names = ", ".join(ArchiveEntry.__struct_fields__)
    with _engine().cursor() as engine:
        rows = engine.execute(f"SELECT {names} FROM read_parquet(?)", [str(folder.catalogue)]).fetchall()
    entries = {row[0]: ArchiveEntry(*row) for row in rows}
    for each in entries.values():
        if not (is_digest(each.log, 64) and (each.part == "" or is_digest(each.part, 32))):
            raise misleading(folder)
    return entries


def is_digest(found: object, characters: int) -> bool:
    """Whether a name that leads to files is valid: hexadecimal digits of this number."""
    return isinstance(found, str) and len(found) == characters and set(found) <= _DIGITS


def misleading(folder: ArchiveFolder) -> Untrusted:
    """The error for an index that is not used."""
    return Untrusted("archive-index", f"the index of `{folder.path}` refers to files outside of the archive")


def write_catalogue(folder: ArchiveFolder, entries: Iterable[ArchiveEntry]) -> None:
    """Replace all rows by these, atomically."""
    fresh = folder.scratch / "logs.parquet"
    with _engine().cursor() as engine:
        _load(engine, "logs", ArchiveEntry, entries, folder.scratch)
        engine.execute(f"COPY (SELECT * FROM logs ORDER BY begun_us, log) TO {quoted(fresh)} (FORMAT parquet)")
    publish(fresh, folder.catalogue, folder.path)


def forget_unfinished(folder: ArchiveFolder, entries: dict[str, ArchiveEntry]) -> None:
    """Remove rows of records that a crash left before the catalogue named them."""
    parts = {entry.part for entry in entries.values()}
    for path in folder.parts():
        if path.stem not in parts and path.stem != NOTHING:
            path.unlink()


def quoted(value: object) -> str:
    """A number or a text as an SQL literal."""
    return str(value) if isinstance(value, int) else "'" + str(value).replace("'", "''") + "'"


def ingest(folder: ArchiveFolder, examined: Sequence[VerifiedLog]) -> list[ArchiveEntry]:
    """Write a part with the rows of these logs, and return their entries, which name it. The caller then writes the
    catalogue.
    """
    sound = [each for each in examined if each.entry.indexed]
    if not sound:
        return [each.entry for each in examined]
    part = sha256("".join(sorted(each.entry.log for each in sound)).encode()).hexdigest()[:32]
    with duckdb.connect() as engine:
        engine.execute(f"SET temp_directory = {quoted(folder.scratch)}")
        _load(engine, "entries", ArchiveEntry, (each.entry for each in sound), folder.scratch)
        _load(engine, "steps", StepRecords, (step for each in sound for step in each.steps), folder.scratch)
        with _files(folder, sound) as files:
            _read(engine, files)
        _count(engine)
        for table in TABLES:
            _write(engine, folder, table, part)
    return [replace(each.entry, part=part) if each.entry.indexed else each.entry for each in examined]


def lay_out(folder: ArchiveFolder) -> None:
    """Write a part without rows, so that every table has its columns from the beginning."""
    if all((folder.table(table) / f"{NOTHING}.parquet").exists() for table in TABLES):
        return
    with _engine().cursor() as engine:
        _load(engine, "entries", ArchiveEntry, (), folder.scratch)
        _load(engine, "steps", StepRecords, (), folder.scratch)
        types = ", ".join(f"{name} {kind}" for name, kind in _KINDS.items())
        engine.execute(f"CREATE TEMP TABLE raw (log VARCHAR, {types})")
        for table in TABLES:
            _write(engine, folder, table, NOTHING)


def _write(engine: duckdb.DuckDBPyConnection, folder: ArchiveFolder, table: str, part: str) -> None:
    fresh = folder.scratch / f"{table}.parquet"
    engine.execute(f"COPY ({_ROWS[table]}) TO {quoted(fresh)} (FORMAT parquet, COMPRESSION zstd)")
    publish(fresh, folder.table(table) / f"{part}.parquet", folder.path)


def _read(engine: duckdb.DuckDBPyConnection, files: list[str]) -> None:
    """Load the lines to index, without records that no signature covers yet."""
    engine.execute(
        f"CREATE TEMP TABLE raw AS SELECT l.* EXCLUDE (filename) FROM (SELECT *, {_LOG} AS log FROM read_ndjson("
        f"?, columns={_columns(_KINDS)}, filename=true, maximum_object_size={LONGEST + 1})) l "
        "JOIN entries e ON l.log = e.log WHERE l.seq < e.indexed",
        [files],
    )


def _count(engine: duckdb.DuckDBPyConnection) -> None:
    wrong = engine.execute(
        "SELECT e.log FROM entries e LEFT JOIN (SELECT log, count(*) AS found, count(DISTINCT seq) AS numbers FROM raw "
        "GROUP BY log) r ON e.log = r.log WHERE r.found IS DISTINCT FROM e.indexed OR r.numbers <> r.found"
    ).fetchone()
    if wrong is not None:
        raise RuntimeError(f"the query engine did not read the verified records of log {wrong[0]}")


def _load(
    engine: duckdb.DuckDBPyConnection, name: str, form: type[msgspec.Struct], rows: Iterable[msgspec.Struct],
    scratch: Path,
) -> None:  # fmt: skip
    """Make a table in the engine, with a column for each field of the rows."""
    kinds = {
        field.name: "BIGINT" if int in (field.type, *get_args(field.type)) else "VARCHAR"
        for field in msgspec.structs.fields(form)
    }
    place = scratch / f"{name}.jsonl"
    try:
        _write_lines(place, (msgspec.json.encode(row) + b"\n" for row in rows))
        read = f"CREATE TEMP TABLE {name} AS SELECT * FROM read_ndjson(?, columns={_columns(kinds)})"
        engine.execute(read, [str(place)])
    finally:
        place.unlink(missing_ok=True)


def _columns(kinds: Mapping[str, str]) -> str:
    """Names and SQL types in the form of the engine's readers."""
    return "{" + ", ".join(f"{name}: '{kind}'" for name, kind in kinds.items()) + "}"


def _write_lines(place: Path, data: Iterable[bytes]) -> None:
    with replacing(place, synced=False) as handle, os.fdopen(handle, "wb", closefd=False) as file:
        file.writelines(data)


@contextmanager
def _files(folder: ArchiveFolder, sound: Sequence[VerifiedLog]) -> Iterator[list[str]]:
    """The logs to read; for one that ends inside a line, a copy of its whole lines."""
    copies: list[Path] = []
    files = []
    for each in sound:
        path = folder.log(each.entry.log)
        if each.entry.finding == "tail/torn":
            copy = folder.scratch / each.entry.log / path.name
            copy.parent.mkdir(PRIVATE_FOLDER)
            with open_regular(path, folder.path) as whole:
                _write_lines(copy, (line for line in lines(whole) if line.endswith(b"\n")))
            copies.append(copy)
            path = copy
        files.append(str(path))
    try:
        yield files
    finally:
        for copy in copies:
            copy.unlink()
            copy.parent.rmdir()
