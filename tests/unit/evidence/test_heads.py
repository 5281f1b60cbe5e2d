"""The head of a log, compared with one computed line by line from docs/log-format.md, sections 1 and 3."""

from hashlib import sha256

from rtshcua.evidence.heads import START, Head
from rtshcua.evidence.merkle import leaf_hash, root_of
from virtual.rows import rows


@rows("count", [0, 1, 255, 256, 257, 700])
@rows("asked", [None, 0, 3, 256, 300])
def test_segment_digest_is_right_at_any_time(count: int, asked: int | None) -> None:
    head = Head()
    assert (head.seq, head.prev, head.epoch, head.octets) == (0, START, -1, 0)
    lines = [b"%d\n" % number for number in range(count)]
    head.begin(b"signed\n", b"its digest")
    for number, line in enumerate(lines):
        if number == asked:
            assert head.digest() == sha256(b"signed\n" + b"".join(lines[:number])).hexdigest()
        head.take(line)
    segment = b"signed\n" + b"".join(lines)
    assert (head.epoch, head.records, head.octets) == (0, count + 1, len(segment))
    assert head.digest() == sha256(segment).hexdigest()
    leaves = [leaf_hash(line) for line in (b"signed\n", *lines)]
    assert (head.prev, head.tree.root()) == (leaves[-1].hex(), root_of(leaves))
    assert head.after == b"its digest"
    head.begin(b"next\n", b"another")
    assert (head.epoch, head.records, head.octets) == (1, 1, 5)
    assert head.digest() == sha256(b"next\n").hexdigest()
