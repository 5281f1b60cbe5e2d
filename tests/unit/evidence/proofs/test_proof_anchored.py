"""Whether a proof is anchored, and which checkpoints witnesses may have cosigned."""

from reference.proof_mutations import cosigned
from reference.sealed_log import sealed_log
from rtshcua.evidence.proofs.make import cosigned_sizes, is_anchored, prove_inclusion, with_cosignatures

LOG = sealed_log()


def test_whether_a_proof_is_anchored() -> None:
    bare = prove_inclusion(lambda: LOG.lines, 3)
    assert isinstance(bare, bytes)
    assert not is_anchored(bare)
    assert is_anchored(with_cosignatures(bare, [cosigned(LOG)]))
    assert not is_anchored(with_cosignatures(bare, [cosigned(LOG, LOG.signed[-1])]))


def test_the_sizes_that_notes_are_of() -> None:
    notes = [cosigned(LOG), cosigned(LOG, LOG.signed[-1]), cosigned(LOG), "junk"]
    assert cosigned_sizes(notes) == {LOG.signed[1], LOG.signed[-1]}
    assert cosigned_sizes(["", "\n\n"]) == set()
