"""The loop executes actions in order, none too late, and none before its required record."""

from collections.abc import Sequence
from typing import Any

import pytest

from rtshcua.adapters.loop import HELD_WAIT_US, WAIT_US, RunLoop
from rtshcua.model.durability import BUFFERED, SYNCED, SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import (
    Append,
    Command,
    CommandFailed,
    End,
    Ending,
    EvidenceFailed,
    EvidenceKept,
    Interrupted,
    Noted,
    Release,
    Succeeded,
)


def command(token: int, not_after_us: int, *, needs_record: bool) -> Command:
    return Command(token, "hover", 0, (), (), 0, 0, needs_record=needs_record, not_after_us=not_after_us)


class World:
    """All ports in one object, with a scripted runtime."""

    def __init__(self, *script: Sequence[Any]) -> None:
        self.now_us = 1_000
        self.did: list[Any] = []
        self.full = False
        self.slow = False
        self.kept = self.synced = 0
        self.given = 0
        self.troubles: list[str] = []
        self.lags: list[str] = []
        self.polled: list[int] = []
        self.events: list[Any] = []
        self.saw: list[Any] = []
        self.script = list(script)
        self.coming: list[Any] = []
        self.prepared: list[Any] = []
        self.doing: Sequence[Any] = ()
        self.loop = RunLoop(self, self, self, self, lambda *seen: self.saw.append(seen))

    def now(self) -> Now:
        return Now(self.now_us, self.now_us, 0)

    def poll(self, now_us: int, timeout_us: int) -> Sequence[Any]:
        self.polled.append(timeout_us)
        coming, self.coming = self.coming, []
        return coming

    def begin(self, command: Command, now_us: int) -> None:
        self.did.append(("begin", command.token))

    def release(self) -> None:
        self.did.append("release")

    def append(self, line: bytes, durability: int) -> int:
        self.given += 1
        if self.full:
            raise OSError(28, "no space left on device")
        self.did.append(line)
        if not self.slow:
            self.kept = self.synced = self.given
        return self.given

    def trouble(self) -> str | None:
        return self.troubles.pop(0) if self.troubles else None

    def late(self) -> str | None:
        return self.lags.pop(0) if self.lags else None

    def close(self) -> None:
        pass

    def react(self, now: Now, events: Sequence[Any]) -> Command | None:
        self.events = list(events)
        self.doing = self.script.pop(0) if self.script else []
        done = [action for action in self.doing if not isinstance(action, Append)]
        first = done[0] if done else None
        return first if isinstance(first, Command) and not first.needs_record else None

    def actions(self, now: Now) -> Sequence[Any]:
        return self.doing

    def prepare(self, now: Now) -> None:
        self.prepared.append((now, len(self.did)))


def test_actions_are_carried_out_in_their_order() -> None:
    actions = [Append(b"1", WRITTEN), command(7, 1_000, needs_record=True), Append(b"2", WRITTEN), Release()]
    world = World(actions)
    assert world.loop.turn() is None
    assert world.did == [b"1", ("begin", 7), b"2", "release"]
    assert world.saw == [(Now(1_000, 1_000, 0), [], actions)]


def test_late_command_is_not_sent_and_is_reported() -> None:
    world = World([command(7, 999, needs_record=False)])
    world.loop.turn()
    assert world.did == []
    world.loop.turn()
    assert world.events == [CommandFailed(1_000, 7, "late")]
    assert world.polled == [WAIT_US, 0]  # and reported at once


def test_unrecorded_command_is_withheld() -> None:
    world = World([Append(b"1", WRITTEN), command(7, 1_000, needs_record=True)])
    world.full = True
    world.loop.turn()
    assert world.did == []
    world.loop.turn()
    assert world.events == [
        EvidenceFailed(1_000, "no space left on device"), CommandFailed(1_000, 7, "withheld"),
    ]  # fmt: skip


def test_fallback_is_sent_even_if_recording_fails() -> None:
    world = World([Append(b"1", WRITTEN), command(7, 1_000, needs_record=False)])
    world.full = True
    world.loop.turn()
    assert world.did == [("begin", 7)]


def test_earlier_recording_failure_does_not_withhold_a_step() -> None:
    world = World([Append(b"1", WRITTEN)], [Append(b"2", WRITTEN), command(7, 1_000, needs_record=True)])
    world.full = True
    world.loop.turn()
    world.full = False
    world.loop.turn()
    assert world.did == [b"2", ("begin", 7)]


def test_events_from_elsewhere_come_first_and_without_waiting() -> None:
    world = World()
    world.coming = [Succeeded(900, 7)]
    world.loop.turn([Interrupted(950)])
    assert world.events == [Interrupted(950), Succeeded(900, 7)]
    assert world.polled == [0]


def test_the_end_comes_after_all_else_was_done() -> None:
    world = World([End(Ending.COMPLETED), Append(b"last", SYNCED_FIRST)])
    assert world.loop.turn() is Ending.COMPLETED
    assert world.did == [b"last"]


STEP = [Append(b"allowed", WRITTEN), command(7, 5_000, needs_record=True), Append(b"dispatched", WRITTEN)]


def held(*script: Sequence[Any]) -> World:
    """A world with a slow disk, after an admitted step."""
    world = World(STEP, *script)
    world.slow = True
    world.loop.turn()
    assert world.did == [b"allowed", b"dispatched"]
    world.did.clear()
    return world


def test_a_step_waits_for_its_own_record_alone_and_the_loop_goes_on() -> None:
    world = held()
    world.loop.turn()
    assert (world.did, world.polled) == ([], [WAIT_US, HELD_WAIT_US])
    world.kept = 1  # the decision; later lines may take longer
    world.loop.turn()
    assert world.did == [("begin", 7)]
    world.loop.turn()
    assert world.did == [("begin", 7)]
    assert world.polled[-1] == WAIT_US


def test_a_record_that_takes_too_long_makes_its_step_late() -> None:
    world = held()
    world.now_us = 5_001
    world.loop.turn()
    assert world.events == [CommandFailed(5_001, 7, "late")]
    world.kept = 2
    world.loop.turn()
    assert world.did == []


def test_record_written_after_the_deadline_changes_nothing() -> None:
    world = held()
    world.now_us, world.kept = 5_001, 2
    world.loop.turn()
    assert world.did == []
    assert world.events == [CommandFailed(5_001, 7, "late")]


def test_a_fallback_passes_a_step_that_waits_and_replaces_it() -> None:
    world = held([Append(b"violated", WRITTEN), command(8, 9_000, needs_record=False)])
    world.loop.turn()
    assert world.did == [("begin", 8), b"violated"]  # recorded when the frame is on its way
    world.kept = 9
    world.loop.turn()
    assert world.did == [("begin", 8), b"violated"]


def test_record_of_fallback_is_appended_even_if_its_frame_fails() -> None:
    world = World([Append(b"1", WRITTEN), command(7, 1_000, needs_record=False), Append(b"2", WRITTEN)])

    def refuses(command: Command, now_us: int) -> None:
        raise RuntimeError("no vehicle")

    world.begin = refuses  # type: ignore[method-assign]
    with pytest.raises(RuntimeError, match="no vehicle"):
        world.loop.turn()
    assert world.did == [b"1", b"2"]


def test_a_fallback_does_not_pass_what_is_done_to_the_vehicle_before_it() -> None:
    world = World([Release(), Append(b"1", WRITTEN), command(7, 1_000, needs_record=False)])
    world.loop.turn()
    assert world.did == ["release", b"1", ("begin", 7)]


def test_the_runtime_looks_ahead_when_all_is_done() -> None:
    world = World([Append(b"1", WRITTEN), command(7, 1_000, needs_record=False)])
    world.loop.turn()
    assert world.did == [("begin", 7), b"1"]
    assert world.prepared == [(Now(1_000, 1_000, 0), 2)]


@pytest.mark.parametrize("action", [Release(), End(Ending.STOOD_DOWN)])
def test_standing_down_drops_a_step_that_waits(action: Any) -> None:
    world = held([action])
    world.loop.turn()
    world.kept = 9
    world.loop.turn()
    assert ("begin", 7) not in world.did


def test_disk_failure_withholds_a_waiting_step() -> None:
    world = held()
    world.troubles = ["input/output error"]
    world.loop.turn()
    assert world.events == [EvidenceFailed(1_000, "input/output error"), CommandFailed(1_000, 7, "withheld")]
    world.kept = 9
    world.loop.turn()
    assert world.did == []


def test_recording_failure_is_reported_without_a_waiting_step() -> None:
    world = World([Append(b"1", SYNCED)])
    world.slow = True
    world.loop.turn()
    world.kept, world.troubles = 1, ["input/output error"]
    world.loop.turn()
    assert world.events == [EvidenceFailed(1_000, "input/output error")]
    assert world.polled == [WAIT_US, 0]


@pytest.mark.parametrize("durability", [WRITTEN, SYNCED])
def test_step_waits_until_its_record_is_written(durability: int) -> None:
    world = World([Append(b"allowed", durability), command(7, 5_000, needs_record=True)])
    world.slow = True
    world.loop.turn()
    assert world.did == [b"allowed"]
    world.kept = 1
    world.loop.turn()
    assert world.did == [b"allowed", ("begin", 7)]


def test_a_step_whose_record_is_to_be_synced_first_waits_for_the_disk() -> None:
    world = World([Append(b"allowed", SYNCED_FIRST), command(7, 5_000, needs_record=True)])
    world.slow = True
    world.loop.turn()
    world.kept = 1
    world.loop.turn()
    assert world.did == [b"allowed"]
    world.synced = 1
    world.loop.turn()
    assert world.did == [b"allowed", ("begin", 7)]


def test_step_does_not_wait_for_an_earlier_seal() -> None:
    seal = Append(b"seal", SYNCED_FIRST, awaited=False)
    world = World([seal, Append(b"allowed", SYNCED), command(7, 5_000, needs_record=True)])
    world.slow = True
    world.loop.turn()
    world.kept = 2
    world.loop.turn()
    assert ("begin", 7) in world.did


def test_step_with_buffered_record_is_withheld_only_if_it_is_refused() -> None:
    effects = [Append(effect, WRITTEN, awaited=False) for effect in (b"succeeded", b"replaced")]
    step = [effects[0], Append(b"allowed", BUFFERED), effects[1], command(7, 5_000, needs_record=True)]
    world = World(step)
    world.slow = True
    world.loop.turn()
    assert world.did == [b"succeeded", b"allowed", b"replaced", ("begin", 7)]
    world = World(step)
    world.full = True
    world.loop.turn()
    assert world.did == []


def test_recovered_recording_is_reported_once() -> None:
    world = World([Append(b"1", WRITTEN)], [Append(b"2", WRITTEN)])
    world.slow = True
    world.loop.turn()
    world.troubles = ["input/output error"]
    for _ in range(3):
        world.loop.turn()
        assert EvidenceKept(1_000) not in world.events
    world.kept = 2
    world.loop.turn()
    assert world.events == [], "what was refused is written, and not yet on the disk"
    world.synced = 1
    world.loop.turn()
    assert world.events == [EvidenceKept(1_000)]
    world.loop.turn()
    assert world.events == []


def test_a_line_that_is_late_on_the_disk_is_noted() -> None:
    world = World()
    world.lags = ["not on the disk yet"]
    world.loop.turn()
    assert world.events == [Noted(1_000, "not on the disk yet")]
