"""Proofs of records, and receipts: nothing is believed that is not true of one of the logs that they are of."""

from random import Random

from reference import proof_mutations

MAX_LENGTH = 40_000


def seeds() -> tuple[bytes, ...]:
    return proof_mutations.proofs()


def mutated(data: bytes, of: Random) -> bytes:
    """Its octets, its lines, or the parts of what it carries are changed."""
    return proof_mutations.changed(data, of)


def one(data: bytes) -> None:
    proof_mutations.check(data)
