"""Lines are those of RFC 8785, byte for byte, and only those are read back."""

from typing import get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import (
    LARGEST,
    AnyRecord,
    Close,
    DecisionRecord,
    Effect,
    RecordedContext,
    RecordedState,
    Recover,
    Seal,
    Signed,
    encode,
    unsigned,
)
from virtual.rows import rows

ESCAPES = {"\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r", '"': '\\"', "\\": "\\\\"}


def jcs(value: object) -> str:
    """RFC 8785, sections 3.2.2 and 3.2.3, for the values that a log has; written from the RFC alone."""
    match value:
        case None:
            return "null"
        case int():
            return str(value)
        case str():
            return '"' + "".join(ESCAPES.get(c) or (f"\\u{ord(c):04x}" if c < " " else c) for c in value) + '"'
        case list() | tuple():
            return "[" + ",".join(map(jcs, value)) + "]"
        case dict():
            keys = sorted(value, key=lambda key: key.encode("utf-16-be"))
            return "{" + ",".join(f"{jcs(key)}:{jcs(value[key])}" for key in keys) + "}"
    raise TypeError(value)


integers = st.integers(-LARGEST, LARGEST)
counts = st.integers(0, LARGEST)
texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
hashes = st.binary(min_size=32, max_size=32).map(bytes.hex)
effects = st.builds(
    Effect,
    hashes,
    counts,
    texts,
    st.integers(0, 3),
    texts,
    integers,
    integers,
    counts,
    integers,
    integers,
    st.just("effect"),
    counts,
    counts,
)
states = st.builds(
    RecordedState,
    ages=st.lists(integers).map(tuple),
    monitors=st.lists(integers).map(tuple),
    values=st.lists(st.none() | integers).map(tuple),
)
contexts = st.builds(
    RecordedContext,
    st.lists(st.tuples(integers, integers, integers, integers, integers), max_size=2).map(tuple),
    integers,
    integers,
    integers,
    integers,
    integers,
    texts,
)
decisions = st.builds(
    DecisionRecord,
    prev=hashes,
    at_us=counts,
    binding=hashes,
    clause=st.none() | texts,
    clause_at=st.none() | st.tuples(integers, integers, integers),
    context=contexts,
    durability=st.integers(0, 3),
    invocation=hashes,
    kind=integers,
    link=integers,
    mode=texts,
    outcome=st.sampled_from(["allow", "deny", "defer", "fallback"]),
    reason=texts,
    rule_step=integers,
    seq=counts,
    state=states,
    step=integers,
    target=st.none() | texts,
    target_link=integers,
    type=st.just("decision"),
    utc_error_us=counts,
    utc_us=counts,
    valid_until_us=integers,
)
closes = st.builds(
    Close,
    prev=hashes,
    at_us=counts,
    bytes=counts,
    checkpoint=st.none() | texts,
    digest=hashes,
    ending=texts,
    epoch=counts,
    records=counts,
    seq=counts,
    tlog=st.none() | hashes,
    type=st.just("close"),
    utc_error_us=counts,
    utc_us=counts,
)
segments = {
    **dict.fromkeys(("at_us", "bytes", "epoch", "records", "seq", "utc_error_us", "utc_us", "discarded_bytes"), counts),
    **dict.fromkeys(("prev", "digest", "next_key", "discarded_digest"), hashes),
}
recovers = st.builds(Recover, checkpoint=st.none() | texts, type=st.just("recover"), **segments)
del segments["discarded_bytes"], segments["discarded_digest"]
seals = st.builds(Seal, checkpoint=st.none() | texts, type=st.just("seal"), **segments)


@given(effects | decisions | closes | seals | recovers)
def test_a_line_is_canonical_and_reads_back(record: AnyRecord) -> None:
    line = encode(record)
    assert line == jcs(msgspec.to_builtins(record)).encode() + b"\n"
    assert read(line) == record


def test_a_state_names_its_temporal_monitors_only_where_there_are_any() -> None:
    """So that a log from before monitors existed is read unchanged."""
    bare = RecordedState(ages=(5,), values=(None,))
    assert msgspec.json.encode(bare) == b'{"ages":[5],"values":[null]}'
    some = RecordedState(ages=(5,), monitors=(1, 4), values=(None,))
    assert msgspec.json.encode(some) == b'{"ages":[5],"monitors":[1,4],"values":[null]}'
    assert msgspec.json.decode(msgspec.json.encode(bare), type=RecordedState) == bare


def test_fields_are_sorted_and_begin_with_a_lower_case_letter() -> None:
    for kind in (*get_args(AnyRecord), RecordedState, RecordedContext):
        names = kind.__struct_encode_fields__
        assert list(names) == sorted(names)
        assert all(name[0].islower() for name in names if name != "_prev")


@given(closes | seals | recovers)
def test_unsigned_is_the_record_without_its_checkpoint(close: Signed) -> None:
    signed = b'"checkpoint":' + jcs(close.checkpoint).encode()
    assert encode(unsigned(close)) == encode(close).replace(signed, b'"checkpoint":null')


GOOD = encode(Effect("0" * 64, 1, "d", 1, "e", 0, 0, 0, 0, 0, "effect", 3, 2))


@rows(
    ("line", "slug", "words"),
    [
        (b"", "record/malformed", "not a record"),
        (b"\xff\xfe\n", "record/malformed", "not a record"),
        (b'{"type":"effect"}\n', "record/malformed", "not a record"),
        (GOOD.replace(b"effect", b"effort"), "record/malformed", "not a record"),
        (GOOD.replace(b'"d"', b'"\xff"'), "record/malformed", "the line is not UTF-8"),
        (GOOD.replace(b'"at_us":1,', b""), "record/malformed", "object missing required field `at_us`"),
        (GOOD.replace(b"}", b',"z":1}'), "record/malformed", "object contains unknown field `z`"),
        (GOOD.replace(b'"kind":0', b'"kind":0.0'), "record/malformed", "expected an integer, got a fraction"),
        (GOOD.replace(b'"kind":0', b'"kind":true'), "record/malformed", "expected an integer, got a truth value"),
        (GOOD.replace(b'"kind":0', b'"kind":9007199254740992'), "record/malformed", "`$.kind`"),
        (GOOD.replace(b'"d"', b"[" * 100_000), "record/malformed", "expected a text, got a list"),
        (GOOD.replace(b'"d"', b"null"), "record/malformed", "expected a text, got null"),
        (GOOD.replace(b'"kind":0,', b'"kind":0,,'), "record/malformed", "it is not JSON"),
        (GOOD.replace(b'"kind":0', b'"kind": 0'), "record/not-canonical", "RFC 8785"),
        (GOOD.replace(b'"kind":0', b'"kind":-0'), "record/not-canonical", "RFC 8785"),
        (GOOD.replace(b'"kind":0', b'"kind":1,"kind":0'), "record/not-canonical", "RFC 8785"),
        (GOOD.replace(b'"d"', b'"\\u0064"'), "record/not-canonical", "RFC 8785"),
        (GOOD.replace(b"\n", b"\r\n"), "record/not-canonical", "RFC 8785"),
    ],
)
def test_anything_else_is_refused(line: bytes, slug: str, words: str) -> None:
    flaw = read(line)
    assert isinstance(flaw, Flaw)
    assert flaw.slug == slug
    assert words in flaw.text
    assert not any(word in flaw.text for word in ("`int`", "`str`", "`float`", "`bool`", "`array`", "`object`"))


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (b'"outcome":"allow"', b'"outcome":"perhaps"', "perhaps"),
        (b'"binding":"00"', b'"binding":"0G"', "0G"),
        (b'"binding":"00"', b'"binding":"000"', "000"),
        (b'"invocation":""', b'"invocation":"AB"', "AB"),
    ],
)
def test_a_decision_has_one_of_four_outcomes_and_octets_in_hexadecimal(old: bytes, new: bytes, found: str) -> None:
    context, state = RecordedContext((), 0, 0, 0, 0, 0, "v"), RecordedState(ages=(), values=())
    line = encode(
        DecisionRecord(
            "0" * 64,
            1,
            "00",
            None,
            None,
            context,
            1,
            "",
            0,
            -1,
            "software",
            "allow",
            "admitted",
            8,
            1,
            state,
            0,
            None,
            -1,
            "decision",
            0,
            2,
            3,
        )
    )
    assert not isinstance(read(line), Flaw)
    flaw = read(line.replace(old, new))
    assert isinstance(flaw, Flaw)
    assert (flaw.slug, flaw.found) == ("record/malformed", found)
