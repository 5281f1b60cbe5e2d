"""Canonical CBOR: the examples of RFC 8949, an independent encoder, and bytes that must be refused."""

import tracemalloc
from enum import IntEnum

import cbor2
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rtshcua.wire import cbor
from virtual.rows import rows

INT64 = st.integers(-(1 << 63), (1 << 63) - 1) | st.integers(-300, 300) | st.integers(-70_000, 70_000)
TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=30)
SCALAR = st.none() | st.booleans() | INT64 | st.binary(max_size=40) | TEXT
FLAT = st.recursive(SCALAR, lambda items: st.lists(items, max_size=30).map(tuple), max_leaves=60)
VALUES = st.recursive(
    SCALAR,
    lambda items: st.lists(items, max_size=8).map(tuple) | st.dictionaries(INT64 | TEXT, items, max_size=6),
    max_leaves=30,
)


def naive(value):
    """An independent encoder by the text of the RFC."""

    def head(major, argument):
        for info, width in ((24, 1), (25, 2), (26, 4), (27, 8)):
            if argument <= 23:
                return bytes([major * 32 + argument])
            if argument < 256**width:
                return bytes([major * 32 + info]) + argument.to_bytes(width, "big")
        raise AssertionError(argument)

    if value is None or value is True or value is False:
        return {None: b"\xf6", True: b"\xf5", False: b"\xf4"}[value]
    if isinstance(value, int):
        return head(0, value) if value >= 0 else head(1, -1 - value)
    if isinstance(value, bytes):
        return head(2, len(value)) + value
    if isinstance(value, str):
        return head(3, len(value.encode("utf-8"))) + value.encode("utf-8")
    if isinstance(value, tuple):
        return head(4, len(value)) + b"".join(naive(item) for item in value)
    keys = sorted((naive(key), key) for key in value)
    return head(5, len(value)) + b"".join(encoded + naive(value[key]) for encoded, key in keys)


def outcome(decoder, data):
    try:
        value = decoder(data)
    except cbor.CborError as error:
        return error.reason, error.offset
    return value, [type(item) for item in value] if isinstance(value, tuple) else type(value)


# RFC 8949, appendix A: those of its examples that the format has.
EXAMPLES = [
    (0, "00"),
    (1, "01"),
    (10, "0a"),
    (23, "17"),
    (24, "1818"),
    (25, "1819"),
    (100, "1864"),
    (1000, "1903e8"),
    (1000000, "1a000f4240"),
    (1000000000000, "1b000000e8d4a51000"),
    (-1, "20"),
    (-10, "29"),
    (-100, "3863"),
    (-1000, "3903e7"),
    (False, "f4"),
    (True, "f5"),
    (None, "f6"),
    (b"", "40"),
    (bytes.fromhex("01020304"), "4401020304"),
    ("", "60"),
    ("a", "6161"),
    ("IETF", "6449455446"),
    ('"\\', "62225c"),
    ("ü", "62c3bc"),
    ("水", "63e6b0b4"),
    ("\U00010151", "64f0908591"),
    ((), "80"),
    ((1, 2, 3), "83010203"),
    ((1, (2, 3), (4, 5)), "8301820203820405"),
    (tuple(range(1, 26)), "98190102030405060708090a0b0c0d0e0f101112131415161718181819"),
    ({}, "a0"),
    ({1: 2, 3: 4}, "a201020304"),
    ({"a": 1, "b": (2, 3)}, "a26161016162820203"),
    (("a", {"b": "c"}), "826161a161626163"),
    ({"a": "A", "b": "B", "c": "C", "d": "D", "e": "E"}, "a56161614161626142616361436164614461656145"),
    # section 4.2.1: 10, 100, -1, "z", "aa" in this order; by length first, -1 would come before 100
    ({"aa": 5, "z": 4, -1: 3, 100: 2, 10: 1}, "a50a011864022003617a0462616105"),
    # the ends of 64 bits, and of each width
    ((1 << 63) - 1, "1b7fffffffffffffff"),
    (-(1 << 63), "3b7fffffffffffffff"),
    ((255, 256, 65535, 65536), "8418ff19010019ffff1a00010000"),
    ((-256, -257, -65536, -65537), "8438ff39010039ffff3a00010000"),
    (
        ((1 << 32) - 1, 1 << 32, -(1 << 32), -(1 << 32) - 1),
        "841affffffff1b00000001000000003affffffff3b0000000100000000",
    ),
]


@rows(("value", "encoded"), EXAMPLES, ids=[encoded[:16] for _, encoded in EXAMPLES])
def test_examples(value, encoded):
    assert cbor.encode(value).hex() == encoded
    assert cbor.decode(bytes.fromhex(encoded)) == value


@settings(max_examples=settings().max_examples * 2)
@given(VALUES)
def test_bytes_are_those_of_the_naive_encoder_and_come_back(value):
    data = cbor.encode(value)
    assert data == naive(value)
    assert cbor.decode(data) == value
    assert cbor2.loads(data, immutable=True) == value


@settings(max_examples=settings().max_examples * 2)
@given(FLAT)
def test_without_maps_cbor2_writes_the_same_bytes(value):
    data = cbor.encode(value)
    assert data == cbor2.dumps(value)
    assert cbor.decode(data) == value


def test_lists_are_arrays_too():
    assert cbor.encode([1, [2]]) == cbor.encode((1, (2,)))


@settings(max_examples=settings().max_examples * 2)
@given(st.binary(max_size=60))
@example(b"")
def test_arbitrary_bytes_are_canonical_or_refused(data):
    found = outcome(cbor.decode, data)
    if isinstance(found[1], int):
        assert 0 <= found[1] <= len(data)
    else:
        assert cbor.encode(found[0]) == data


@settings(max_examples=settings().max_examples * 2)
@given(VALUES | FLAT, st.data())
def test_damaged_bytes_are_canonical_or_refused(value, data):
    encoded = bytearray(cbor.encode(value))
    for _ in range(data.draw(st.integers(0, 2))):
        at = data.draw(st.integers(0, len(encoded) - 1))
        match data.draw(st.sampled_from(["set", "cut", "insert", "wide"])):
            case "set":
                encoded[at] = data.draw(st.integers(0, 255))
            case "cut" if len(encoded) > 1:
                del encoded[at]
            case "insert":
                encoded.insert(at, data.draw(st.integers(0, 255)))
            case _:
                encoded[at : at + 1] = bytes([encoded[at] & 0xE0 | 24, encoded[at] & 0x1F])
    found = outcome(cbor.decode, bytes(encoded))
    if isinstance(found[1], int):
        assert 0 <= found[1] <= len(encoded)
    else:
        assert cbor.encode(found[0]) == encoded


REFUSED = [
    ("", 0, "unexpected end before an item"),
    ("828101", 3, "unexpected end before an item"),
    ("8201", 0, "more items than remaining bytes"),
    ("0000", 1, "unexpected bytes after the item"),
    ("18", 0, "unexpected end in the head of an item"),
    ("1b00000000", 0, "unexpected end in the head of an item"),
    ("1817", 0, "not in the shortest form"),
    ("1900ff", 0, "not in the shortest form"),
    ("1a0000ffff", 0, "not in the shortest form"),
    ("1b00000000ffffffff", 0, "not in the shortest form"),
    ("3817", 0, "not in the shortest form"),
    ("810b5800", 2, "unexpected bytes after the item"),
    ("815800", 1, "not in the shortest form"),
    ("980101", 0, "not in the shortest form"),
    ("b8010101", 0, "not in the shortest form"),
    ("1b8000000000000000", 0, "integer does not fit in 64 bits"),
    ("3bffffffffffffffff", 0, "integer does not fit in 64 bits"),
    ("1c", 0, "reserved initial byte"),
    ("5f4100ff", 0, "indefinite length"),
    ("9fff", 0, "indefinite length"),
    ("bfff", 0, "indefinite length"),
    ("7f6161ff", 0, "indefinite length"),
    ("ff", 0, "simple value other than false, true and null"),
    ("8201ff", 2, "simple value other than false, true and null"),
    ("f7", 0, "simple value other than false, true and null"),
    ("e0", 0, "simple value other than false, true and null"),
    ("f820", 0, "simple value other than false, true and null"),
    ("f814", 0, "simple value other than false, true and null"),
    ("f93c00", 0, "floating-point numbers are not allowed"),
    ("fa3f800000", 0, "floating-point numbers are not allowed"),
    ("fb3ff0000000000000", 0, "floating-point numbers are not allowed"),
    ("c100", 0, "tag 1 is not allowed"),
    ("c2420100", 0, "tag 2 is not allowed"),
    ("81c482013a7fffffff", 1, "tag 4 is not allowed"),
    ("d81c8101", 0, "tag 28 is not allowed"),
    ("d9d9f700", 0, "tag 55799 is not allowed"),
    ("4201", 0, "string is longer than the remaining bytes"),
    ("5b7fffffffffffffff00", 0, "string is longer than the remaining bytes"),
    ("61ff", 1, "text is not UTF-8"),
    ("82006361edff", 4, "text is not UTF-8"),
    ("63eda080", 1, "text is not UTF-8"),
    ("62c080", 1, "text is not UTF-8"),
    ("9bffffffffffffffff00", 0, "more items than remaining bytes"),
    ("a20100", 0, "more items than remaining bytes"),
    ("a201000100", 3, "map key repeated"),
    ("a202000100", 3, "map keys out of order"),
    ("a220001864 00", 3, "map keys out of order"),
    ("a26262620061 6100", 5, "map keys out of order"),
    ("a1f500", 1, "map key is neither text nor an integer"),
    ("a1410000", 1, "map key is neither text nor an integer"),
    ("a1800000", 1, "map key is neither text nor an integer"),
]


@rows(("data", "offset", "reason"), REFUSED, ids=lambda item: str(item)[:24])
def test_refused_with_place_and_reason(data, offset, reason):
    with pytest.raises(cbor.CborError) as refused:
        cbor.decode(bytes.fromhex(data))
    assert (refused.value.offset, refused.value.reason) == (offset, reason)
    assert str(refused.value) == f"{reason} (byte {offset})"


@pytest.mark.parametrize("container", [b"\x81", b"\xa1\x00"])
def test_nesting_has_a_limit(container):
    deepest = container * (cbor.MAX_DEPTH - 1) + b"\x80"
    assert cbor.encode(cbor.decode(deepest)) == deepest
    with pytest.raises(cbor.CborError, match="nested deeper than 32"):
        cbor.decode(container + deepest)
    with pytest.raises(cbor.CborError, match="nested deeper than 32"):
        cbor.decode(container * 100_000)


def test_more_bytes_than_the_limit_are_refused_unread():
    assert cbor.decode(b"\x42ab", limit=3) == b"ab"
    with pytest.raises(cbor.CborError, match="longer than the limit of 2 bytes") as refused:
        cbor.decode(b"\x42ab", limit=2)
    assert refused.value.offset == 2


@rows(("value", "count"), [(1, 1), ([1, [2], 3], 5), ({1: 2, 3: [4]}, 6), ([[], {}, []], 4), ({}, 1)])
def test_items_are_counted_keys_too_and_the_outermost_one(value, count):
    data = cbor.encode(value)
    assert cbor.encode(cbor.decode(data, items=count)) == data
    if count > 1:
        with pytest.raises(cbor.CborError, match=f"more than {count - 1} items"):
            cbor.decode(data, items=count - 1)


@rows(
    "data",
    [
        b"\x9a\xff\xff\xff\xff" * 32,
        b"\x9b\x7f\xff\xff\xff\xff\xff\xff\xff" * 32,
        b"\x5a\xff\xff\xff\xff",
        b"\x7b\x00\x00\x00\xff\xff\xff\xff\xff",
        b"\xba\xff\xff\xff\xff" * 32,
        b"\x99\xff\xff" * 32 + b"\x00" * 1000,
        b"\x81" * 50_000,
        b"\xa1" * 50_000,
        b"\xc1" * 50_000,
    ],
)
def test_claimed_sizes_cost_no_memory(data):
    tracemalloc.start()
    try:
        with pytest.raises(cbor.CborError):
            cbor.decode(data)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


class Kind(IntEnum):
    ONE = 1


@rows(
    ("value", "reason"),
    [
        (1 << 63, "integer does not fit in 64 bits"),
        ((0, -(1 << 63) - 1), "integer does not fit in 64 bits"),
        (1.0, "`float` cannot be encoded"),
        ((1, 1.0), "`float` cannot be encoded"),
        (Kind.ONE, "`Kind` cannot be encoded"),
        ((Kind.ONE,), "`Kind` cannot be encoded"),
        (bytearray(b"a"), "`bytearray` cannot be encoded"),
        ({1, 2}, "`set` cannot be encoded"),
        ("\ud800", "text contains lone surrogates"),
        ({None: 1}, "map key is neither text nor an integer"),
        ({True: 1}, "map key is neither text nor an integer"),
        ({b"a": 1}, "map key is neither text nor an integer"),
    ],
    ids=str,
)
def test_values_without_an_encoding(value, reason):
    with pytest.raises(cbor.CborError) as refused:
        cbor.encode(value)
    assert refused.value.offset is None
    assert str(refused.value) == reason


@pytest.mark.parametrize("wrap", [lambda inner: [inner], lambda inner: {0: inner}])
def test_an_endless_value_is_refused(wrap):
    value = wrap(0)
    value[0] = value
    with pytest.raises(cbor.CborError, match="nested deeper than 32"):
        cbor.encode(value)
