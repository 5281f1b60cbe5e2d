"""Archive: adding, verifying and querying a fleet's logs, compared with hashing and reading the same files.

200 generated logs of 10 vehicles (real format, seals and trust), 1 million records; with `--whole` 1,000 logs of 50
vehicles, 10 million records, which need 15 GB of temporary space. One log was changed after it was written, one in a
hundred was never closed, and one is missing. References: the SHA-256 of the files by OpenSSL in one process; for
queries the same engine over the raw lines, without an index. Ratios are of processor time, because elapsed time
depends on other load. LOGS=FOLDER keeps the logs for the next run. Exits with 1 when a figure is above its limit.
"""

import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from hashlib import file_digest
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from time import perf_counter
from typing import NamedTuple

import duckdb

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference import generated_logs
from rtshcua.adapters.archive.adding import Done, VerificationOptions, add, verify
from rtshcua.adapters.archive.asking import ArchiveReader, DecisionQuery, canned
from rtshcua.adapters.archive.entry import RECORDS, VerifiedLog
from rtshcua.adapters.archive.examine import Task, VerifierProcesses
from rtshcua.adapters.archive.folder import ArchiveFolder, LogSource

FLIGHTS = 20
VEHICLES, EACH = 10, 5_000  # records of a log
ADD_LIMIT, VERIFY_LIMIT = 30, 16  # times the SHA-256 of the files, in time of processors
ASK_LIMIT = 1 / 4  # of what reading the lines costs, without an index
MISSING, CHANGED = (3, 5), (7, 11)  # vehicle and flight
CORES = len(os.sched_getaffinity(0))


def vehicle(folder: Path, number: int, records: int) -> None:
    """Make the logs of one vehicle's flights, each linked to the previous one."""
    before = None
    for flight in range(FLIGHTS):
        path = folder / f"quad-{number:02}-{flight:02}.jsonl"
        before = generated_logs.write(
            path, f"quad-{number:02}", flight, records=records, version=7 if flight < 12 else 8, before=before,
            ending=None if (number * FLIGHTS + flight) % 100 == 99 else "completed",
        )  # fmt: skip
        if (number, flight) == MISSING:
            path.unlink()
        if (number, flight) == CHANGED:
            with path.open("r+b") as file:
                file.seek(path.stat().st_size // 2)
                octet = file.read(1)
                file.seek(-1, 1)
                file.write(bytes([octet[0] ^ 1]))


def generate(folder: Path, vehicles: int, records: int) -> list[Path]:
    """Make the fleet's logs."""
    folder.mkdir(parents=True)
    with ProcessPoolExecutor(CORES, mp_context=get_context("fork")) as pool:
        list(pool.map(vehicle, [folder] * vehicles, range(vehicles), [records] * vehicles))
    return sorted(folder.glob("*.jsonl"))


class Cost(NamedTuple):
    """Elapsed time, and processor time of this process and its ended children, in seconds."""

    clock: float
    cpu_of_others: float
    own_cpu: float

    @property
    def cpu(self) -> float:
        """The total processor time, in seconds."""
        return self.cpu_of_others + self.own_cpu

    def since(self) -> "Cost":
        """Return the difference from an earlier measurement."""
        return Cost(*(after - before for before, after in zip(self, spent(), strict=True)))


def spent() -> Cost:
    """Return the times so far."""
    others, own = getrusage(RUSAGE_CHILDREN), getrusage(RUSAGE_SELF)
    return Cost(perf_counter(), others.ru_utime + others.ru_stime, own.ru_utime + own.ru_stime)


class Timed(VerifierProcesses):
    """Verifying processes, with the elapsed time of waiting for them."""

    waited = 0.0

    def examine(self, tasks: Sequence[Task]) -> Iterator[VerifiedLog]:
        start = perf_counter()
        done = list(super().examine(tasks))
        self.waited += perf_counter() - start
        return iter(done)


def checked(work: Callable[[VerificationOptions], Iterator[Done]], jobs: int) -> tuple[Cost, Cost]:
    """Measure the archive and the verification in it, with so many processes, and check the result."""
    start = spent()
    with closing(Timed(jobs)) as workers:
        done = list(work(VerificationOptions(generated_logs.ROOT_KEY, RECORDS, 0, workers)))
    cost = start.since()
    counts = Counter(each.entry.status for each in done)
    unclosed = (len(done) + 1) // 100
    assert counts == Counter(verified=len(done) - 1 - unclosed, incomplete=unclosed, failed=1), counts
    return cost, Cost(workers.waited, spent().cpu_of_others - start.cpu_of_others, 0)


def hashing(logs: list[Path]) -> Cost:
    """Measure the SHA-256 of the files."""
    start = spent()
    for log in logs:
        with log.open("rb") as file:
            file_digest(file, "sha256")
    return start.since()


def without_index(logs: list[Path]) -> Cost:
    """Measure how long the engine takes to count refusals in the raw lines."""
    start = spent()
    duckdb.execute(
        "SELECT context.vehicle, reason, count(*) FROM read_ndjson(?, columns={type: 'VARCHAR', outcome: 'VARCHAR', "
        "reason: 'VARCHAR', context: 'STRUCT(vehicle VARCHAR)'}, maximum_object_size=67108865, ignore_errors=true) "
        "WHERE outcome <> 'allow' GROUP BY ALL",
        [[str(log) for log in logs]],
    ).fetchall()
    return start.since()


def ask(folder: ArchiveFolder, unindexed: Cost) -> bool:
    """Run every shipped query; return whether one exceeded its limit."""
    slow = False
    questions = [(each.name, each.sql, DecisionQuery()) for each in canned().values()]
    some = DecisionQuery(vehicle="quad-07", skill="goto", reason="state", policy_version=8)
    questions.append(("refused, of one vehicle, skill, reason and version", canned()["refused"].sql, some))
    for name, sql, conditions in questions:
        start = spent()
        asker = ArchiveReader(folder, conditions)
        rows = asker.ask(sql).rows
        asker.close()
        cost = start.since()
        part = cost.cpu / unindexed.cpu
        slow |= part > ASK_LIMIT
        print(f"archive query {name}: {cost.clock * 1e3:.0f} ms, {len(rows)} rows; {part:.4f} of reading the lines")
        if name == "missing":
            assert len(rows) == 2, rows  # after the log that is not there, and after the one that was changed
    return slow


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    whole = "--whole" in sys.argv
    vehicles, each = (50, 10_000) if whole else (VEHICLES, EACH)
    records = vehicles * FLIGHTS * each
    failed = False
    with tempfile.TemporaryDirectory() as name:
        start = spent()
        made = Path(os.environ.get("LOGS", name)) / "logs"
        logs = sorted(made.glob("*.jsonl")) or generate(made, vehicles, each)
        size = sum(log.stat().st_size for log in logs)
        took = f"generated in {start.since().clock:.0f} s"
        print(f"archive: {len(logs)} logs, {records} records, {size >> 20} MiB, {took}")
        peer = hashing(logs)
        folder = ArchiveFolder(Path(name) / "archive", make=True)

        def told(what: str, cost: Cost, limit: float) -> bool:
            ratio = cost.cpu / peer.cpu
            each_us = cost.cpu * 1e6 / records
            print(
                f"archive {what}: {cost.clock:.1f} s, of processors {cost.cpu:.1f} s, {each_us:.2f} us a "
                f"record; {ratio:.1f} times SHA-256 of the files ({peer.cpu:.1f} s), limit {limit}"
            )
            return ratio > limit

        added, verified = checked(lambda check: add(folder, map(LogSource, logs), check), max(2, CORES))
        failed |= told("add, verified and indexed", added, ADD_LIMIT)
        failed |= told("verification in it", verified, VERIFY_LIMIT)
        if not whole:
            many, _ = checked(lambda check: verify(folder, check), CORES)
            one, _ = checked(lambda check: verify(folder, check), 1)
            print(f"archive verify: {CORES} processes are {one.clock / many.clock:.2f} times as fast as one")
        index = sum(path.stat().st_size for path in (folder.path / "index").rglob("*.parquet"))
        print(f"archive index: {index >> 20} MiB, {index / size:.3f} of the logs")
        failed |= ask(folder, without_index(logs))
        peak = getrusage(RUSAGE_SELF).ru_maxrss >> 10, getrusage(RUSAGE_CHILDREN).ru_maxrss >> 10
        print(f"archive memory: {peak[0]} MiB at most, {peak[1]} MiB in a process that verifies")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
