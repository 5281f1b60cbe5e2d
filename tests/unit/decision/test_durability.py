"""The durability of a decision's record: a table by hand, and the `record` clause of a contract."""

import pytest
from hypothesis import given
from hypothesis import strategies as some
from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.decision.durability import confirmed, durability_of, recorded_as
from rtshcua.model.durability import BUFFERED, SYNCED, SYNCED_FIRST, WORDS, WRITTEN
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.flat.situation import ConfirmAnswer, Context
from rtshcua.model.outcome import Outcome
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from virtual.rows import rows

ALLOW, DENY, DEFER, FALLBACK = Outcome


def contract(motion: MotionKind, *record: str) -> Contract:
    hover = flat.POLICY.contracts[flat.HOVER]
    return replace(hover, motion=replace(hover.motion, kind=int(motion)), record=("decision", "state", *record))


@rows(
    ("motion", "record", "outcome", "approved", "kind", "expected"),
    [
        (MotionKind.HOLD, (), ALLOW, False, STEP, SYNCED),
        (MotionKind.HOLD, ("buffered",), ALLOW, False, STEP, BUFFERED),
        (MotionKind.FLY, ("written",), ALLOW, False, STEP, WRITTEN),
        (MotionKind.FLY, ("synced",), ALLOW, False, STEP, SYNCED),
        (MotionKind.LAND, ("synced_first",), ALLOW, False, STEP, SYNCED_FIRST),
        # what was approved, and what arms and takes off
        (MotionKind.FLY, ("written",), ALLOW, True, STEP, SYNCED_FIRST),
        (MotionKind.CLIMB, ("buffered",), ALLOW, False, STEP, SYNCED_FIRST),
        (MotionKind.CLIMB, (), ALLOW, True, STEP, SYNCED_FIRST),
        # nothing waits for what moves nothing
        (MotionKind.CLIMB, ("synced_first",), DENY, True, STEP, WRITTEN),
        (MotionKind.CLIMB, (), DEFER, False, STEP, WRITTEN),
        (MotionKind.HOLD, ("buffered",), DENY, False, STEP, WRITTEN),
        (MotionKind.HOLD, ("synced_first",), FALLBACK, True, STEP, WRITTEN),
        # nor what brings the vehicle home or down
        (MotionKind.HOME, ("synced_first",), ALLOW, True, FALLBACK_LINK, WRITTEN),
        (MotionKind.CLIMB, (), ALLOW, False, CONTINGENCY_LINK, WRITTEN),
    ],
)
def test_by_hand(
    motion: MotionKind, record: tuple[str, ...], outcome: Outcome, approved: bool, kind: int, expected: int
) -> None:
    assert durability_of(contract(motion, *record), outcome, confirmed=approved, kind=kind) == expected


@given(some.permutations([*WORDS, "intent", "effect"]), some.integers(0, 6))
def test_strictest_record_class_counts(names: list[str], many: int) -> None:
    words = [number for number, word in enumerate(WORDS) if word in names[:many]]
    assert recorded_as(tuple(names[:many])) == (words[-1] if words else SYNCED)


@pytest.mark.parametrize(
    ("granted", "expected"), [((), False), ((1,), True), ((0,), False), ((0, 1), True), ((0, 0), False)]
)
def test_approved_decision_counts_as_confirmed(granted: tuple[int, ...], expected: bool) -> None:
    approvals = tuple(ConfirmAnswer(number, 0, each, 5) for number, each in enumerate(granted))
    assert confirmed(Context(b"", "quad-07", 7, 0, 0, 0, 0, approvals)) is expected
