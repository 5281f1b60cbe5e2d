"""A compromised runtime claims another time of day, to use expired documents or other permitted hours."""

import pytest
from msgspec.structs import replace

from reference.documents import MIN, approval, low, presented, recall
from reference.flat_case import S
from reference.world import START, answer_to, loaded, renewed, request_for
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import Now
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.boundary import CLOCKS_PART_US
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.response import Status

OF, LOW = loaded(), low()


def after(us: int, *, said: int | None = None) -> Now:
    """The moment so long after the start, optionally with a false time of day."""
    return Now(START.monotonic_us + us, START.utc_us + (us if said is None else said), START.utc_error_us)


def asked(of: Loaded, now: Now) -> Decision | Status:
    return answer_to(of, request_for(of, now=now, released_us=now.monotonic_us))


def met(of: Loaded = OF) -> Loaded:
    """A session after one request for a step out of turn."""
    of = renewed(of)
    assert answer_to(of, request_for(of, step=2)) is Status.NOT_CURRENT
    return of


YEAR = 365 * 24 * 60 * MIN


def test_expired_document_stays_expired_after_clock_change() -> None:
    answer = asked(met(), after(YEAR))
    assert isinstance(answer, Decision)
    assert answer.reason is Reason.EXPIRED
    assert asked(met(), after(YEAR, said=0)) is Status.MALFORMED


@pytest.mark.parametrize("said", [-MIN, CLOCKS_PART_US + S + 1, 60 * MIN, YEAR])
def test_time_of_day_must_advance_with_monotonic_time(said: int) -> None:
    assert asked(met(), after(S, said=said)) is Status.MALFORMED
    answer = asked(met(), after(S))
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.ALLOW


@pytest.mark.parametrize("said", [S - CLOCKS_PART_US, S + CLOCKS_PART_US])
def test_a_clock_may_be_off_a_little(said: int) -> None:
    answer = asked(met(), after(S, said=said))
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.ALLOW


@pytest.mark.parametrize("document", [approval, recall])
def test_clock_change_does_not_revalidate_old_document(document: object) -> None:
    assert callable(document)
    old = document(LOW)
    assert presented(met(LOW), old, now=after(60 * MIN)).slug == "expired"
    assert presented(met(LOW), old, now=after(60 * MIN, said=MIN)).slug == "time-of-day-set"
    assert presented(met(LOW), old, now=after(MIN // 2)).accepted


def test_unknown_clock_grants_nothing() -> None:
    lost = replace(after(YEAR, said=0), utc_error_us=YEAR)
    answer = asked(met(), lost)
    assert isinstance(answer, Decision)
    assert answer.outcome is Outcome.DEFER
