"""A million tampered proofs: no false one is accepted, and none crashes the verifier."""

from collections import Counter
from random import Random

import pytest

from reference import proof_mutations

SAMPLE = 700


def campaign(seed: int, count: int) -> Counter[str]:
    """Count the results."""
    of = Random(seed)
    return Counter(proof_mutations.check(proof_mutations.mutated(of)) for _ in range(count))


def test_every_seed_proof_verifies() -> None:
    assert {proof_mutations.check(proof) for proof in proof_mutations.proofs()} == {"true"}


def test_some_tampered_proofs() -> None:
    said = campaign(7, SAMPLE)
    assert {"proof/malformed", "proof/extra", "proof/record", "proof/path", "proof/signature", "proof/key"} <= set(said)
    assert said["true"] < SAMPLE * 0.16  # a mutation may have no effect, or give another true proof


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100))
def test_a_million_tampered_proofs(seed: int) -> None:
    campaign(1_000 + seed, 10_000)
