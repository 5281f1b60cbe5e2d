import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire import artefact, cbor, names, permit, response
from rtshcua.wire.permit import SIZE, Permit
from rtshcua.wire.response import Answer, Status
from virtual.rows import rows

ANSWER = Answer(Outcome.FALLBACK, Reason.STATE_VIOLATED, 6, 4, 1, 9_000, 0, b"p" * SIZE, b"d" * 32)


@pytest.mark.parametrize("answer", [ANSWER, replace(ANSWER, permit=b"")])
def test_an_answer_with_and_without_a_permit_is_read_back(answer: Answer) -> None:
    assert response.decode(response.encode(answer)) == answer
    other = response.encode(answer, b"e" * 32)
    assert response.decode(other) == replace(answer, evidence=b"e" * 32)
    assert other == response.encode(answer)[:-32] + b"e" * 32  # it stands last


def test_clauses_are_numbered_from_the_rules_over_the_airspace_to_the_contract() -> None:
    policy, contract = flat_case.POLICY, flat_case.CONTRACTS[flat_case.INSPECT]
    assert policy.airspace is not None
    assert response.shared_clauses(policy) == (*policy.rules, policy.airspace)
    assert response.shared_clauses(replace(policy, airspace=None)) == policy.rules
    assert response.own_clauses(contract) == (*contract.require, *contract.assume, *contract.maintain)


@given(
    st.sampled_from(list(Outcome)),
    st.sampled_from(list(Reason)),
    st.integers(-(1 << 15) - 1, 1 << 16),
    st.just(b"") | st.binary(min_size=SIZE, max_size=SIZE),
)
def test_what_is_encoded_is_read_back(outcome: Outcome, reason: Reason, number: int, permit: bytes) -> None:
    answer = Answer(outcome, reason, 1, number, number, abs(number), 1, permit)
    assert response.decode(response.encode(answer)) == answer


@pytest.mark.parametrize("status", [status for status in Status if status])
def test_a_refusal_is_its_status(status: Status) -> None:
    assert response.decode(response.encode_refusal(status)) is status
    assert response.decode(response.encode_refusal(status, b"e" * 32)) is status


PLAIN = response.encode(Answer(Outcome.ALLOW, Reason.ADMITTED, 8, -1, -2, 0, 0))
REFUSAL = response.encode_refusal(Status.NOT_CURRENT)


def changed(data: bytes, at: int, octet: int) -> bytes:
    """`data` with another octet at an offset of its body of 21 octets, before the digest."""
    start = len(data) - 53 + at
    return data[:start] + bytes([octet]) + data[start + 1 :]


@rows(
    ("data", "text"),
    [
        (b"", "not a response of version 2"),
        (PLAIN + b"\0", "not a response of version 2"),
        (PLAIN[:-1], "not a response of version 2"),
        (PLAIN + b"p" * SIZE, "not a response of version 2"),
        (response.encode(ANSWER)[:-1], "not a response of version 2"),
        (cbor.encode(("rtshcua/response", 1, bytes(53))), "not a response of version 2"),
        (artefact.wrap(names.RESPONSE, 1), "not a response of version 2"),
        (changed(PLAIN, 1, len(Outcome)), "an outcome or a reason that there is not"),
        (changed(PLAIN, 2, len(Reason)), "an outcome or a reason that there is not"),
        (changed(REFUSAL, 0, len(Status)), "a refusal with more than its status"),
        (changed(REFUSAL, 20, 1), "a refusal with more than its status"),
    ],
)
def test_what_is_no_response_says_why(data: bytes, text: str) -> None:
    read = response.decode(data)
    assert isinstance(read, Refusal)
    assert text in read.text


@given(st.binary(max_size=300))
def test_any_bytes_are_read_without_an_exception(data: bytes) -> None:
    assert isinstance(response.decode(data), Refusal)


KEY = bytes(range(32))
PERMIT = Permit(1, 3, -2, 17, 3, 2, 1 << 53)


def test_a_permit_opens_under_its_key_alone() -> None:
    sealed = permit.seal(PERMIT, KEY)
    assert len(sealed) == SIZE
    assert permit.open_permit(sealed, KEY) == PERMIT
    assert permit.open_permit(sealed, bytes(32)) is None


def test_no_bit_of_a_permit_may_change() -> None:
    sealed = permit.seal(PERMIT, KEY)
    for bit in range(8 * SIZE):
        changed = bytearray(sealed)
        changed[bit // 8] ^= 1 << bit % 8
        assert permit.open_permit(bytes(changed), KEY) is None
    assert permit.open_permit(sealed[:-1], KEY) is None
    assert permit.open_permit(sealed + b"\0", KEY) is None
