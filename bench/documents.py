"""How long a document delays the loop of a flight: valid, refused, or garbage of the maximum size.

Measured is the time from the event to the answer in `Runtime.step`, including the record. A replacement is verified in
advance, as `rtshcua run` does in another thread; that time is printed separately. Because of noise, percentiles are
those of the quietest of `BLOCKS` blocks. Exits with 1 when the 95th percentile of any kind is above the limit, which is
the limit from a frame to a fallback.
"""

import sys
from pathlib import Path
from time import perf_counter_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from msgspec.structs import replace

from reference.documents import approval, low, replacement, shorter
from reference.flat_case import ISSUED
from reference.world import MISSION_KEY, START, Run, renewed
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Presented, Reply
from rtshcua.wire import cose, names
from rtshcua.wire.document import MAX_DOCUMENT
from rtshcua.wire.keys import Duty

LIMIT_US = 5_000.0
BLOCKS, ROUNDS = 11, 40
OF = low()


def took_us(of: Loaded, document: bytes, slug: str, *, ahead: bool = False) -> tuple[float, float]:
    """Return the time of a step with a document, and the time of its verification in advance."""
    run = Run(of, ready=False)
    begin = perf_counter_ns()
    if ahead:
        of.boundary.consider(document, START)
    looked = perf_counter_ns()
    actions = run.runtime.step(START, [Presented(0, document)])
    end = perf_counter_ns()
    (reply,) = [action for action in actions if isinstance(action, Reply)]
    assert reply.slug == slug, reply
    return (end - looked) / 1e3, (looked - begin) / 1e3


def measured(name: str, document: bytes, slug: str, *, ahead: bool = False) -> float:
    """Measure and print one kind; return its 95th percentile."""
    blocks = [sorted(took_us(renewed(OF), document, slug, ahead=ahead) for _ in range(ROUNDS)) for _ in range(BLOCKS)]
    best = min(blocks, key=lambda block: block[ROUNDS * 95 // 100])
    high = best[ROUNDS * 95 // 100][0]
    besides = f", ahead of it {best[ROUNDS // 2][1] / 1e3:.1f} ms" if ahead else ""
    print(f"documents: {name}: median {best[ROUNDS // 2][0]:.0f} us, p95 {high:.0f} us{besides}")
    return high


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    content_type = names.REPLACEMENT.content_type
    large = cose.sign1(bytes(MAX_DOCUMENT - 200), key=MISSION_KEY, duty=Duty.MISSION, content_type=content_type)
    damaged = large[:-1] + bytes([large[-1] ^ 1])
    later = replace(shorter(OF), issued_at_us=ISSUED + 1)
    highs = [
        measured("an approval", approval(OF), "accepted"),
        measured("a replacement of the last steps", replacement(OF, 2, later), "accepted", ahead=True),
        measured("garbage, as large as is read", b"\xd2\x84" + bytes(MAX_DOCUMENT - 2), "malformed"),
        measured("a false signature over as much", damaged, "bad-signature", ahead=True),
    ]
    print(f"documents: p95 is at most {max(highs) / LIMIT_US:.2f} of the limit ({LIMIT_US:.0f} us)")
    return int(max(highs) > LIMIT_US)


if __name__ == "__main__":
    sys.exit(main())
