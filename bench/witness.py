"""What a witness costs: on the ground, of each checkpoint and of a log by file; aboard, in the thread that shows it.

Ratios within one run. A checkpoint costs at least one signature to verify and one to make; a log handed over as a file,
one SHA-256 of all its octets; showing it, one of each line. The machine is noisy: each figure is the best of `BLOCKS`.
Exits with 1 when one is above its limit.
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
#: a checkpoint, as times of verifying and making one signature
CHECKPOINT = 2.5
#: a log by file, as times of its SHA-256
FILE = 8.0
#: a line that is shown, as times of its SHA-256
SHOWN = 6.0


def best_s(work: Callable[[], object]) -> float:
    """The shortest of several."""
    times = []
    for _ in range(BLOCKS):
        begin = perf_counter()
        work()
        times.append(perf_counter() - begin)
    return min(times)


def told(name: str, us: float, ratio: float, limit: float, of: str) -> bool:
    """Prints a figure, and says whether it is above its limit."""
    print(f"witness: {name}: {us:.1f} us, {ratio:.2f} times {of} (limit {limit:g})")
    return ratio > limit


def main() -> int:
    """Measures, prints, and says whether the limits held."""
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
