"""Proofs and receipts with one part changed: each is refused for its reason."""

from base64 import b64encode
from collections.abc import Callable
from typing import Any

import pytest

from reference.proof_parts import (
    LOG,
    OTHER,
    THIEF,
    Parts,
    changed_root,
    consistency,
    inclusion,
    origin,
    receipt,
    signed,
    slug_of_receipt,
)
from reference.sealed_log import LOG_KEY, PIN
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.check import check_proof
from rtshcua.evidence.proofs.file import MAX_PROOF
from rtshcua.wire import cbor
from virtual import case
from virtual.rows import rows

Change = Callable[[Parts], None]


def body(note: str) -> str:
    return note.rpartition("\n\n")[0] + "\n"


def put(name: str, value: Any) -> Change:
    """Replace a part of the extra data."""

    def change(parts: Parts) -> None:
        parts.extra[name] = value

    return change


def number(text: str) -> Change:
    def change(parts: Parts) -> None:
        parts.number = text

    return change


def path(made: Callable[[list[str]], list[str]]) -> Change:
    def change(parts: Parts) -> None:
        parts.path = made(parts.path)

    return change


def note(made: Callable[[str], str]) -> Change:
    def change(parts: Parts) -> None:
        parts.note = made(parts.note)

    return change


def chain(made: Callable[[tuple[str, ...], Parts], tuple[str, ...]]) -> Change:
    def change(parts: Parts) -> None:
        parts.extra["chain"] = made(parts.extra["chain"], parts)

    return change


def named(name: str) -> Change:
    """The first checkpoint is in the name of another log."""

    def made(_: tuple[str, ...], parts: Parts) -> tuple[str, ...]:
        return (signed("\n".join([name, *parts.note.split("\n")[1:5], ""]), LOG_KEY, name),)

    return chain(made)


def renamed(_: tuple[str, ...], parts: Parts) -> tuple[str, ...]:
    """The log key signs another log in the name of this one."""
    first = parts.extra["chain"][0]
    mixed = body(first).replace(origin(LOG), origin(OTHER)).replace("\n0\n", "\n1\n")
    return (first, signed(mixed, LOG_KEY, origin(LOG)))


INCLUSION: list[tuple[Change, str]] = [
    (put("record", inclusion(4).extra["record"]), "proof/record"),
    (put("record", inclusion(3).extra["record"].replace(b'"token":3', b'"token":4')), "proof/path"),
    (put("record", inclusion(3).extra["record"][:-1]), "proof/record"),
    (put("signed", b"{}\n"), "proof/record"),
    (put("signed", inclusion(3).extra["record"]), "proof/signed"),
    (put("signed", inclusion(3).extra["signed"].replace(b'"epoch":0', b'"epoch":1')), "proof/signed"),
    (put("root", b"junk"), "trust/root-malformed"),
    (put("root", changed_root(vehicles=("quad-08",))), "trust/log-key"),
    (put("chain", ()), "trust/log-key"),
    (number("index x"), "proof/malformed"),
    (number("index 4"), "proof/record"),
    (path(lambda all: [b64encode(bytes(31)).decode(), *all[1:]]), "proof/malformed"),
    (path(lambda all: all[1:]), "proof/path"),
    (note(body), "proof/note"),
    (note(lambda text: signed(body(text), LOG_KEY, origin(LOG))), "proof/signed"),
    (note(lambda text: text + "\u2014 witness AAAA\n"), "proof/note"),
    (note(lambda text: text.replace("rtshcua", "other", 1)), "proof/signature"),
    (chain(lambda all, _: (signed(body(all[0]), THIEF, origin(LOG)),)), "trust/log-key"),
    (chain(lambda all, _: (*all, all[0])), "proof/chain"),
    (chain(lambda *_: (*inclusion(18).extra["chain"], inclusion(18).note)), "proof/chain"),
    (chain(renamed), "proof/chain"),
    (chain(lambda all, _: ("junk", *all)), "proof/note"),
    (named("rtshcua/log/x"), "proof/origin"),
    (named("rtshcua/log/x+y/z"), "proof/origin"),
]


@rows(("change", "slug"), INCLUSION)
def test_a_changed_proof_of_inclusion_is_refused(change: Change, slug: str) -> None:
    parts = inclusion(3)
    assert parts.slug() == "believed"
    change(parts)
    assert parts.slug() == slug


def test_partial_record_proof_is_refused() -> None:
    """Earlier versions made them: a holder of the last epoch's key could state other fields of any record."""
    parts = inclusion(3)
    parts.kind = "rtshcua/disclosure-proof@v1"
    assert parts.slug() == "proof/malformed"
    parts = inclusion(3)
    parts.extra["fields"] = (("type", (bytes(32), b"7")),)
    assert parts.slug() == "proof/extra"


def test_a_checkpoint_again_in_the_chain_is_refused() -> None:
    parts = inclusion(14)
    first, *rest = parts.extra["chain"]
    parts.extra["chain"] = (first, first, *rest)
    assert parts.slug() == "proof/chain"


@pytest.mark.parametrize(
    ("change", "slug"),
    [
        (number("old 7"), "proof/chain"),
        (path(lambda all: all[1:]), "proof/consistency"),
        (put("record", LOG.lines[3]), "proof/extra"),
        (put("record", b""), "proof/extra"),  # what is empty is left out
    ],
)
def test_a_changed_proof_of_consistency_is_refused(change: Change, slug: str) -> None:
    parts = consistency(6, 12)
    assert parts.slug() == "believed"
    change(parts)
    assert parts.slug() == slug


def test_checkpoint_record_is_only_proven_at_its_own_place() -> None:
    parts = inclusion(18)
    assert parts.slug() == "believed"
    parts.number = "index 17"
    assert parts.slug() == "proof/record"


@pytest.mark.parametrize(
    ("data", "slug"),
    [
        (bytes(MAX_PROOF + 1), "proof/too-long"),
        (b"\xff", "proof/malformed"),
        (b"junk", "proof/malformed"),
        (b"c2sp.org/tlog-proof@v1\n\n", "proof/malformed"),
        (b"c2sp.org/tlog-proof@v1\nextra \nindex 0\n\n", "proof/extra"),
    ],
)
def test_malformed_proof_file_is_refused(data: bytes, slug: str) -> None:
    found = check_proof(data, PIN)
    assert isinstance(found, Flaw)
    assert found.slug == slug


def test_noncanonical_proof_contents_are_refused() -> None:
    parts = inclusion(3)
    extra = b64encode(cbor.encode(("rtshcua/proof", 1, {**parts.extra, "fields": ()}))).decode()
    lines = parts.together().decode().split("\n")
    found = check_proof("\n".join([lines[0], f"extra {extra}", *lines[2:]]).encode(), PIN)
    assert isinstance(found, Flaw)
    assert found.slug == "proof/extra"


@rows(
    ("changed", "slug"),
    [
        ({"signature": 7}, "proof/malformed"),
        ({"protected": {395: 2}}, "proof/malformed"),
        ({"path": ()}, "proof/malformed"),
        ({"unprotected": {"more": 1}}, "proof/malformed"),
        ({"unprotected": {"rtshcua/record": b"{}"}}, "proof/record"),
        ({"unprotected": {"rtshcua/root": b"junk"}}, "trust/root-malformed"),
        ({"unprotected": {"rtshcua/root": changed_root(expires_us=case.flat.ISSUED)}}, "trust/log-key"),
        ({"protected": {4: THIEF.kid}, "sign_it": True}, "trust/log-key"),
        ({"protected": {15: {1: "elsewhere", 2: "6"}}, "sign_it": True}, "proof/origin"),
        ({"number": 2}, "proof/path"),
        ({"signature": bytes(64)}, "proof/signature"),
        ({"sign_it": True}, "believed"),
    ],
)
def test_a_changed_receipt_is_refused(changed: dict[str, Any], slug: str) -> None:
    assert slug_of_receipt(receipt(**changed)) == slug


@pytest.mark.parametrize("data", [b"", b"\xd2", b"\xd2\x80", b"junk"])
def test_malformed_receipt_is_refused(data: bytes) -> None:
    assert slug_of_receipt(data) == "proof/malformed"
