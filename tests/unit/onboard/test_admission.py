"""The current step, the wait for a deferred one and its limit, and `L_rem`, the latency of admission."""

import json
from collections import deque

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference.documents import ASKED, approval, hand, low, low_mission, replacement
from reference.flat_case import MISSION, OBSTACLE, M, S
from reference.world import TICK, Run, assert_audited, loaded
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.ports import Announce, Ending, Presented, Reply, Sent, StatusText
from rtshcua.onboard.runtime.admission import InvocationQueue
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US, WINDOW, RemainingLatency
from rtshcua.onboard.runtime.supervisor import RetryPolicy
from virtual.rows import rows

TIMES = st.lists(st.integers(-10, 1 << 40), max_size=2 * WINDOW)


def naive(times: list[int]) -> int:
    """The smallest measured value that at least 99 of 100 do not exceed; never less than the default with fewer than
    eight.
    """
    last = [max(each, 0) for each in times[-WINDOW:]]
    high = min((each for each in last if sum(other <= each for other in last) * 100 >= 99 * len(last)), default=0)
    return high if len(last) >= 8 else max(high, CONSERVATIVE_US)


@given(TIMES)
def test_remaining_latency_is_a_high_quantile_of_recent_samples(times: list[int]) -> None:
    remaining = RemainingLatency()
    for each in times:
        remaining.measured(each)
    assert remaining.us == naive(times)


@given(TIMES, st.integers(0, 1 << 40))
def test_the_remaining_latency_covers_99_of_100_measurements(times: list[int], slow: int) -> None:
    remaining = RemainingLatency()
    for each in [*times, slow]:
        remaining.measured(each)
    window = deque([max(each, 0) for each in [*times, slow]], WINDOW)
    beyond = sum(each > remaining.us for each in window)
    assert beyond * 100 <= len(window)


def test_latency_is_measured_until_the_first_frame_went_out() -> None:
    """From the decision to `Sent`: this includes the record that the command waits for."""
    run = Run(loaded())
    token = run.vehicle.commands[-1].token
    run.step(Sent(run.clock.now().monotonic_us + 70_000, token))
    run.step(Sent(run.clock.now().monotonic_us + 90_000, token + 1))
    run.until_flies("goto")
    record = [json.loads(line) for line in run.lines if b'"type":"decision"' in line][-1]
    assert record["context"]["remaining_us"] == 70_000


def waits(reason: Reason, outcome: Outcome, step: int, at_us: int, on: OnInadmissible = OnInadmissible.ABORT) -> bool:
    invocation = replace(MISSION.invocations[0], on_inadmissible=on)
    answer = Decision(outcome, reason, step, None, None, None, 0)
    return RetryPolicy.may_wait(invocation, answer, 0, at_us)


BEFORE, AFTER = 1, 10 * S


@rows(
    ("reason", "outcome", "step", "before", "after"),
    [
        (Reason.AWAITING_APPROVAL, Outcome.DEFER, 3, True, True),  # the approval has its own time limit
        (Reason.FORBID_UNKNOWN, Outcome.DEFER, 3, True, False),
        (Reason.CLOCK_UNCERTAIN, Outcome.DEFER, 2, True, False),
        (Reason.PHASE_NOT_REACHED, Outcome.DEFER, 4, True, False),
        (Reason.STATE_UNKNOWN, Outcome.DEFER, 6, True, True),  # the deadline check has passed
        (Reason.SAFETY_UNKNOWN, Outcome.DEFER, 7, True, True),
        (Reason.NO_SLACK, Outcome.FALLBACK, 5, False, False),
        (Reason.STATE_VIOLATED, Outcome.FALLBACK, 6, False, False),
    ],
)
def test_an_answer_that_may_change_is_waited_for_until_the_deadline(
    reason: Reason, outcome: Outcome, step: int, before: bool, after: bool
) -> None:
    assert waits(reason, outcome, step, BEFORE) is before
    assert waits(reason, outcome, step, AFTER) is after


def test_a_step_may_hold_for_what_is_violated_but_not_for_time() -> None:
    assert waits(Reason.STATE_VIOLATED, Outcome.FALLBACK, 6, BEFORE, OnInadmissible.HOLD)
    assert not waits(Reason.NO_SLACK, Outcome.FALLBACK, 5, BEFORE, OnInadmissible.HOLD)


def waiting() -> Run:
    return Run(low()).until(lambda run: (0, ASKED, -1, "defer", "approval/awaited") in run.decisions)


def test_approval_is_used_in_the_step_of_its_arrival() -> None:
    run = waiting()
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    assert run.flown[-1] == "inspect_area"


def test_a_deadline_runs_from_the_approval() -> None:
    """The wait for the approval is not subtracted, not even when the state is unknown by then."""
    run = waiting()
    for _ in range(10 * S // TICK):
        run.tick()
    run.vehicle.values[OBSTACLE] = None
    run.tick()
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    assert run.decisions[-1][3:] == ("defer", "state/unknown")
    run.vehicle.values[OBSTACLE] = 20 * M
    run.tick()
    assert run.flown[-1] == "inspect_area"
    run.until_over()
    assert run.ending is Ending.COMPLETED
    assert_audited(run)


def test_a_deadline_that_an_approval_moved_ends_the_wait() -> None:
    run = waiting()
    run.vehicle.values[OBSTACLE] = None
    run.tick()
    hand(run, approval(run.loaded, now=run.clock.now()))
    begun = run.clock.now().monotonic_us
    run.until(lambda run: (0, ASKED, -1, "fallback", "timing/no-slack") in run.decisions)
    deadline_us = low_mission().invocations[ASKED].contract.deadline_us
    assert run.clock.now().monotonic_us - begun <= deadline_us + TICK
    run.until_over()
    assert_audited(run)


def test_every_decision_is_announced_and_every_document_answered() -> None:
    run = waiting()
    run.tick(Presented(0, b"", 3), Presented(0, b"\xd2", 4))
    assert [(each.sender, each.slug) for each in run.actions if isinstance(each, Reply)] == [
        (3, "malformed"), (4, "malformed")
    ]  # fmt: skip
    announced = [each for each in run.actions if isinstance(each, Announce)]
    assert len(announced) == sum(b'"type":"decision"' in line for line in run.lines)
    assert announced[0] == Announce(6, "allow takeoff(altitude = 8 m)")
    asked = "inspect_area(area = bridge_a, altitude = 8 m, pattern = grid, speed = 4 m/s)"
    assert announced[2] == Announce(5, f"defer approval/awaited: {asked}")


def test_vehicle_text_is_recorded_unchanged() -> None:
    run = Run(loaded())
    run.tick(StatusText(0, 4, "EKF lane switch"), StatusText(0, 6, "x" * 500))
    said = [json.loads(line)["detail"] for line in run.lines if b'"event":"said"' in line]
    assert said == ["4: EKF lane switch", "6: " + "x" * 200]


def test_the_queue_knows_what_was_released() -> None:
    queue = InvocationQueue(MISSION)
    assert queue.released == 0
    queue.release(1)
    assert queue.released == 1
    for number in (2, 3, 4, 4):
        queue.advance(number)
        assert queue.released == number
    longer = replace(MISSION, invocations=MISSION.invocations + MISSION.invocations)
    queue.replace(longer, 5, 9)
    assert (queue.current, queue.released_us) == (MISSION.invocations[0], 4)
    queue.replace(longer, 4, 9)
    assert queue.released_us == 9, "the current step is another one"


def test_the_queue_releases_step_by_step_and_phase_by_phase() -> None:
    queue = InvocationQueue(MISSION)
    assert (queue.released_us, queue.phase) == (None, 0)
    queue.release(10)
    queue.release(20)
    assert queue.released_us == 10
    seen = []
    while (current := queue.current) is not None:
        seen.append((current.step, queue.phase))
        queue.advance(30 + current.step)
    assert seen == [(0, 0), (1, 1), (2, 1), (3, 2)]
    assert (queue.released_us, queue.phase) == (33, 2)


def test_the_remaining_latency_is_conservative_until_measured() -> None:
    remaining = RemainingLatency()
    assert remaining.us == CONSERVATIVE_US
    for _ in range(7):
        remaining.measured(10)
    assert remaining.us == CONSERVATIVE_US
    remaining.measured(-5)
    assert remaining.us == 10
    remaining.measured(90_000)
    assert remaining.us == 90_000


def test_a_first_slow_dispatch_counts_at_once() -> None:
    remaining = RemainingLatency()
    remaining.measured(2 * CONSERVATIVE_US)
    assert remaining.us == 2 * CONSERVATIVE_US


@given(st.lists(st.integers(0, 10**6), min_size=8, max_size=3 * WINDOW))
def test_the_remaining_latency_was_measured_and_covers_99_of_100(took: list[int]) -> None:
    remaining = RemainingLatency()
    for each in took:
        remaining.measured(each)
    latest = took[-WINDOW:]
    covered = sum(each <= remaining.us for each in latest)
    assert remaining.us in latest
    assert covered * 100 >= 99 * len(latest)


def test_step_that_replaces_a_waiting_one_has_a_record_of_its_own() -> None:
    """Its decision equals the one before, but it is about another step: whoever answers must learn of it."""
    mission = low_mission()
    steps = [*mission.invocations]
    steps[ASKED] = replace(steps[ASKED], on_inadmissible=OnInadmissible.REPLAN)
    replaceable = replace(mission, invocations=tuple(steps))
    run = Run(loaded(mission=replaceable))

    def awaited() -> list[str]:
        told = [json.loads(line) for line in run.lines if b"approval/awaited" in line]
        return [each["binding"] for each in told]

    while not awaited():
        run.tick()
    newer = replace(replaceable, issued_at_us=replaceable.issued_at_us + 1)
    assert hand(run, replacement(run.loaded, ASKED, newer)) == "accepted"
    for _ in range(40):
        run.tick()
    assert len(awaited()) == 2
    assert awaited()[1] == run.loaded.bundle.mission.invocations[ASKED].binding.hex() != awaited()[0]
    assert_audited(run.until_over())
