"""What an interrupted run left the vehicle doing, according to its log."""

from collections.abc import Sequence

import pytest

from reference.documents import low, replacement
from reference.flat_case import BATTERY
from reference.world import FakeVehicle, Run, loaded, renewed, sealed_again
from rtshcua.onboard.left import Left, left_by
from rtshcua.onboard.ports import AirState, CommandFailed, Obeyed, Presented, Ready, TakenOver

HERE, THERE = (473_977_400, 85_455_900, 494_000), (473_979_400, 85_455_900, 494_000)


def left(run: Run, lines: Sequence[bytes] | None = None) -> Left | None:
    bundle = run.loaded.bundle
    return left_by(run.lines if lines is None else lines, sealed_again(run.loaded), bundle.policy, bundle.mission)


def in_force(run: Run, lines: Sequence[bytes] | None = None) -> list[tuple[str, tuple[int, int, int] | None]]:
    found = left(run, lines)
    assert found is not None
    return [(each.command.skill, each.named) for each in found.in_force]


def obeys(run: Run, target: tuple[int, int, int] | None = None) -> None:
    """The vehicle is observed to obey the last command."""
    run.tick(Obeyed(0, run.vehicle.commands[-1].token, target))


def test_earlier_commands_stay_in_force_until_the_next_is_obeyed() -> None:
    run = Run().until_flies("takeoff")
    assert in_force(run) == [("takeoff", None)]
    obeys(run, HERE)
    run.until_flies("goto")
    assert in_force(run) == [("takeoff", HERE), ("goto", None)]
    obeys(run, THERE)
    assert in_force(run) == [("goto", THERE)]
    obeys(run, HERE)
    assert in_force(run) == [("goto", HERE)], "another leg"
    found = left(run)
    assert found is not None
    assert found.in_force[0].command.geo == run.vehicle.commands[-1].geo


def test_succeeded_command_counts_as_obeyed() -> None:
    run = Run().until_flies("inspect_area")
    assert in_force(run) == [("goto", None), ("inspect_area", None)]


def test_allowed_command_may_have_been_sent() -> None:
    """The record of a fallback may be the last one written, after its frame was sent."""
    run = Run().until_flies("goto")
    obeys(run, THERE)
    run.vehicle.fails.add("goto")
    run.until_flies("hover")
    at = max(n for n, line in enumerate(run.lines) if b'"dispatched"' in line)
    assert in_force(run, run.lines[:at]) == in_force(run) == [("goto", THERE), ("hover", None)]


def test_late_step_leaves_no_command_in_force() -> None:
    run = Run().until_flies("goto")
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "late"))
    unsent = max(n for n, line in enumerate(run.lines) if b'"permit/unsent"' in line)
    assert in_force(run, run.lines[:unsent]) == [("takeoff", None), ("goto", None)]
    assert in_force(run, run.lines[: unsent + 1]) == [("takeoff", None)]
    assert in_force(run) == [("takeoff", None), ("goto", None)], "again"


def test_the_target_of_a_degrade_rule_is_known_by_its_skill() -> None:
    run = Run().until_flies("goto")
    run.vehicle.values[BATTERY] = 2_400
    run.until_flies("return_home")
    at = max(n for n, line in enumerate(run.lines) if b'"dispatched"' in line)
    assert in_force(run, run.lines[:at])[-1] == in_force(run)[-1] == ("return_home", None)


def test_no_command_in_force_after_landing() -> None:
    assert left(Run().until_over()) == Left(())
    run = Run().until_flies("goto")
    run.tick(AirState(0, False, False))
    assert left(run) == Left(())


def test_a_takeover_is_remembered() -> None:
    run = Run().until_flies("goto")
    run.tick(TakenOver(0, "Position"))
    found = left(run)
    assert found is not None
    assert found.taken == "Position"


def test_resumed_run_knows_no_command_before_one_is_obeyed() -> None:
    of = loaded()
    run = Run(renewed(of), FakeVehicle(armed=True, airborne=True), resumed=True, ready=False)
    run.tick(AirState(0, True, True), Ready(0))
    run.until_flies("hover")
    assert left(run) is None
    obeys(run)
    assert in_force(run) == [("hover", None)]


def test_a_replaced_mission_has_steps_that_are_not_known() -> None:
    of = low()
    run = Run(of).until_flies("goto")
    run.tick(Presented(0, replacement(of, 2, of.bundle.mission)))
    assert "replacement" in run.events
    assert left(run) is None


@pytest.mark.parametrize("cut", [0, 1])
def test_log_without_flight_gives_nothing(cut: int) -> None:
    run = Run().until_flies("takeoff")
    assert left(run, run.lines[:cut]) is None


def test_other_or_unreadable_log_gives_nothing() -> None:
    run = Run().until_flies("goto")
    bundle = run.loaded.bundle
    assert left_by(run.lines, b"another", bundle.policy, bundle.mission) is None
    assert left(run, [*run.lines, b"{}\n"]) is None
    assert left(run, run.lines[1:]) is None


def test_unknown_target_gives_nothing() -> None:
    run = Run().until_flies("takeoff")
    obeys(run, HERE)
    at = next(n for n, line in enumerate(run.lines) if b'"obeyed"' in line)
    wrong = run.lines[at].replace(b"473977400", b"somewhere")
    assert left(run, [*run.lines[:at], wrong]) is None


def test_step_outside_bundle_gives_nothing() -> None:
    run = Run().until_flies("takeoff")
    at = next(n for n, line in enumerate(run.lines) if b'"dispatched"' in line)
    assert left(run, [*run.lines[:at], run.lines[at].replace(b'"step":0', b'"step":99')]) is None
