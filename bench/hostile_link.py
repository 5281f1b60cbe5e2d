"""A hostile link: the cost and effect of one million datagrams from an attacker without the key.

Garbage, truncated and reversed frames, replays, spoofed ids, unsigned and wrongly signed frames of every message, also
several in one datagram, to a driver that knows its vehicle: half of them on a link with a key, also under the vehicle's
own ids, half on a link without a key, under other ids. No exception is raised and no frame is sent; the state of
driver, boundary and link is compared before and after. Then the cost of the vehicle's own signed frames is measured.
Exits with 1 when any state changed, or when a hostile datagram costs more than a valid frame.
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
    """Return the processor time of the hostile datagrams, in seconds."""
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
    """Return the time of a signed frame of the vehicle, in seconds."""
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
    """Measure and print; return 1 if a limit is missed."""
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
