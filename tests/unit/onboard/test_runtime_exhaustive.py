"""Every sequence of events up to a depth, from several situations: what must never, and what must always happen.

Never: a command without a checked permit; a step while another flies; a step after a return or a landing of
a fallback; anything after the end or after standing down. Always: an end, once the vehicle obeys.
"""

from collections.abc import Callable
from itertools import islice, product

import pytest
from msgspec.structs import replace

from reference.flat_case import OBSTACLE, WIND, M, S
from reference.world import SESSION_KEY, FakeVehicle, Run, assert_covered, loaded, renewed
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.onboard.enforcement.executor import Commands, Executor
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import (
    AirState,
    Command,
    CommandFailed,
    End,
    EvidenceFailed,
    Interrupted,
    LinkBack,
    LinkLost,
    Release,
    Succeeded,
    TakenOver,
)

TEMPLATE = loaded()
DEPTH = 3


class Watched(Executor):
    """An executor that remembers what it dispatched."""

    def __init__(self, commands: Commands) -> None:
        super().__init__(SESSION_KEY, commands)
        self.passed: list[Command] = []

    def dispatch(self, sealed: bytes, now_us: int) -> Command | Refusal:
        return self._noted(super().dispatch(sealed, now_us))

    def stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        return self._noted(super().stand_in(sealed, kind, link, now_us))

    def _noted(self, result: Command | Refusal) -> Command | Refusal:
        if isinstance(result, Command):
            self.passed.append(result)
        return result


def fresh() -> tuple[Loaded, Watched]:
    """The same bundle in a new session, without opening it again."""
    of = renewed(TEMPLATE)
    executor = Watched(of.executor._commands)
    return replace(of, executor=executor), executor


def token(run: Run) -> int:
    return run.vehicle.commands[-1].token if run.vehicle.commands else 0


def windy(run: Run) -> None:
    run.vehicle.values[WIND] = 12 * M
    run.tick()


def blind(run: Run) -> None:
    run.vehicle.values[OBSTACLE] = None
    run.tick()


def wait(run: Run) -> None:
    run.clock.advance(3 * S)
    run.tick()


EVENTS: dict[str, Callable[[Run], object]] = {
    "succeeded": lambda run: run.step(Succeeded(0, token(run))),
    "failed": lambda run: run.step(CommandFailed(0, token(run), "no-effect")),
    "landed": lambda run: run.step(AirState(0, False, False)),
    "taken-over": lambda run: run.step(TakenOver(0, "POSCTL")),
    "link-lost": lambda run: run.step(LinkLost(0)),
    "link-back": lambda run: run.step(LinkBack(0)),
    "interrupted": lambda run: run.step(Interrupted(0)),
    "evidence-failed": lambda run: run.step(EvidenceFailed(0, "disk full")),
    "wind": windy,
    "blind": blind,
    "wait": wait,
}

SITUATIONS: dict[str, Callable[[Run], object]] = {
    "taking off": lambda run: None,
    "running": lambda run: run.until_flies("inspect_area"),
    "holding": lambda run: (run.until_flies("goto"), blind(run), run.until_flies("hover")),
    "falling": lambda run: (run.until_flies("goto"), windy(run)),
}


def explore(situation: str, sequence: tuple[str, ...]) -> None:
    of, executor = fresh()
    run = Run(of, FakeVehicle())
    SITUATIONS[situation](run)
    for event in sequence:
        EVENTS[event](run)
    # From here on the link holds, and the vehicle obeys the last command.
    run.step(LinkBack(0))
    run.until_over(400)
    sent = [action for action in run.actions if isinstance(action, Command)]
    assert [id(command) for command in sent] == [id(command) for command in executor.passed]
    assert_covered(run)
    assert_orderly(run)


def assert_orderly(run: Run) -> None:
    flying, homeward = None, False
    for record in run.records:
        match record.get("event"):
            case "dispatched":
                assert flying is None, "one command at a time"
                assert not (homeward and record["kind"] == 0), "no step after a return or a landing began"
                flying = record["token"]
                homeward = homeward or (record["kind"] != 0 and record["detail"] in ("return_home", "emergency_land"))
            case "succeeded" | "failed" | "violated" | "time-over" | "replaced" | "landed" | "released":
                assert record["token"] == flying
                flying = None
    endings = [number for number, action in enumerate(run.actions) if isinstance(action, End)]
    assert len(endings) == 1
    assert endings[0] == len(run.actions) - 1
    released = [number for number, action in enumerate(run.actions) if isinstance(action, Release)]
    assert not any(isinstance(action, Command) for number in released for action in run.actions[number:])


@pytest.mark.slow
@pytest.mark.parametrize("situation", SITUATIONS)
def test_every_event_sequence_ends_without_a_forbidden_command(situation: str) -> None:
    """Each event first and each second in every situation, every pair in one; the other pairs are for soak."""
    for sequence in islice(product(EVENTS, repeat=DEPTH - 1), [*SITUATIONS].index(situation), None, len(SITUATIONS)):
        explore(situation, sequence)


@pytest.mark.soak
@pytest.mark.parametrize("situation", SITUATIONS)
def test_every_longer_sequence_does_too(situation: str) -> None:
    for sequence in product(EVENTS, repeat=DEPTH + 1):
        explore(situation, sequence)
