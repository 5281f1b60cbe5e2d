"""The thin loop: actions in their order, nothing late, nothing unrecorded that had to be recorded."""

from collections.abc import Sequence
from typing import Any

from rtshcua.adapters.loop import WAIT_US, Loop
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import (
    Append,
    Command,
    Dispatch,
    End,
    Ending,
    EvidenceFailed,
    Failed,
    Interrupted,
    Release,
    Show,
    Succeeded,
)

COMMAND = Command(7, "hover", 0, (), (), 0, 0)


class World:
    """All ports in one, and a runtime that says what it is told to."""

    def __init__(self, *script: Sequence[Any]) -> None:
        self.now_us = 1_000
        self.did: list[Any] = []
        self.full = False
        self.polled: list[int] = []
        self.events: list[Any] = []
        self.saw: list[Any] = []
        self.script = list(script)
        self.coming: list[Any] = []
        self.loop = Loop(self, self, self, self, lambda *seen: self.saw.append(seen))

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

    def append(self, line: bytes, durable: bool) -> None:
        if self.full:
            raise OSError(28, "no space left on device")
        self.did.append(line)

    def close(self) -> None:
        pass

    def step(self, now: Now, events: Sequence[Any]) -> Sequence[Any]:
        self.events = list(events)
        return self.script.pop(0) if self.script else []


def test_actions_are_carried_out_in_their_order() -> None:
    actions = [Append(b"1", False), Dispatch(COMMAND, 1_000, True), Append(b"2", False), Show("k", "t"), Release()]
    world = World(actions)
    assert world.loop.turn() is None
    assert world.did == [b"1", ("begin", 7), b"2", "release"]
    assert world.saw == [(Now(1_000, 1_000, 0), [], actions)]


def test_what_is_late_is_not_sent_and_the_runtime_is_told() -> None:
    world = World([Dispatch(COMMAND, 999, False)])
    world.loop.turn()
    assert world.did == []
    world.loop.turn()
    assert world.events == [Failed(1_000, 7, "late")]
    assert world.polled == [WAIT_US, 0]  # and told at once


def test_what_could_not_be_recorded_is_withheld() -> None:
    world = World([Append(b"1", False), Dispatch(COMMAND, 1_000, True)])
    world.full = True
    world.loop.turn()
    assert world.did == []
    world.loop.turn()
    assert world.events == [
        EvidenceFailed(1_000, "no space left on device"), Failed(1_000, 7, "withheld"),
    ]  # fmt: skip


def test_a_fallback_goes_out_even_when_nothing_can_be_recorded() -> None:
    world = World([Append(b"1", False), Dispatch(COMMAND, 1_000, False)])
    world.full = True
    world.loop.turn()
    assert world.did == [("begin", 7)]


def test_a_record_that_failed_before_withholds_nothing_now() -> None:
    world = World([Append(b"1", False)], [Append(b"2", False), Dispatch(COMMAND, 1_000, True)])
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
    world = World([End(Ending.COMPLETED), Append(b"last", True)])
    assert world.loop.turn() is Ending.COMPLETED
    assert world.did == [b"last"]
