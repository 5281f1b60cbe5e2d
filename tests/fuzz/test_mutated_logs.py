"""A million changed logs: no verifier accepts one as closed, fails, or uses much time or memory."""

import resource
import time
from functools import lru_cache
from random import Random

import pytest

from fuzz.mutation.logs import mutated
from reference import independent_verifier
from reference.forgery import flight, other_flight
from reference.log_mutants import REJECTED
from reference.log_vectors import recovered, sealed
from reference.verifiers import independent, quick_accepts
from rtshcua.evidence.verify import verify
from rtshcua.wire import keys

LOGS = (tuple(sealed()), tuple(recovered()[0]), flight(), other_flight())
SAMPLE, SHARDS, SHARD = 400, 40, 25_000
LIMIT_S = 2.0  # of CPU, for one log
LIMIT_KB = 200 << 10  # the allowed growth of the process for a shard


@pytest.fixture(autouse=True)
def signatures_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether a key made a signature is asked again and again for the same: remembered, so that others get a turn."""
    for module, name in ((keys, "verified"), (independent_verifier, "holds")):
        monkeypatch.setattr(module, name, lru_cache(maxsize=4096)(getattr(module, name)))


def split(data: bytes) -> list[bytes]:
    *lines, rest = data.split(b"\n")
    return [line + b"\n" for line in lines] + ([rest] if rest else [])


def campaign(seed: int, count: int, every: int) -> dict[str, int]:
    """Count changed logs by verdict; the independent verifier checks every nth."""
    of = Random(seed)
    found: dict[str, int] = {}
    for turn in range(count):
        lines = of.choice(LOGS)
        data = mutated(lines, of.choice(LOGS), of)
        if data == b"".join(lines):
            continue
        begun = time.perf_counter()
        report, quick = verify(split(data)), quick_accepts(data)
        if time.perf_counter() - begun > LIMIT_S:  # repeat, in case the machine was slow
            begun = time.process_time()
            verify(split(data)), quick_accepts(data)
            assert time.process_time() - begun < LIMIT_S, (seed, turn)
        word = report.verdict.value
        assert word != "verified", (seed, turn)
        assert not quick, (seed, turn)
        if turn % every == 0:
            other = independent(data)
            # The line by line verifier asks nobody whom to trust: what is sound in itself may be untrusted.
            assert (word, other) in REJECTED | {("incomplete", "untrusted")}, (seed, turn, report.failure)
        slug = report.failure.slug if report.failure else word
        found[slug] = found.get(slug, 0) + 1
    return found


@pytest.mark.claim("T3", drawn="from seeds")
@pytest.mark.slow
def test_some_mutated_logs() -> None:
    found = campaign(1, SAMPLE, 1)
    assert sum(found.values()) > SAMPLE * 0.95
    assert len(found) > 15, found


@pytest.mark.claim("T3", drawn="from seeds")
@pytest.mark.soak
@pytest.mark.parametrize("shard", range(SHARDS))
def test_a_million_mutated_logs(shard: int) -> None:
    campaign(1_000 + shard, 200, 10)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = campaign(2_000 + shard, SHARD, 10)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < LIMIT_KB
    print(shard, grown, sorted(found.items()))
