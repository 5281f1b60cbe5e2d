"""The boundary's digest: the octets of entries are those of docs/log-format.md, section 7."""

from collections.abc import Callable
from hashlib import sha256

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.model.flat.situation import Now
from rtshcua.wire import boundary_chain
from rtshcua.wire.boundary_chain import MARK_BYTES, MOST_MARKS, START, BoundaryChain, Tag, after_frame, following
from rtshcua.wire.preparation import ParameterWrite
from rtshcua.wire.response import NO_TARGET
from virtual.rows import rows

NOW = Now(3, 5, 7)


def test_a_digest_follows_from_the_one_before_and_the_entry() -> None:
    octets = b"rtshcua/boundary\0" + START + b"\x02" + b"\0\0\0\x03" + b"abc"
    assert following(START, Tag.DECIDED, b"abc") == sha256(octets).digest()
    octets = b"rtshcua/boundary-frames\0" + START + b"\x0a" + b"\0\0\0\x01" + b"f"
    assert after_frame(START, b"f") == sha256(octets).digest()


@rows(
    ("payload", "octets"),
    [
        (
            boundary_chain.begin(9, b"b" * 32, b"f" * 16, b"d" * 32, enforced=True),
            bytes(7) + b"\x09" + b"b" * 32 + b"f" * 16 + b"d" * 32 + b"\x01",
        ),
        (boundary_chain.decided(b"request", 3, 17, 6, 2, -1, 1), b"\x03\x11\x06\0\x02" + b"\xff" * 8 + b"\x01request"),
        (boundary_chain.decided(b"", 0, 0, 8, NO_TARGET, 1, 0), b"\0\0\x08\xff\xff" + bytes(7) + b"\x01\0"),
        (boundary_chain.undecided(2, b"d" * 32), b"\x02" + b"d" * 32),
        (
            boundary_chain.document(1, -1, NOW, b"d" * 32),
            b"\x01\xff\xff" + b"".join(n.to_bytes(8) for n in (3, 5, 7)) + b"d" * 32,
        ),
        (boundary_chain.sent(1, 2, -5, 4, 5), b"\x01\0\x02\xff\xff" + (4).to_bytes(8) + (5).to_bytes(8)),
        (boundary_chain.refused("permit/late", 5), (5).to_bytes(8) + b"permit/late"),
        (
            boundary_chain.prepared([ParameterWrite("AB", 1, 2)], restoring=True),
            b"\x01\x01AB" + bytes(14) + b"\0\0\0\x01\0\0\0\x02",
        ),
        (boundary_chain.unprepared("permit/used"), b"permit/used"),
    ],
)
def test_payloads(payload: bytes, octets: bytes) -> None:
    assert payload == octets


def test_entries_are_counted_and_marked_since_the_last_marks() -> None:
    chain = BoundaryChain()
    digests = [chain.add(Tag.REFUSED, bytes([number])) for number in range(3)]
    assert (chain.count, chain.digest) == (3, digests[-1])
    assert chain.marks() == b"".join(digest[:MARK_BYTES] for digest in digests)
    assert chain.marks() == b""
    for _ in range(MOST_MARKS + 5):
        chain.add(Tag.REFUSED, b"")
    assert len(chain.marks()) == MARK_BYTES * MOST_MARKS
    assert chain.count == MOST_MARKS + 8


CHANGES: dict[str, tuple[Callable[[BoundaryChain], object], str]] = {
    "repeated": (lambda chain: chain.repeat(b"x"), "aside"),
    "declined": (lambda chain: chain.decline(b"x"), "aside"),
    "stopped": (lambda chain: chain.stop(b"x"), "aside"),
    "ahead": (lambda chain: chain.sign_ahead(b"x"), "aside"),
    "frames": (lambda chain: chain.leave(b"x"), "left"),
}


@pytest.mark.parametrize("counter", CHANGES)
def test_counted_events_change_only_aside_digest(counter: str) -> None:
    change, digest = CHANGES[counter]
    chain = BoundaryChain()
    before = chain.add(Tag.UNPREPARED, b"")
    change(chain)
    assert (chain.digest, chain.count, getattr(chain, counter)) == (before, 1, 1)
    others = {"aside", "left"} - {digest}
    assert getattr(chain, digest) != START
    assert all(getattr(chain, other) == START for other in others)


@given(st.lists(st.tuples(st.sampled_from(list(Tag)), st.binary(max_size=9)), max_size=6, unique=True))
def test_no_other_entries_have_its_digest(entries: list[tuple[Tag, bytes]]) -> None:
    seen = {}
    for order in (entries, entries[::-1], entries[1:]):
        chain = BoundaryChain()
        for entry in order:
            chain.add(*entry)
        assert seen.setdefault(chain.digest, order) == order
