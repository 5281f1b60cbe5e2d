"""CBOR and the flat form: C decodes the same fields as Python, and refuses the same bytes."""

import ctypes
from functools import cache
from pathlib import Path
from random import Random

import pytest
from msgspec.structs import replace

from boundary.layout import differences, structs
from boundary.mutants import altered, damaged
from reference import bundle_case, documents, flat_case
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire import artefact, bundle, cbor, cose, names
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted
from unit.decision.test_levels import levelled
from unit.wire.test_cbor import EXAMPLES, REFUSED

STRUCTS = structs()
ARTEFACTS = Path(__file__).parents[1] / "vectors" / "artefacts"


def canonical(data: bytes) -> bool:
    try:
        cbor.decode(data)
    except CborError:
        return False
    return True


@cache
def payloads() -> list[bytes]:
    """Policies and missions, simple and rich."""
    envelopes = [bundle.envelopes((ARTEFACTS / f"policy-{names.POLICY.version}").read_bytes())]
    rich = [cose.unverified(each).payload for pair in envelopes for each in pair]
    written = [bundle.policy_payload(flat_case.POLICY), bundle.mission_payload(documents.low_mission())]
    return [
        *rich,
        *written,
        bundle.policy_payload(bundle_case.THE_POLICY),
        bundle.mission_payload(bundle_case.THE_MISSION),
        *levels(),
    ]


def levels() -> list[bytes]:
    """A policy and a mission with heights and headings."""
    step, policy = levelled(*(9, 20) * (len(flat_case.PATH) // 4), headings=(0, -1) * (len(flat_case.PATH) // 4))
    mission = replace(flat_case.MISSION, invocations=(replace(step, step=0),))
    return [bundle.policy_payload(policy.policy), bundle.mission_payload(mission)]


@pytest.fixture(scope="module")
def c(boundary: ctypes.CDLL) -> ctypes.CDLL:
    for function in (boundary.rt_test_policy, boundary.rt_test_mission):
        function.restype = ctypes.c_char_p
    boundary.rt_test_cbor.restype = ctypes.c_bool
    return boundary


def read(c: ctypes.CDLL, data: bytes, kind: str) -> tuple[str | None, ctypes.Structure]:
    """The refusal of a payload by C, and the decoded value."""
    pointer = ctypes.c_void_p()
    slug = getattr(c, f"rt_test_{kind}")(data, len(data), ctypes.byref(pointer))
    assert pointer.value
    return slug and slug.decode(), STRUCTS[f"rt_{kind}"].from_address(pointer.value)


def refusal(data: bytes, kind: str) -> str | None:
    try:
        bundle.parse(names.POLICY, data, Policy) if kind == "policy" else bundle.parse(names.MISSION, data, Mission)
    except Untrusted as error:
        return error.slug
    return None


def same(c: ctypes.CDLL, data: bytes) -> bool:
    """Whether both accept a payload, with the same value."""
    for kind in ("policy", "mission"):
        (slug, there), expected = read(c, data, kind), refusal(data, kind)
        assert slug == expected, (kind, data.hex())
        if expected is None:
            here = (
                bundle.parse(names.POLICY, data, Policy)
                if kind == "policy"
                else bundle.parse(names.MISSION, data, Mission)
            )
            left_out = {".invocations"}
            found = [each for each in differences(here, there) if not any(each.startswith(name) for name in left_out)]
            assert not found
            if isinstance(here, Mission):
                assert there.invocation_count == len(here.invocations)
                for step, invocation in enumerate(here.invocations):
                    into = STRUCTS["rt_invocation"]()
                    c.rt_test_invocation(ctypes.byref(there), step, ctypes.byref(into))
                    assert not differences(invocation, into)
            return True
    return False


@pytest.mark.parametrize("example", [bytes.fromhex(encoded) for _, encoded in EXAMPLES])
def test_c_accepts_canonical_cbor(c: ctypes.CDLL, example: bytes) -> None:
    assert c.rt_test_cbor(example, len(example))


@pytest.mark.parametrize("data", [bytes.fromhex(data) for data, *_ in REFUSED])
def test_c_refuses_noncanonical_cbor(c: ctypes.CDLL, data: bytes) -> None:
    assert not c.rt_test_cbor(data, len(data))


def test_depth_and_size_have_the_same_limits(c: ctypes.CDLL) -> None:
    for inner in (b"\x81", b"\xa1\x00"):
        for depth in (cbor.MAX_DEPTH, cbor.MAX_DEPTH + 1):
            data = inner * depth + b"\x00"
            assert c.rt_test_cbor(data, len(data)) is canonical(data) is (depth == cbor.MAX_DEPTH)
    for more in (0, 1):
        data = b"\x5a" + (cbor.LIMIT - 5 + more).to_bytes(4) + bytes(cbor.LIMIT - 5 + more)
        assert c.rt_test_cbor(data, len(data)) is canonical(data) is (more == 0)


def test_every_input_of_two_bytes(c: ctypes.CDLL) -> None:
    for size in range(3):
        for number in range(256**size):
            data = number.to_bytes(size)
            assert c.rt_test_cbor(data, size) is canonical(data), data.hex()


def test_damaged_cbor_is_refused_alike(c: ctypes.CDLL) -> None:
    random, accepted = Random(4), 0
    seeds = [bytes.fromhex(encoded) for _, encoded in EXAMPLES] + [
        cbor.encode({"a": [1, -2, None], "bb": "\u20ac\U0001f600", 3: b"x"})
    ]
    for _ in range(3_000):
        data = damaged(random.choice(seeds), random)
        assert c.rt_test_cbor(data, len(data)) is canonical(data), data.hex()
        accepted += canonical(data)
    assert 100 < accepted < 2_900


def test_every_text_of_two_or_three_bytes_is_unicode_alike(c: ctypes.CDLL) -> None:
    interesting = (
        0x00,
        0x7F,
        0x80,
        0x8F,
        0x90,
        0x9F,
        0xA0,
        0xBF,
        0xC0,
        0xC1,
        0xC2,
        0xDF,
        0xE0,
        0xE1,
        0xED,
        0xEE,
        0xEF,
        0xF0,
        0xF4,
        0xF5,
        0xFF,
    )
    for a in range(256):
        for b in interesting:
            for rest in (b"", b"\x80", b"\xbf", b"\x80\x80", b"\xbf\xbf", b"\x80\xc0"):
                text = bytes([a, b]) + rest
                data = bytes([0x60 | len(text)]) + text
                assert c.rt_test_cbor(data, len(data)) is canonical(data), data.hex()


@pytest.mark.parametrize("number", range(len(payloads())))
def test_every_field_is_read_as_in_python(c: ctypes.CDLL, number: int) -> None:
    assert same(c, payloads()[number])


def test_altered_payloads_are_refused_alike(c: ctypes.CDLL) -> None:
    random, accepted = Random(5), 0
    for number in range(360):
        data = random.choice(payloads()[2:])
        accepted += same(c, altered(data, random) if number % 6 else damaged(data, random))
    assert 40 < accepted < 320


def test_the_formats_are_those_of_python(c: ctypes.CDLL) -> None:
    every = (names.ROOT, names.POLICY, names.MISSION, names.BUNDLE, names.APPROVAL, names.RECALL, names.REPLACEMENT,
             names.CANCELLATION, names.RECEIPT, names.REQUEST, names.RESPONSE)  # fmt: skip
    for number, each in enumerate(every):
        frame, content_type = ctypes.create_string_buffer(32), ctypes.c_char_p()
        size = c.rt_test_frame(number, frame, ctypes.byref(content_type))
        assert frame.raw[:size] + b"\xf6" == artefact.wrap(each, None)
        assert content_type.value == each.content_type.encode()
