"""Evidence: the cost of appending a decision, by durability class.

`written` (class 1) is the work of the runtime and its writer: record, encoding, chain, leaf, and one `write` to the
file; its reference is `hashlib`'s SHA-256 of the same bytes. `synced first` (class 3) is the same with `fdatasync`; its
reference is a plain write and `fdatasync` of the same bytes to another file. `buffered` (class 0) is printed for
comparison. Each figure and its reference are measured in turns, so that noise affects both; for the disk the least of
several rounds counts. Exits with 1 when a figure is above its limit. Verification: bench/verify.py.
"""

import gc
import os
import sys
import tempfile
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from statistics import mean, median, quantiles
from time import perf_counter_ns

from rtshcua.adapters.store.evidence_file import EvidenceFile
from rtshcua.adapters.store.writing import sync_data
from rtshcua.evidence.log_writer import Recorder
from rtshcua.model.decision import Decision
from rtshcua.model.durability import BUFFERED, SYNCED_FIRST, WORDS, WRITTEN
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.request import Ref

RECORDS = 20_000
SYNCED_RECORDS = 150
ROUNDS = 4
BLOCK = 1_000
#: On a machine that takes `SHA_US` for SHA-256 of one record (one with SHA-NI); on another one in proportion.
LIMIT_US = {50: 5.0, 95: 10.0, 99: 20.0}
SHA_US = 0.95
LIMIT_OF_SHA = 6.0
LIMIT_OF_SYNC = 1.1

KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
STATE = State((8_700, 20_000, 3, 4_100, 9_000, 110_000, -20_000, None), (12_000, 80_000, 90_000, 400_000, 7, 8, 9, 0))
CONTEXT = Context(bytes(32), "quad-07", 7, 0, 123_456_789, 1, 12_000, ())


def now(number: int) -> Now:
    """Two milliseconds a record."""
    return Now(5_000_000 + number * 2_000, 1_750_000_000_000_000 + number * 2_000, 1_000)


def decision(recorder: Recorder, at: Now, number: int, durability: int) -> bytes:
    """One decision of about 700 bytes."""
    answer = Decision(Outcome.ALLOW, Reason.ADMITTED, 8, None, None, None, 7_000_000)
    return recorder.decision(at, Ref(0, number & 7, -1), bytes(16), STATE, CONTEXT, answer, durability)


def begin(path: Path) -> tuple[Recorder, EvidenceFile]:
    """A log with its genesis, of a bundle of 8 KiB."""
    recorder = Recorder(lambda text: KEY.sign(text, duty=Duty.LOG), KEY.public, lambda: os.urandom(32))
    genesis = recorder.genesis(
        now(0), bundle=bytes(8192), root=bytes(800), boot=bytes(16), vehicle="quad-07", mission="m", mode="software"
    )
    file = EvidenceFile(path)
    file.append(genesis, SYNCED_FIRST)
    return recorder, file


def append(path: Path, durability: int) -> tuple[list[int], list[int], list[int]]:
    """The nanoseconds of each append, of hashing the same line, and of each seal."""
    recorder, file = begin(path)
    appended, hashed, sealed = [], [], []
    for number in range(1, RECORDS + 1):
        at = now(number)
        start = perf_counter_ns()
        line = decision(recorder, at, number, durability)
        file.append(line, durability)
        middle = perf_counter_ns()
        sha256(line).digest()
        hashed.append(perf_counter_ns() - middle)
        appended.append(middle - start)
        if recorder.due(at):
            start = perf_counter_ns()
            seal = recorder.seal(at)
            sealed.append(perf_counter_ns() - start)
            file.append(seal, WRITTEN)
    file.append(recorder.close(now(RECORDS), ending="completed", tlog=None), WRITTEN)
    file.close()
    return appended, hashed, sealed


def synced(folder: Path) -> tuple[list[int], list[int]]:
    """Return the nanoseconds of each synced append, and of a plain write and sync of the same bytes."""
    folder.mkdir()
    recorder, file = begin(folder / "synced")
    bare = os.open(folder / "bare", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    line = b""

    def ours() -> None:
        nonlocal line
        line = decision(recorder, now(number), number, SYNCED_FIRST)
        file.append(line, SYNCED_FIRST)

    def theirs() -> None:
        os.write(bare, line)
        sync_data(bare)

    times: dict[Callable[[], None], list[int]] = {ours: [], theirs: []}
    for number in range(1, SYNCED_RECORDS + 1):
        for work in (ours, theirs) if number % 2 else (theirs, ours):  # the second write may find less to sync
            start = perf_counter_ns()
            work()
            times[work].append(perf_counter_ns() - start)
    os.close(bare)
    file.close()
    return times[ours], times[theirs]


def percentile_us(times: list[int], percent: int) -> float:
    """Return a percentile of nanoseconds, in microseconds: the median over blocks."""
    blocks = [times[start : start + BLOCK] for start in range(0, len(times), BLOCK)]
    return median(quantiles(block, n=100)[percent - 1] for block in blocks) / 1_000


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    gc.disable()
    failed = False
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_DIR")) as name:
        folder = Path(name)
        append(folder / "warm", WRITTEN)
        for durability in (WRITTEN, BUFFERED):
            path = folder / WORDS[durability]
            appended, hashed, sealed = append(path, durability)
            size = path.stat().st_size // RECORDS
            print(f"append, {WORDS[durability]}, {size} bytes a record; a seal {median(sealed) / 1_000:.0f} us")
            sha = percentile_us(hashed, 50)
            print(f"  SHA-256 of a record takes {sha:.2f} us here; limits are in proportion to {SHA_US} us")
            for percent, limit_us in LIMIT_US.items():
                took, limit = percentile_us(appended, percent), limit_us / SHA_US
                limit = min(limit, LIMIT_OF_SHA) if percent == 50 else limit
                failed = failed or (durability == WRITTEN and took > limit * sha)
                print(f"  P{percent} {took:6.2f} us, {took / sha:5.2f} x SHA-256 (limit {limit:.2f})")
        ratios = []
        for number in range(ROUNDS):
            appended, peers = synced(folder / str(number))
            ratios.append(mean(appended) / mean(peers))
            ours, theirs = mean(appended) / 1_000, mean(peers) / 1_000
            print(f"append, synced first: {ours:.0f} us, {ratios[-1]:.2f} x write and fdatasync ({theirs:.0f} us)")
        failed = failed or min(ratios) > LIMIT_OF_SYNC
        print(f"  the least of these counts, limit {LIMIT_OF_SYNC}")
    print("above a limit" if failed else "all limits held")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
