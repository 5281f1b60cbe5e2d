import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import RuleKind
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire import artefact, cbor, names, permit, response
from rtshcua.wire.permit import SIZE, Permit
from rtshcua.wire.request import DEGRADE
from rtshcua.wire.response import NO_CLAUSE, NO_TARGET, Status
from virtual.rows import rows

POLICY, CONTRACT = flat_case.POLICY, flat_case.CONTRACTS[flat_case.INSPECT]
CLAUSE, EVIDENCE = len(response.shared_clauses(POLICY)), b"d" * 32
ANSWER = Decision(
    Outcome.FALLBACK, Reason.STATE_VIOLATED, 6, CONTRACT.require[0], 1, CONTRACT.fallback[1], 9_000, 0, b"p" * SIZE
)


def read(data: bytes, contract: Contract | None = CONTRACT) -> Decision | Status | Refusal:
    return response.decode(data, POLICY, contract)


def written(answer: Decision, clause: int = NO_CLAUSE, target: int = NO_TARGET) -> bytes:
    return response.encode(answer, clause, target, EVIDENCE)


@pytest.mark.parametrize("answer", [ANSWER, replace(ANSWER, permit=b"")])
def test_an_answer_with_and_without_a_permit_is_read_back(answer: Decision) -> None:
    octets = written(answer, CLAUSE, 1)
    assert read(octets) == answer
    assert octets.endswith(answer.permit + EVIDENCE)


def test_the_target_of_a_degrade_rule_is_read_back() -> None:
    rule = next(number for number, rule in enumerate(POLICY.rules) if rule.kind == RuleKind.DEGRADE)
    target = POLICY.rules[rule].target
    assert read(written(ANSWER, rule, -1 - rule)) == replace(
        ANSWER, clause=POLICY.rules[rule], link=DEGRADE, target=target
    )


@rows(
    ("clause", "target", "contract"),
    [
        (NO_CLAUSE - 1, NO_TARGET, CONTRACT),
        (CLAUSE + len(response.own_clauses(CONTRACT)), NO_TARGET, CONTRACT),
        (CLAUSE, NO_TARGET, None),  # a link of the contingency has no contract of its own
        (NO_CLAUSE, len(CONTRACT.fallback), CONTRACT),
        (NO_CLAUSE, 0, None),
        (NO_CLAUSE, -1, CONTRACT),  # the first rule is not a `degrade` rule
        (NO_CLAUSE, -1 - len(POLICY.rules), CONTRACT),
        (NO_CLAUSE, NO_TARGET - 1, CONTRACT),
    ],
)
def test_unknown_clause_or_target_is_refused(clause: int, target: int, contract: Contract | None) -> None:
    refused = read(written(ANSWER, clause, target), contract)
    assert isinstance(refused, Refusal)
    assert refused.text == "the clause or the target is unknown"


def test_clause_numbers_cover_rules_airspace_and_contract() -> None:
    policy, contract = flat_case.POLICY, flat_case.CONTRACTS[flat_case.INSPECT]
    assert policy.airspace is not None
    assert response.shared_clauses(policy) == (*policy.rules, policy.airspace)
    assert response.shared_clauses(replace(policy, airspace=None)) == policy.rules
    assert response.own_clauses(contract) == (*contract.require, *contract.assume, *contract.maintain)


@given(
    st.sampled_from(list(Outcome)),
    st.sampled_from(list(Reason)),
    st.integers(NO_CLAUSE, CLAUSE + len(response.own_clauses(CONTRACT)) - 1),
    st.integers(0, len(CONTRACT.fallback) - 1),
    st.integers(-(1 << 63), (1 << 63) - 1),
    st.just(b"") | st.binary(min_size=SIZE, max_size=SIZE),
)
def test_response_roundtrip(
    outcome: Outcome, reason: Reason, clause: int, target: int, until_us: int, permit: bytes
) -> None:
    decisive = (
        None if clause == NO_CLAUSE else (*response.shared_clauses(POLICY), *response.own_clauses(CONTRACT))[clause]
    )
    answer = Decision(outcome, reason, 1, decisive, target, CONTRACT.fallback[target], until_us, 1, permit)
    assert read(written(answer, clause, target)) == answer


@pytest.mark.parametrize("status", [status for status in Status if status])
def test_a_refusal_is_its_status(status: Status) -> None:
    assert read(response.encode_refusal(status)) is status
    assert read(response.encode_refusal(status, b"e" * 32)) is status


PLAIN = written(Decision(Outcome.ALLOW, Reason.ADMITTED, 8, None, None, None, 0))
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
        (written(ANSWER)[:-1], "not a response of version 2"),
        (cbor.encode(("rtshcua/response", 1, bytes(53))), "not a response of version 2"),
        (artefact.wrap(names.RESPONSE, 1), "not a response of version 2"),
        (changed(PLAIN, 1, len(Outcome)), "the outcome or the reason is unknown"),
        (changed(PLAIN, 2, len(Reason)), "the outcome or the reason is unknown"),
        (changed(REFUSAL, 0, len(Status)), "a refusal contains more than its status"),
        (changed(REFUSAL, 20, 1), "a refusal contains more than its status"),
    ],
)
def test_malformed_response_says_why(data: bytes, text: str) -> None:
    refused = read(data)
    assert isinstance(refused, Refusal)
    assert text in refused.text


@given(st.binary(max_size=300))
def test_any_bytes_are_read_without_an_exception(data: bytes) -> None:
    assert isinstance(read(data), Refusal)


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
