"""Proofs of one record, made from a stored tree and verified, compared with the cost of hashing.

`StoredTree` keeps 64 octets per record, appended with the records. A log has no stored tree: `rtshcua prove` reads it
twice instead, which is measured too. Because of noise, percentiles are those of the quietest block. Exits with 1 when
the median of an inclusion proof in a log of 65,536 records, or of its verification, is above the limit.
"""

import gc
import sys
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from random import Random
from statistics import quantiles
from time import perf_counter_ns

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference.sealed_log import PIN, sealed_log
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.merkle_proofs import StoredTree, verify_consistency, verify_inclusion
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.make import prove_inclusion

SIZE = 65_536
LIMIT_US = 30.0
BLOCKS, ROUNDS = 9, 1_000


def least_us(work: Callable[[int], object], numbers: list[int]) -> tuple[float, float]:
    """Return median and 99th percentile of the quietest block, in microseconds."""
    best = (float("inf"), float("inf"))
    for block in range(BLOCKS):
        times = []
        for number in numbers[block * ROUNDS : (block + 1) * ROUNDS]:
            start = perf_counter_ns()
            work(number)
            times.append(perf_counter_ns() - start)
        cuts = quantiles(times, n=100)
        best = min(best, (cuts[49] / 1_000, cuts[98] / 1_000))
    return best


def told(what: str, figures: tuple[float, float], peer_us: float, limit_us: float | None = None) -> bool:
    """Print a line; return whether its limit was exceeded."""
    limit = "" if limit_us is None else f", limit {limit_us:.0f} us"
    print(
        f"proofs: {what}: P50 {figures[0]:.1f} us, P99 {figures[1]:.1f} us{limit}; "
        f"{figures[0] / peer_us:.1f} times hashing its nodes ({peer_us:.1f} us)"
    )
    return limit_us is not None and figures[0] > limit_us


def in_a_tree(size: int) -> bool:
    """Measure inclusion and consistency proofs in a tree of so many records; return whether a limit was exceeded."""
    tree = StoredTree()
    leaves = [leaf_hash(b"%d\n" % number) for number in range(size)]
    start = perf_counter_ns()
    for leaf in leaves:
        tree.push(leaf)
    kept_us = (perf_counter_ns() - start) / size / 1_000
    print(f"proofs: {size} records: {len(tree.nodes) / size:.1f} octets and {kept_us:.2f} us a record to keep the tree")
    of, root = Random(1), tree.root()
    numbers = [of.randrange(1, size) for _ in range(BLOCKS * ROUNDS)]
    height, node = (size - 1).bit_length(), bytes(65)
    peer = least_us(lambda _: [sha256(node).digest() for _ in range(height)], numbers)[0]
    failed = told(f"inclusion in {size}, made", least_us(lambda n: tree.inclusion(n, size), numbers), peer, LIMIT_US)
    paths = {number: tree.inclusion(number, size) for number in numbers}
    verified = least_us(lambda n: verify_inclusion(leaves[n], n, size, paths[n], root), numbers)
    failed |= told(f"inclusion in {size}, verified", verified, peer, LIMIT_US)
    told(f"consistency with {size}, made", least_us(lambda n: tree.consistency(n, size), numbers), peer)
    older = {number: (tree.root(number), tree.consistency(number, size)) for number in numbers}
    done = least_us(lambda n: verify_consistency(n, older[n][0], size, root, older[n][1]), numbers)
    told(f"consistency with {size}, verified", done, 2 * peer)
    assert all(verify_inclusion(leaves[n], n, size, paths[n], root) for n in numbers)
    assert all(verify_consistency(n, older[n][0], size, root, older[n][1]) for n in numbers)
    return failed


def whole_files() -> None:
    """Measure a self-contained proof file: its size, and its verification with all signatures."""
    for epochs in (1, 16, 128):
        log = sealed_log(epochs=epochs, records=64)
        number = len(log.lines) - 2
        start = perf_counter_ns()
        data = prove_inclusion(partial(iter, log.lines), number)
        made_ms = (perf_counter_ns() - start) / 1e6
        assert isinstance(data, bytes)
        start = perf_counter_ns()
        assert isinstance(check_proof(data, PIN), Proven)
        checked_ms = (perf_counter_ns() - start) / 1e6
        print(
            f"proofs: a file from epoch {epochs}: {len(data)} octets, {made_ms:.1f} ms from the log of "
            f"{len(log.lines)} records, verified in {checked_ms:.1f} ms ({epochs + 2} signatures)"
        )


def main() -> int:
    """Measure and print; return 1 if a limit is missed."""
    gc.disable()
    failed = in_a_tree(SIZE)
    in_a_tree(SIZE - 1)
    whole_files()
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
