"""The text of an embedded log, and redacted logs, against naive readers."""

import gzip
import json
import re
from base64 import b64decode, b64encode

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.forgery import flight, leaf, read
from reference.independent_verifier import merkle
from rtshcua.ground.drawing.html import visibly
from rtshcua.ground.flight import embedding
from rtshcua.ground.flight.embedding import MOST_OCTETS, embed, extract, redact, script


@given(st.binary(max_size=5_000))
def test_embedded_octets_come_back(data: bytes) -> None:
    text = embed(data)
    assert text == embed(data)
    assert re.fullmatch(r"[A-Za-z0-9+/]+={0,2}", text)
    assert extract(text) == data == gzip.decompress(b64decode(text))


def test_embedded_text_contains_neither_time_nor_name() -> None:
    assert b64decode(embed(b"log"))[:10] == bytes.fromhex("1f8b08000000000000ff")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "cannot be decompressed|cut off"),
        ("!", "not base64"),
        (embed(b"log") + "\n", "not base64"),
        (b64encode(b64decode(embed(b"log"))[:-1]).decode(), "cut off"),
        (b64encode(b64decode(embed(b"log")) + b"x").decode(), "followed by something"),
        (b64encode(b64decode(embed(b"log")) * 2).decode(), "followed by something"),
        (b64encode(b64decode(embed(b"log"))[:-8] + bytes(8)).decode(), "cannot be decompressed"),
    ],
)
def test_other_texts_are_refused(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        extract(text)


def test_sizes_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    text = embed(bytes(1_001))
    monkeypatch.setattr(embedding, "MOST_OCTETS", 1_000)
    with pytest.raises(ValueError, match="more than 1000 octets"):
        extract(text)
    with pytest.raises(ValueError, match="the limit is 1000"):
        embed(bytes(1_001))


@pytest.mark.parametrize("checkpoints", [False, True])
def test_redacted_log_has_all_leaves_and_only_the_lines_that_may_stay(checkpoints: bool) -> None:
    lines = flight()
    found = json.loads(redact(lines, lambda line: read(line)["type"] == "effect", checkpoints=checkpoints))
    leaves = [leaf(line) for line in lines]
    assert [b64decode(each) for each in found["leaves"]] == leaves
    assert b64decode(found["root"]) == merkle(leaves)
    assert found["lines"] == [[n, line.decode()[:-1]] for n, line in enumerate(lines) if read(line)["type"] == "effect"]
    notes = [[n, read(line)["checkpoint"]] for n, line in enumerate(lines) if "checkpoint" in read(line)]
    assert found["checkpoints"] == (notes if checkpoints else [])


def test_script_is_self_contained_and_has_the_same_limit() -> None:
    text = script()
    assert "</script" not in text.lower()
    assert "<!--" not in text
    assert visibly(text) == text  # no invisible character, which a page would replace, and break the digest
    own = text[text.index("Verifies an evidence log") :]
    for word in (
        r"\beval\b",
        r"\bFunction\(",
        r"\bfetch\(",
        "XMLHttpRequest",
        "innerHTML",
        "outerHTML",
        r"\bimport\b",
        "document.write",
    ):
        assert not re.search(word, own), word
    (limit,) = re.findall(r"const MOST_OCTETS = 2 \*\* (\d+);", own)
    assert 2 ** int(limit) == MOST_OCTETS
