"""A link that this computer sent too late is tried again: a busy computer must not make a vehicle land in a field."""

from collections.abc import Iterator

import pytest

from reference.flat_case import OBSTACLE, WIND, M
from reference.world import FakeVehicle, Run, assert_audited
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.executor import LATE as PERMIT_LATE
from rtshcua.onboard.ports import Command, CommandFailed, Ending
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import RunStage
from virtual.rows import rows

#: the loop's reason, and the gate's reason for a first frame
REASONS = ("late", "frame/late")
RUNS: list[Run] = []


@pytest.fixture(autouse=True)
def every_run_is_audited() -> Iterator[None]:
    yield
    while RUNS:
        assert_audited(RUNS.pop())


def start(*deaf: str) -> Run:
    run = Run(vehicle=FakeVehicle(deaf=set(deaf)))
    RUNS.append(run)
    return run


def fail(run: Run, reason: str) -> None:
    """The last dispatched command was not sent."""
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, reason))


def coming_home(run: Run) -> Run:
    """The contingency: the wind is too strong, and it holds before it returns."""
    run.until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    return run.until_flies("return_home")


@rows("reason", REASONS)
def test_a_return_that_was_late_is_flown_all_the_same(reason: str) -> None:
    run = coming_home(start("return_home"))
    fail(run, reason)
    run.until_flies("hover").until_flies("return_home")  # of the contingency, from its beginning
    sent = len(run.flown)
    for _ in range(3):
        fail(run, reason)
        run.tick()
    assert run.flown[sent:] == ["return_home"] * 3
    run.vehicle.deaf.clear()
    fail(run, reason)
    run.until_over()
    assert run.ending is Ending.ABORTED
    assert "emergency_land" not in run.flown


@rows("skill", ("hover", "return_home"))
def test_in_place_of_a_late_link_of_a_steps_chain_the_contingency_flies(skill: str) -> None:
    """The boundary lets no link of a chain fly twice."""
    run = start("inspect_area", skill).until_flies("inspect_area")
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "no-progress"))
    run.until_flies(skill)
    assert run.decisions[-1][0] == 1, "of the step's own chain"
    run.vehicle.deaf.clear()
    fail(run, "late")
    run.until_over()
    home = [decision for decision in run.decisions if decision[0] == 2]
    assert [link for _, _, link, *_ in home][:2] == [0, 1]
    assert "emergency_land" not in run.flown


def test_the_last_link_is_tried_again_at_once() -> None:
    run = start("emergency_land").until_flies("goto")
    run.runtime.leave()
    run.until_flies("emergency_land")
    sent = len(run.flown)
    fail(run, "late")
    run.tick()
    assert run.flown[sent:] == ["emergency_land"]


def test_late_link_is_retried_a_bounded_number_of_times() -> None:
    run = start("return_home", "emergency_land", "hover").until_flies("goto")
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "no-progress"))
    answered = len(run.flown) - 1
    for _ in range(2_000):
        if run.ending is not None:
            break
        if len(run.flown) > answered:
            answered = len(run.flown)
            fail(run, "late")
        else:
            run.tick()
    assert run.ending is Ending.ABORTED
    assert len(run.flown) < 4 * Limits().tries
    assert "stranded" in run.events
    assert "may be flying" in run.runtime.may_fly


def refusing(run: Run, sent: int, times: int) -> list[int]:
    """An executor that finds permits too late, so many times, after so many commands."""
    executor, left = run.loaded.executor, [times]
    dispatch = executor.dispatch

    def late(sealed: bytes, now_us: int) -> Command | Refusal:
        if left[0] and sent == len(run.flown):
            left[0] -= 1
            return PERMIT_LATE
        return dispatch(sealed, now_us)

    executor.dispatch = late  # type: ignore[method-assign]
    return left


@rows("times", (1, 4))
def test_link_with_late_permit_is_requested_again(times: int) -> None:
    run = start().until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until_flies("hover")
    left = refusing(run, len(run.flown), times)
    run.until_over()
    assert left == [0]
    assert "emergency_land" not in run.flown


def waiting(run: Run) -> Run:
    """The third step is deferred, and held for."""
    run.until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    return run.until_flies("hover")


@rows("reason", REASONS)
def test_a_hold_that_was_late_is_tried_again_and_the_mission_goes_on(reason: str) -> None:
    run = waiting(start("hover"))
    fail(run, reason)
    run.until(lambda run: run.flown[-2:] == ["hover", "hover"], 1)
    assert run.runtime.view(run.clock.now()).stage is RunStage.DECIDING
    run.vehicle.values[OBSTACLE] = 20 * M
    run.until_over()
    assert run.ending is Ending.COMPLETED


def test_a_hold_that_is_late_again_and_again_ends_the_wait() -> None:
    """Then the step's chain flies, without its holds."""
    run = waiting(start("hover"))
    for _ in range(Limits().tries):
        fail(run, "late")
        run.until(lambda run: run.events[-1] == "dispatched", 1)
    assert run.runtime.view(run.clock.now()).stage is RunStage.DECIDING
    fail(run, "late")
    assert run.flown[-1] == "return_home"


def test_hold_with_late_permit_is_requested_again() -> None:
    run = start().until_flies("goto")
    left = refusing(run, len(run.flown), 2)
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    assert left == [0]
    run.vehicle.values[OBSTACLE] = 20 * M
    run.until_over()
    assert run.ending is Ending.COMPLETED
