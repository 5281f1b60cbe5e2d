"""What the signed close of a log proves, checked against the tree of the lines that were read."""

from rtshcua.evidence.chain import origin_of
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle import Tree, leaf_hash
from rtshcua.evidence.note import open_note
from rtshcua.evidence.records import Close, Genesis, encode, unsigned
from rtshcua.wire.keys import Duty, VerificationKey


def check_close(close: Close, genesis: Genesis, tree: Tree) -> Flaw | None:
    """What is wrong with a close after the records in `tree`, or None; the close's own leaf is then pushed."""
    if close.count != tree.size:
        return Flaw("close/count", "the close miscounts the records before it", str(close.count), str(tree.size))
    if close.checkpoint is None:
        return Flaw("close/unsigned", "the close bears no signature")
    origin = origin_of(genesis.vehicle, genesis.boot)
    checkpoint = open_note(close.checkpoint, origin, VerificationKey(Duty.LOG, bytes.fromhex(genesis.log_key)))
    if isinstance(checkpoint, Flaw):
        return checkpoint
    if checkpoint.origin != origin:
        return Flaw("close/origin", "the signature is for another log", checkpoint.origin, origin)
    tree.push(leaf_hash(encode(unsigned(close))))
    if checkpoint.size != tree.size:
        text = "the signature is for another number of records"
        return Flaw("close/size", text, str(tree.size), str(checkpoint.size))
    root = tree.root()
    if checkpoint.root != root:
        text = "these are not the records that were signed: at least one was changed, and the chain written anew"
        return Flaw("close/root", text, root.hex(), checkpoint.root.hex())
    return None
