"""Threat: a field of a record is edited, with or without the hashes, by an outsider or by a holder of the log key."""

import pytest

from reference.forgery import (
    edit,
    expect,
    flight,
    other_flight,
    prove,
    read,
    rehashed,
    rewritten,
    seed_of,
    signed,
    signers,
)
from reference.resealing import resealed
from rtshcua.evidence.report import LogVerdict
from virtual.rows import rows

LINES = flight()
FIRST = next(number for number, line in enumerate(LINES) if read(line)["type"] == "decision")
EFFECT = next(number for number, line in enumerate(LINES) if read(line).get("event") == "succeeded")
SEAL = next(number for number in signers(LINES) if number > EFFECT)
FIRST_SEAL = next(number for number in signers(LINES) if number > FIRST)


def with_fields(number: int, lines: tuple[bytes, ...] = LINES, **fields: object) -> list[bytes]:
    return [*lines[:number], edit(lines[number], **fields), *lines[number + 1 :]]


EDITS = {
    "outcome": "deny",
    "reason": "state/violated",
    "rule_step": 7,
    "clause": "battery > 1 %",
    "clause_at": [0, 1, 2],
    "target": "hover",
    "target_link": 0,
    "valid_until_us": 99_000_000,
}


@rows("field", EDITS)
def test_an_edited_answer(field: str) -> None:
    changed = with_fields(FIRST, **{field: EDITS[field]})
    assert expect(changed) == ("chain/broken", FIRST)


@rows("field", EDITS)
def test_an_edited_answer_that_was_rehashed(field: str) -> None:
    """The chain is valid again, but the seal of the epoch is not."""
    changed = with_fields(FIRST, **{field: EDITS[field]})
    assert expect(rehashed(changed)) in (("seal/bytes", FIRST_SEAL), ("seal/digest", FIRST_SEAL))
    assert expect(rewritten(changed)) == ("seal/root", FIRST_SEAL)


@rows("field", EDITS)
def test_an_edited_answer_that_the_key_holder_signed_again(field: str) -> None:
    """Everything is sealed, but the decision does not follow from its inputs."""
    changed = signed(with_fields(FIRST, **{field: EDITS[field]}))
    assert expect(changed) == (f"decision/{field.replace('_', '-')}", FIRST)


def test_an_edited_effect_that_was_rehashed_breaks_the_signature() -> None:
    assert expect(with_fields(EFFECT, event="failed")) == ("chain/broken", EFFECT)
    assert expect(rewritten(with_fields(EFFECT, event="failed"))) == ("seal/root", SEAL)


def test_an_edited_last_record_before_the_close() -> None:
    number = len(LINES) - 2
    assert expect(with_fields(number, utc_error_us=7)) == ("chain/broken", number)


@pytest.mark.parametrize("fields", [{"ending": "aborted"}, {"tlog": "00" * 32}, {"utc_error_us": 7}])
def test_an_edited_close(fields: dict[str, object]) -> None:
    assert expect(with_fields(len(LINES) - 1, **fields)) == ("seal/self", len(LINES) - 1)


MISCOUNTED = [
    ({"records": 1_000}, "seal/records"),
    ({"bytes": 1}, "seal/bytes"),
    ({"epoch": 99}, "seal/epoch"),
    ({"digest": "00" * 32}, "seal/digest"),
]


@pytest.mark.parametrize(("fields", "slug"), MISCOUNTED)
def test_a_signed_record_that_counts_otherwise(fields: dict[str, object], slug: str) -> None:
    for number in (SEAL, len(LINES) - 1):
        assert expect(with_fields(number, **fields)) == (slug, number)
        by_the_holder = resealed(with_fields(number, **fields), seed_of, keep=fields)
        assert expect(by_the_holder) == (slug, number)


@rows(
    ("fields", "slug"),
    [
        ({"mode": "none"}, "decision/mode"),
        ({"step": 1}, "decision/invocation"),
        ({"step": 99}, "decision/unknown-step"),
        ({"kind": 1, "link": 99}, "decision/unknown-step"),
        ({"kind": 3}, "decision/unknown-step"),
        ({"link": 0}, "decision/unknown-step"),
        ({"binding": "zz" * 32}, "record/malformed"),
        ({"binding": "AA" * 32}, "record/malformed"),
        ({"invocation": "00" * 16}, "decision/invocation"),
        ({"binding": "00" * 32}, "decision/outcome"),
        ({"state": {"ages": [], "values": []}}, "decision/inputs"),
    ],
)
def test_an_edited_question(fields: dict[str, object], slug: str) -> None:
    changed = with_fields(FIRST, **fields)
    assert expect(signed(changed)) == (slug, FIRST)
    sealed = ("seal/root", FIRST_SEAL)
    assert expect(rewritten(changed)) == ((slug, FIRST) if slug.startswith("record/") else sealed)


def test_edited_state_that_changes_decision_is_detected() -> None:
    """The battery that caused the return is recorded as full, which matches no rule."""
    lines = other_flight()
    records = [read(line) for line in lines]
    number, record = next((n, each) for n, each in enumerate(records) if "state" in each and each["kind"] == 1)
    state = record["state"] | {"values": [10_000, *record["state"]["values"][1:]]}
    assert expect(signed(with_fields(number, lines, state=state))) == ("decision/outcome", number)


def test_used_id_recorded_as_unused_is_detected() -> None:
    """The key holder lets a step be decided twice, and records its id as unused each time."""
    number = FIRST
    again = [*LINES[: number + 1], LINES[number], *LINES[number + 1 :]]
    assert expect(signed(again)) == ("decision/consumed", number + 1)


def test_the_log_itself_is_sound() -> None:
    for lines in (LINES, other_flight()):
        assert prove(lines).report.verdict is LogVerdict.VERIFIED
