"""The proofs in tests/vectors/proof, byte for byte, because their format is stable. `UPDATE_GOLDENS=1` writes them."""

import os
from collections.abc import Callable
from pathlib import Path

from reference.proof_mutations import check, cosigned
from reference.sealed_log import LOG_KEY, PIN, sealed_log, sign
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.make import (
    prove_consistency,
    prove_inclusion,
    receipt_of,
    with_cosignatures,
)
from virtual.rows import rows

VECTORS = Path(__file__).resolve().parents[3] / "vectors" / "proof"
LOG = sealed_log(recovers=True)
LAST = len(LOG.lines) - 1


def anchored() -> bytes | Flaw:
    made = prove_inclusion(lambda: LOG.lines, 3)
    return made if isinstance(made, Flaw) else with_cosignatures(made, [cosigned(LOG)])


MADE: dict[str, Callable[[], bytes | Flaw]] = {
    "record-3.tlog-proof": lambda: prove_inclusion(lambda: LOG.lines, 3),
    "record-3-anchored.tlog-proof": anchored,
    f"record-{LAST}.record-proof": lambda: prove_inclusion(lambda: LOG.lines, LAST),
    "since-6.consistency-proof": lambda: prove_consistency(lambda: LOG.lines, 6),
    "record-3.cose": lambda: receipt_of(lambda: LOG.lines, 3, None, kid=LOG_KEY.kid, signer=sign),
    "log.jsonl": lambda: b"".join(LOG.lines),
    "root.key": lambda: PIN.hex().encode() + b"\n",
}


@rows("name", MADE)
def test_proofs_match_the_stored_vectors(name: str) -> None:
    made = MADE[name]()
    assert isinstance(made, bytes)
    if os.environ.get("UPDATE_GOLDENS") == "1":
        VECTORS.mkdir(parents=True, exist_ok=True)
        (VECTORS / name).write_bytes(made)
    assert made == (VECTORS / name).read_bytes()


@rows("name", [name for name in MADE if "." in name and name not in ("log.jsonl", "root.key")])
def test_a_proof_that_was_made_verifies(name: str) -> None:
    assert check((VECTORS / name).read_bytes()) == "true"


def test_all_proof_vectors_are_tested() -> None:
    assert {path.name for path in VECTORS.iterdir()} == set(MADE)
