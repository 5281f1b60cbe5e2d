"""A hostile link: one million datagrams of somebody without the key, and what they cost and change.

Garbage, cut and turned frames, replays, spoofed ids, unsigned and wrongly signed frames of every message, and several
of them in one datagram, to a driver that knows its vehicle: half of them on a link with a key, under the vehicle's own
ids too, half on one without, under other ids. Nothing is raised and nothing is sent; all that driver, boundary and link
remember is compared before and after. Then frames of the vehicle's own, rightly signed: what they cost. Exits with 1
when anything changed, or when a hostile datagram costs more than a good frame.
"""

import sys
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from hostile.attacker import Attacker
from hostile.target import Target, greeting

DATAGRAMS = 1_000_000
BLOCK = 10_000
LIMIT = 1.0
GOOD = 50_000


def attack(flavour: str, *, keyed: bool, datagrams: int) -> float:
    """Seconds of the processor that the hostile datagrams took."""
    target = Target(flavour, keyed=keyed)
    attacker = Attacker(target.heard, seed=datagrams + keyed, impersonate=keyed)
    before, took = target.known(), 0.0
    for _ in range(datagrams // BLOCK):
        block = [attacker.datagram() for _ in range(BLOCK)]
        start = process_time()
        for datagram in block:
            target.receive(datagram)
        took += process_time() - start
        assert target.known() == before, "something was believed"
    assert target.sent == [], "something was answered"
    assert target.events == [], "something was told"
    return took


def good(flavour: str) -> float:
    """Seconds for a rightly signed frame of the vehicle's own."""
    target = Target(flavour, keyed=True)
    messages = greeting(flavour)
    frames = [target.says(messages[number % len(messages)]) for number in range(GOOD)]
    target.heard.clear()
    start = process_time()
    for frame in frames:
        target.receive(frame)
    took = process_time() - start
    assert target.link.counts.accepted >= GOOD
    return took / GOOD


def main() -> int:
    """Measures, prints, and says whether the limit held."""
    worst = 0.0
    for flavour in ("px4", "ardupilot"):
        own = good(flavour)
        for keyed in (True, False):
            each = attack(flavour, keyed=keyed, datagrams=DATAGRAMS // 4) / (DATAGRAMS // 4)
            worst = max(worst, each / own)
            print(
                f"hostile link: {DATAGRAMS // 4} datagrams to {flavour}, {'with' if keyed else 'without'} a key: "
                f"nothing changed; {each * 1e6:.1f} us each, a good frame {own * 1e6:.1f} us"
            )
    print(f"hostile link: {DATAGRAMS} datagrams; one costs at most {worst:.2f} good frames, limit {LIMIT:.0f}")
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
