"""Proofs of records, and receipts: each accepted one must be true of one of the logs."""

from random import Random

from reference import proof_mutations

MAX_LENGTH = 40_000


def seeds() -> tuple[bytes, ...]:
    return proof_mutations.proofs()


def mutated(data: bytes, of: Random) -> bytes:
    """Change its bytes, its lines, or the parts of its content."""
    return proof_mutations.changed(data, of)


def one(data: bytes) -> None:
    proof_mutations.check(data)
