"""Which dispatches are covered by earlier records."""

import pytest

from rtshcua.evidence.records import DecisionRecord, Effect, RecordedContext, RecordedState
from rtshcua.ground.audit.dispatches import DispatchCover
from virtual.rows import rows

STEP, FALLBACK, CONTINGENCY = 0, 1, 2
DEGRADE = -1


def decision(kind: int, step: int, link: int, outcome: str = "allow", until_us: int = 100) -> DecisionRecord:
    return DecisionRecord(
        "0" * 64, 0, "", None, None, RecordedContext((), 0, 0, 1, 0, 0, ""), 2, "", kind, link, "software", outcome, "",
        8, 1, RecordedState(ages=(), values=()), step, None, -1, "decision", 0, 0, until_us,
    )  # fmt: skip


def sent(kind: int, step: int, link: int, at_us: int = 50, event: str = "dispatched") -> Effect:
    return Effect("0" * 64, at_us, "", 1, event, kind, link, 2, step, 1, "effect", 0, 0)


def slug(cover: DispatchCover, effect: Effect) -> str | None:
    flaw = cover.check(effect)
    return None if flaw is None else flaw.slug


KEYS = [(STEP, 0, -1), (FALLBACK, 0, 1), (FALLBACK, 0, DEGRADE), (CONTINGENCY, -1, 0)]


@pytest.mark.parametrize("key", KEYS)
def test_dispatch_without_a_decision_is_not_covered(key: tuple[int, int, int]) -> None:
    assert slug(DispatchCover(), sent(*key)) == "dispatch/not-permitted"


@rows("key", KEYS)
@rows("outcome", ["deny", "defer", "fallback"])
def test_only_an_allow_covers_a_dispatch(key: tuple[int, int, int], outcome: str) -> None:
    cover = DispatchCover()
    cover.decided(decision(*key, outcome=outcome))
    assert slug(cover, sent(*key)) == "dispatch/not-permitted"
    cover.decided(decision(*key))
    cover.decided(decision(*key, outcome=outcome))
    if key[0] == STEP:
        assert slug(cover, sent(*key)) == "dispatch/not-permitted", "taken back"


@pytest.mark.parametrize("key", KEYS)
def test_allow_covers_one_dispatch_while_valid(key: tuple[int, int, int]) -> None:
    cover = DispatchCover()
    cover.decided(decision(*key, until_us=50))
    assert slug(cover, sent(*key, at_us=50)) is None
    assert slug(cover, sent(*key, at_us=50)) == "dispatch/not-permitted"
    cover.decided(decision(*key, until_us=50))
    assert slug(cover, sent(*key, at_us=51)) == "dispatch/late"
    assert cover.dispatches == 3


@pytest.mark.parametrize("key", KEYS)
def test_allow_covers_no_other_step_or_link(key: tuple[int, int, int]) -> None:
    kind, step, link = key
    cover = DispatchCover()
    cover.decided(decision(*key))
    for other in {(kind, step + 1, link), (kind, step, link + 1), ((kind + 1) % 3, step, link)}:
        if kind == STEP and other[0] in (FALLBACK, CONTINGENCY):
            continue  # standing permits, below
        assert slug(cover, sent(*other)) == "dispatch/not-permitted", other


def test_allow_of_a_step_covers_its_chain_and_the_contingency() -> None:
    cover = DispatchCover()
    cover.decided(decision(STEP, 3, -1))
    assert slug(cover, sent(FALLBACK, 3, 0, at_us=10_000)) is None
    assert slug(cover, sent(FALLBACK, 3, 1, at_us=10_000)) is None
    assert slug(cover, sent(CONTINGENCY, -1, 2, at_us=10_000)) is None
    assert slug(cover, sent(FALLBACK, 2, 0)) == "dispatch/not-permitted", "another step's chain"
    assert slug(cover, sent(FALLBACK, 3, DEGRADE)) == "dispatch/not-permitted", (
        "a degrade rule's target has no standing permit"
    )


def test_standing_permit_covers_a_link_whose_own_permit_expired() -> None:
    cover = DispatchCover()
    cover.decided(decision(STEP, 3, -1))
    cover.decided(decision(FALLBACK, 3, 0, until_us=50))
    assert slug(cover, sent(FALLBACK, 3, 0, at_us=51)) is None


def test_other_effects_need_no_permit() -> None:
    assert slug(DispatchCover(), sent(STEP, 0, -1, event="succeeded")) is None
