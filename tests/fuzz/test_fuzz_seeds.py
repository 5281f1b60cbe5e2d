"""Earlier fuzzing findings stay fixed, and each target accepts its seeds."""

import time
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any

import pytest

from fuzz import corpus

TARGETS = sorted(path.stem for path in (Path(__file__).parent / "targets").glob("*.py"))
KEPT = [(target, path) for target in TARGETS for path in corpus.kept(target)]
#: how many seeds of each target are tried, and changed once
SAMPLE = 4
#: CPU seconds for one input
LIMIT = 10


def target_of(name: str) -> Any:
    return import_module(f"fuzz.targets.{name}")


@pytest.mark.parametrize(("target", "seed"), KEPT, ids=[f"{target}-{path.name}" for target, path in KEPT])
def test_fuzz_finding_stays_fixed(target: str, seed: Path) -> None:
    begun = time.process_time()
    target_of(target).one(seed.read_bytes())
    assert time.process_time() - begun < LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_fuzz_target_accepts_its_seeds(name: str) -> None:
    target = target_of(name)
    of = Random(name)
    seeds = [seed for seed in target.seeds() if len(seed) <= target.MAX_LENGTH]
    assert seeds
    for seed in of.sample(seeds, min(SAMPLE, len(seeds))):
        target.one(seed)
        target.one(target.mutated(seed, of))


def test_kept_seeds_belong_to_a_target() -> None:
    assert {path.name for path in corpus.SEEDS.iterdir() if path.is_dir()} <= set(TARGETS)
