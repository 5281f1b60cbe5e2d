"""A step that was admitted once, or a permit that was used once, is replayed."""

from reference.world import START, Run, allowed, answer_to, loaded, request_for
from rtshcua.model.decision import Decision
from rtshcua.model.flat.situation import State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.executor import FORGED, USED, Commands, Executor
from rtshcua.onboard.ports import Command


def test_an_admitted_step_is_denied_the_second_time() -> None:
    of = loaded()
    allowed(of)
    answer = answer_to(of, request_for(of))
    assert isinstance(answer, Decision)
    assert (answer.outcome, answer.reason, answer.consumed) == (Outcome.DENY, Reason.REPLAYED, 1)
    assert answer.permit == b""


def test_flown_step_is_denied_later() -> None:
    run = Run().until_flies("inspect_area")
    answer = answer_to(run.loaded, request_for(run.loaded, step=1, now=run.clock.now()))
    assert isinstance(answer, Decision)
    assert answer.reason is Reason.REPLAYED


def test_deferred_step_is_not_a_replay() -> None:
    of = loaded()
    blind = answer_to(of, request_for(of, state=State((None,) * of.bundle.policy.slots, (0,) * of.bundle.policy.slots)))
    assert isinstance(blind, Decision)
    assert blind.outcome is Outcome.DEFER
    allowed(of)


def test_unauthenticated_request_uses_no_id() -> None:
    """Otherwise a forger could cause the refusal of the honest request."""
    of = loaded()
    forged = answer_to(of, request_for(of, binding=bytes(32)))
    assert isinstance(forged, Decision)
    assert forged.outcome is Outcome.DENY
    allowed(of)


def test_a_permit_sends_one_command_once() -> None:
    of = loaded()
    permit = allowed(of)
    assert isinstance(of.executor.dispatch(permit, START.monotonic_us), Command)
    assert of.executor.dispatch(permit, START.monotonic_us) is USED
    assert isinstance(of.executor.stand_in(permit, 1, 0, START.monotonic_us), Command)
    assert of.executor.stand_in(permit, 1, 0, START.monotonic_us) is USED


def test_permit_of_another_session_is_rejected() -> None:
    of = loaded()
    later = Executor(bytes(32), Commands(of.bundle.policy, of.bundle.mission))
    assert later.dispatch(allowed(of), START.monotonic_us) is FORGED
