"""`rtshcua check` of policies with many rules of several kinds: the time per rule among many and among few.

Exits with 1 when the time per rule grows too much from `FEW` to `MANY`, or when `MANY` take longer than the limit.
"""

import sys
from pathlib import Path
from statistics import median
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference.many_rules import KINDS, policy
from rtshcua import library
from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect

FEW, MANY = 1_250, 5_000
SPREAD = 1.6  # the greatest growth of the time per rule
LIMIT_S = 5.0
ROUNDS = 3


def seconds(text: str) -> float:
    """Return the time to read and check a source."""

    def read(path: str) -> bytes:
        return text.encode() if path == "many.rts" else Path(path).read_bytes()

    start = process_time()
    examine_program(load(["many.rts"], read, str(library.root()), parse=parse), dialect.load())
    return process_time() - start


def main() -> int:
    """Measure each kind; return 1 if a limit is missed."""
    failed = False
    seconds(policy("apart", 10))
    for kind in KINDS:
        few = median(seconds(policy(kind, FEW)) for _ in range(ROUNDS))
        many = min(seconds(policy(kind, MANY)) for _ in range(ROUNDS))
        spread = many / few * FEW / MANY
        failed |= spread > SPREAD or many > LIMIT_S
        print(
            f"many rules: {kind}: a rule takes {spread:.2f} times as long among {MANY:,} as among {FEW:,}, limit "
            f"{SPREAD:g} ({many:.2f} s, limit {LIMIT_S:g} s)"
        )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
