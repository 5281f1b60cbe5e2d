"""Evidence: appending a decision, and verifying a log, against SHA-256 of the same bytes by `hashlib`.

Append is what the runtime waits for: recorder, chain, Merkle tree and one buffered `os.write`. Verify is the chain,
the signature and the root; audit adds the derivation of every decision. Each figure is taken in turns with its peer,
so that a noisy machine slows both alike; the least of some rounds counts for verification. Exits with 1 when a figure
is above its limit.
"""

import gc
import sys
import tempfile
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from statistics import quantiles
from time import perf_counter_ns

from rtshcua.adapters.files.evidence import EvidenceFile
from rtshcua.evidence.chain import Recorder
from rtshcua.evidence.report import Verdict
from rtshcua.evidence.verify import verify
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty, SigningKey

RECORDS = 20_000
ROUNDS = 5
APPEND_LIMIT_US = {50: 40.75, 95: 56.46, 99: 152.88}  # the published figures
VERIFY_LIMIT_US = 13.96

KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
STATE = State((8_700, 20_000, 3, 4_100, 9_000, 110_000, -20_000, None), (12_000, 80_000, 90_000, 400_000, 7, 8, 9, 0))
CONTEXT = Context(bytes(32), "quad-07", 7, 0, 123_456_789, 1, 12_000, ())


def now(number: int) -> Now:
    """Two milliseconds a record."""
    return Now(5_000_000 + number * 2_000, 1_750_000_000_000_000 + number * 2_000, 1_000)


def decision(recorder: Recorder, number: int) -> bytes:
    """One decision of about 700 bytes."""
    return recorder.decision(
        now(number), kind=0, step=number & 7, link=-1, invocation=bytes(16), state=STATE, context=CONTEXT,
        outcome=Outcome.ALLOW, reason=Reason.ADMITTED, rule_step=8, clause=None, clause_at=None, target=None,
        target_link=-1, valid_until_us=7_000_000,
    )  # fmt: skip


def begin() -> tuple[Recorder, bytes]:
    """A recorder and the genesis of a bundle of 8 KiB."""
    recorder = Recorder(lambda text: KEY.sign(text, duty=Duty.LOG), KEY.public)
    genesis = recorder.genesis(
        now(0), bundle=bytes(8192), root=bytes(800), boot=bytes(16), vehicle="quad-07", mission="m", mode="software"
    )
    return recorder, genesis


def append(folder: Path) -> tuple[Path, list[int], list[int]]:
    """A log, and the nanoseconds of each append and of hashing the same line."""
    recorder, genesis = begin()
    file = EvidenceFile(folder / "log.jsonl")
    file.append(genesis, durable=False)
    appended, hashed = [], []
    for number in range(1, RECORDS):
        start = perf_counter_ns()
        line = decision(recorder, number)
        file.append(line, durable=False)
        middle = perf_counter_ns()
        sha256(line).digest()
        hashed.append(perf_counter_ns() - middle)
        appended.append(middle - start)
    file.append(recorder.close(now(RECORDS), ending="completed", tlog=None), durable=False)
    file.close()
    return file.path, appended, hashed


def least_us(work: Callable[[], None]) -> float:
    """Microseconds a record in the fastest of some rounds."""
    times = []
    for _ in range(ROUNDS):
        start = perf_counter_ns()
        work()
        times.append(perf_counter_ns() - start)
    return min(times) / 1_000 / (RECORDS + 1)


def check(path: Path) -> None:
    """Verifies the file as `verify-log` reads it."""
    with path.open("rb") as file:
        assert verify(file).verdict is Verdict.VERIFIED


def percentile_us(times: list[int], percent: int) -> float:
    """A percentile of nanoseconds, in microseconds."""
    return quantiles(times, n=100)[percent - 1] / 1_000


def main() -> int:
    """Measures, prints a line a figure, and says whether the limits held."""
    gc.disable()
    with tempfile.TemporaryDirectory() as name:
        path, appended, hashed = append(Path(name))
        size = Path(path).stat().st_size // (RECORDS + 1)
        failed = False
        for percent, limit in APPEND_LIMIT_US.items():
            took, peer = percentile_us(appended, percent), percentile_us(hashed, percent)
            failed |= took > limit
            print(
                f"evidence append, P{percent}: {took:.2f} us for {size} bytes, limit {limit} us; "
                f"{took / peer:.1f} times their SHA-256 ({peer:.2f} us)"
            )
        data = path.read_bytes()
        peer = least_us(lambda: sha256(data).digest() and None)
        took = least_us(lambda: check(path))
        failed |= took > VERIFY_LIMIT_US
        print(
            f"evidence verify: {took:.2f} us a record, limit {VERIFY_LIMIT_US} us; "
            f"{took / peer:.1f} times SHA-256 of the file ({peer:.2f} us a record)"
        )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
