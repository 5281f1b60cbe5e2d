"""Requests for another step than the current one, and malformed requests."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.world import START, allowed, answer_to, loaded, read_answer, request_for
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import State
from rtshcua.model.outcome import Outcome
from rtshcua.onboard.enforcement.executor import BACKWARDS, MISSION_OVER, OUT_OF_TURN
from rtshcua.onboard.ports import Command
from rtshcua.wire.response import Status
from virtual.rows import rows

AT = START.monotonic_us


@pytest.mark.parametrize("step", [1, 2, 3])
def test_step_before_its_turn_is_not_decided(step: int) -> None:
    of = loaded()
    assert answer_to(of, request_for(of, step=step)) is Status.NOT_CURRENT


@pytest.mark.parametrize(("kind", "step", "link"), [(1, 0, 0), (1, 1, 0), (1, 0, -1)])
def test_fallback_of_unrequested_step_is_not_decided(kind: int, step: int, link: int) -> None:
    of = loaded()
    assert answer_to(of, request_for(of, kind, step, link)) is Status.NOT_CURRENT


def test_skipped_deferred_step_is_not_decided() -> None:
    of = loaded()
    blind = State((None,) * of.bundle.policy.slots, (0,) * of.bundle.policy.slots)
    deferred = answer_to(of, request_for(of, state=blind))
    assert isinstance(deferred, Decision)
    assert deferred.outcome is Outcome.DEFER
    allowed(of, step=1)
    assert answer_to(of, request_for(of)) is Status.NOT_CURRENT


def test_the_fallback_of_an_earlier_step_is_not_decided() -> None:
    of = loaded()
    allowed(of)
    allowed(of, step=1)
    assert answer_to(of, request_for(of, 1, 0, 0)) is Status.NOT_CURRENT


@rows(
    ("kind", "step", "link"),
    [(0, 4, -1), (0, -1, -1), (0, 0, 0), (1, 0, 9), (1, 4, 0), (1, -1, 0), (2, 0, 0), (2, -1, 3), (2, -1, -1)],
)
def test_step_or_link_outside_bundle_is_refused(kind: int, step: int, link: int) -> None:
    of = loaded()
    allowed(of)
    assert answer_to(of, request_for(of, kind, step, link)) is Status.UNKNOWN_STEP


def test_a_step_out_of_turn_is_not_sent() -> None:
    of = loaded()
    first = allowed(of)
    second = allowed(of, step=1)
    assert isinstance(of.executor.dispatch(second, AT), Command)
    assert of.executor.dispatch(first, AT) is OUT_OF_TURN, "behind the one that runs"
    of.executor.ended()
    assert of.executor.dispatch(first, AT) is OUT_OF_TURN, "and behind the one that ran"


def test_two_steps_never_run_at_once() -> None:
    of = loaded()
    first = allowed(of)
    second = allowed(of, step=1)
    assert isinstance(of.executor.dispatch(first, AT), Command)
    assert of.executor.dispatch(second, AT) is OUT_OF_TURN


def test_no_step_follows_a_return_that_a_fallback_began() -> None:
    of = loaded()
    first = allowed(of)
    second = allowed(of, step=1)
    of.executor.dispatch(first, AT)
    home = allowed(of, 2, -1, 1)
    assert isinstance(of.executor.dispatch(home, AT), Command)
    assert of.executor.dispatch(second, AT) is MISSION_OVER
    hold = allowed(of, 2, -1, 0)
    assert of.executor.dispatch(hold, AT) is BACKWARDS
    again = allowed(of, 2, -1, 1)
    assert isinstance(of.executor.dispatch(again, AT), Command), "the same link may be tried again"
    chain = allowed(of, 1, 1, 0)
    assert of.executor.dispatch(chain, AT) is BACKWARDS, "from the contingency there is no way back"


def test_a_chain_never_goes_backwards() -> None:
    of = loaded()
    allowed(of)
    allowed(of, step=1)
    permits = {link: allowed(of, 1, 1, link) for link in range(3)}
    earlier = allowed(of, 1, 1, 0)
    assert isinstance(of.executor.dispatch(permits[1], AT), Command)
    assert of.executor.dispatch(permits[0], AT) is BACKWARDS
    assert of.executor.dispatch(earlier, AT) is BACKWARDS
    assert isinstance(of.executor.dispatch(permits[2], AT), Command)


def test_awaited_step_may_follow_a_hold() -> None:
    of = loaded()
    first = allowed(of)
    of.executor.dispatch(first, AT)
    of.executor.ended()
    second = allowed(of, step=1)
    for _ in range(2):
        hold = allowed(of, 2, -1, 0)
        assert isinstance(of.executor.dispatch(hold, AT), Command)
    assert isinstance(of.executor.dispatch(second, AT), Command)


ONE = loaded()


@given(st.binary(max_size=1200))
def test_malformed_request_is_refused_and_forgotten(data: bytes) -> None:
    assert read_answer(ONE, data, ONE.boundary.enforce(data)) is Status.MALFORMED


@pytest.mark.claim("A4")
@given(st.data())
def test_altered_request_gets_no_permit(data: st.DataObject) -> None:
    of = ONE
    request = bytearray(request_for(of, *data.draw(st.sampled_from([(0, 0, -1), (1, 0, 0), (2, -1, 0)]))))
    for _ in range(data.draw(st.integers(1, 4))):
        request[data.draw(st.integers(0, len(request) - 1))] = data.draw(st.integers(0, 255))
    answer = read_answer(of, bytes(request), of.boundary.enforce(bytes(request)))
    assert isinstance(answer, Decision | Status)
