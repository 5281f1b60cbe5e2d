"""Proofs forged by somebody who has logs and their proofs: each is refused for the expected reason."""

from base64 import b64decode, b64encode
from collections.abc import Callable

from reference.proof_parts import (
    OTHER,
    consistency,
    inclusion,
    slug_of_receipt,
)
from reference.sealed_log import PIN
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.check import check_proof
from rtshcua.wire import cbor
from virtual.rows import rows


def test_reassembled_proof_verifies() -> None:
    for parts in (inclusion(3), inclusion(18), consistency(6)):
        assert parts.slug() == "believed"


def test_a_field_of_the_record_is_edited() -> None:
    parts = inclusion(3)
    parts.extra["record"] = parts.extra["record"].replace(b'"token":3', b'"token":4')
    assert parts.slug() == "proof/path"


def test_another_record_of_the_log_takes_its_place() -> None:
    parts, other = inclusion(3), inclusion(4)
    parts.extra["record"] = other.extra["record"]
    assert parts.slug() == "proof/record"
    parts.number = other.number
    assert parts.slug() == "proof/path"


def test_the_place_is_another() -> None:
    parts = inclusion(3)
    parts.number = "index 4"
    assert parts.slug() == "proof/record"


def test_noncanonical_record_is_rejected() -> None:
    parts = inclusion(3)
    parts.extra["record"] = parts.extra["record"].replace(b'"seq":3', b'"seq": 3')
    assert parts.slug() == "proof/record"
    parts.extra["record"] = inclusion(3).extra["record"][:-1]
    assert parts.slug() == "proof/record"


def test_tree_node_is_not_accepted_as_record() -> None:
    """A second preimage: leaves and nodes are hashed with different prefixes, and a record is JSON."""
    parts = inclusion(3)
    parts.extra["record"] = b64decode(parts.path[0]) * 2
    assert parts.slug() == "proof/record"


def test_invalid_hash_in_path_is_rejected() -> None:
    for wrong in ("AAAA", "junk!", parts_of_path(31), parts_of_path(33), parts_of_path(32).replace("=", "")):
        parts = inclusion(3)
        parts.path[1] = wrong
        assert parts.slug() == "proof/malformed"


def parts_of_path(length: int) -> str:
    return b64encode(bytes(length)).decode()


@rows("change", [lambda path: path[:-1], lambda path: path[1:], lambda path: path[::-1],
    lambda path: [*path, path[-1]], lambda path: [path[0], *path], lambda _: []])  # fmt: skip
def test_the_path_is_another(change: Callable[[list[str]], list[str]]) -> None:
    parts = inclusion(3)
    parts.path = change(parts.path)
    assert parts.slug() == "proof/path"


def test_the_path_and_the_record_of_another_log() -> None:
    parts, other = inclusion(3), inclusion(3, OTHER)
    parts.extra["record"], parts.path = other.extra["record"], other.path
    assert parts.slug() == "proof/path"


def test_the_checkpoint_of_another_log() -> None:
    parts, other = inclusion(3), inclusion(3, OTHER)
    parts.note, parts.extra["signed"] = other.note, other.extra["signed"]
    assert parts.slug() == "proof/key"


def test_an_older_checkpoint_that_does_not_have_the_record() -> None:
    parts, older = inclusion(8), inclusion(3)
    parts.note, parts.extra["signed"], parts.extra["chain"] = older.note, older.extra["signed"], older.extra["chain"]
    assert parts.slug() == "proof/path"


def test_garbage_is_rejected_as_proof_and_receipt() -> None:
    for data in (
        b"",
        b"\xd2",
        b"\xd2\x80",
        b"junk",
        b"\xff\xfe",
        b"c2sp.org/tlog-proof@v1\n",
        b"\n\n",
        b"\x00" * 64,
        b"c2sp.org/tlog-proof@v1\nextra \n\n",
        b"c2sp.org/tlog-proof@v1\nextra \nold 3\n\n",
    ):
        assert slug_of_receipt(data) == "proof/malformed"
        checked = check_proof(data, PIN)
        assert isinstance(checked, Flaw)
        assert checked.slug == "proof/malformed"


def test_a_file_that_is_too_long_is_not_read() -> None:
    checked = check_proof(bytes(33 << 20), PIN)
    assert isinstance(checked, Flaw)
    assert checked.slug == "proof/too-long"


def test_proof_with_invalid_record_is_rejected() -> None:
    for extra in (b"", b"\x80", cbor.encode(("rtshcua/proof", 2, {})), cbor.encode(("rtshcua/proof", 1, {})),
                  cbor.encode(("rtshcua/proof", 1, {**inclusion(3).extra, "fields": ()}))):  # fmt: skip
        parts = inclusion(3)
        lines = parts.together().decode().split("\n")
        lines[1] = f"extra {b64encode(extra).decode()}"
        checked = check_proof("\n".join(lines).encode(), PIN)
        assert isinstance(checked, Flaw)
        assert checked.slug == "proof/extra"
