"""The cost of a witness: on the ground, of each checkpoint and of a log from a file; on board, in the thread that
submits lines.

Ratios within one run. A checkpoint needs at least one signature verification and one signature; a log from a file, one
SHA-256 of all octets; submitting, one SHA-256 of each line. Because of noise, each figure is the best of `BLOCKS`.
Exits with 1 when a ratio is above its limit.
"""

import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference.witnessed import WITNESSES, Judge, Log
from rtshcua.evidence.witnessing.submission import Submission, Survey, survey
from rtshcua.evidence.witnessing.witness import CosignRequest, decode
from rtshcua.wire.keys import Duty

EPOCHS, RECORDS, BLOCKS = 40, 1_024, 5
DETAIL = "x" * 200
#: a checkpoint, relative to verifying and making one signature
CHECKPOINT = 2.5
#: a log from a file, relative to its SHA-256
FILE = 8.0
#: a submitted line, relative to its SHA-256
SHOWN = 6.0


def best_s(work: Callable[[], object]) -> float:
    """Return the shortest of several runs."""
    times = []
    for _ in range(BLOCKS):
        begin = perf_counter()
        work()
        times.append(perf_counter() - begin)
    return min(times)


def told(name: str, us: float, ratio: float, limit: float, of: str) -> bool:
    """Print a figure; return whether it is above its limit."""
    print(f"witness: {name}: {us:.1f} us, {ratio:.2f} times {of} (limit {limit:g})")
    return ratio > limit


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    log = Log()
    for _ in range(EPOCHS):
        for _ in range(RECORDS):
            log.add(log.recorder.effect(log.now(), "said", detail=DETAIL))
        log.seal()
    requests, known = [], None
    for size in log.submission._sizes:
        request = log.submission.request(known, size + 1)
        assert request is not None
        requests.append(request.encode())
        known = size

    def cosign_all() -> None:
        witness = Judge()
        for data in requests:
            request = decode(data)
            assert isinstance(request, CosignRequest)
            assert isinstance(witness.consider(request), str)

    key, data = WITNESSES[0], bytes(300)
    public, signature = key.verification(), key.sign(data, duty=Duty.WITNESS)

    def sign_all() -> None:
        for _ in requests:
            # `consider` of the tests reads its own cosignature back, as the vehicle does: two are verified
            public.verify(signature, data)
            public.verify(signature, data)
            key.sign(data, duty=Duty.WITNESS)

    def show_all() -> None:
        submission = Submission()
        for line in log.lines:
            submission.take(line)

    def hash_all() -> None:
        for line in log.lines:
            sha256(line).digest()

    whole, count = b"".join(log.lines), len(log.lines)
    assert isinstance(survey(log.lines), Survey)
    over = [
        told("one checkpoint, and read back aboard", (cosigned := best_s(cosign_all)) / len(requests) * 1e6,
             cosigned / best_s(sign_all), CHECKPOINT, "its signatures"),
        told("a record of a log by file", (surveyed := best_s(lambda: survey(log.lines))) / count * 1e6,
             surveyed / best_s(lambda: sha256(whole).digest()), FILE, "SHA-256 of the file"),
        told("a record that is shown in flight", (shown := best_s(show_all)) / count * 1e6,
             shown / best_s(hash_all), SHOWN, "SHA-256 of the line"),
    ]  # fmt: skip
    sizes = sorted(map(len, requests[1:]))
    print(f"witness: a request has {sizes[len(sizes) // 2]} octets, {sizes[-1]} at most")
    return int(any(over))


if __name__ == "__main__":
    sys.exit(main())
