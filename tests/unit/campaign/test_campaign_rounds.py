"""A campaign gives the same results with any workers, order of completion and interruption."""

import os
import signal
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

import pytest

from rtshcua.campaign.drawing import FaultSpace
from rtshcua.campaign.rounds import (
    FIRST,
    LOST,
    ROUND,
    CampaignFlight,
    CampaignOrder,
    CampaignResult,
    FlownMission,
    JudgeFinding,
    drawn,
    fly_rounds,
    read_results,
    result_line,
    rounds,
    tally,
)
from rtshcua.campaign.workers import Here, WorkerProcesses

S = 1_000_000
SPACE = FaultSpace(("takeoff", "goto", "return_home"), {"px4": 60 * S, "ardupilot": 70 * S})
FIELD = FlownMission(b"bundle", b"root", ())
ORDER = CampaignOrder(5, 230, SPACE)


def result(flight: CampaignFlight) -> CampaignResult:
    """Make a result from the flight's number only."""
    chance = Random(flight.number)
    moments = tuple((label, chance.randrange(60 * S)) for label in ("airborne", "down"))
    failed = (JudgeFinding("late", "too late", 3),) if flight.number % 7 == 0 else ()
    texts = tuple(each.text for each in flight.scenario.incidents)
    flavour, seed = flight.scenario.flavours[0], flight.scenario.first_seed
    return CampaignResult(
        flight.number, flavour, seed, texts, flight.tries, "completed", failed, (), {}, moments, 60 * S, "00"
    )  # fmt: skip


class Shuffled:
    """Workers that return results in a given order and are interrupted after `most` flights."""

    def __init__(self, seed: int = 0, most: int = 10**9) -> None:
        self.chance, self.left = Random(seed), most
        self.flown: list[int] = []

    def fly(self, field: FlownMission, flights: Sequence[CampaignFlight]) -> Iterator[CampaignResult]:
        assert field is FIELD
        for flight in self.chance.sample(flights, len(flights)):
            if not self.left:
                raise KeyboardInterrupt
            self.left -= 1
            self.flown.append(flight.number)
            yield result(flight)

    def close(self) -> None:
        pass


def all_of(workers: Shuffled, past: dict[int, CampaignResult] | None = None) -> dict[int, CampaignResult]:
    flown = {} if past is None else past
    fly_rounds(ORDER, FIELD, workers, flown, lambda _: None)
    return flown


def test_rounds_contain_every_number_once() -> None:
    assert [number for each in rounds(333) for number in each] == list(range(333))
    assert [len(each) for each in rounds(333)] == [FIRST, ROUND, ROUND, ROUND, 13]


def test_results_do_not_depend_on_the_order_of_completion() -> None:
    assert all_of(Shuffled(1)) == all_of(Shuffled(2))


@pytest.mark.slow
@pytest.mark.parametrize("most", [0, 1, FIRST - 1, FIRST, FIRST + 1, FIRST + ROUND + 50])
def test_interrupted_campaign_continues_with_equal_results(most: int) -> None:
    first = Shuffled(3, most)
    past: dict[int, CampaignResult] = {}
    with pytest.raises(KeyboardInterrupt):
        all_of(first, past)
    assert len(past) == most
    kept = read_results([result_line(each) for each in past.values()])
    second = Shuffled(4)
    assert all_of(second, kept) == all_of(Shuffled(5))
    assert sorted(first.flown + second.flown) == list(range(ORDER.flights))


def test_campaign_can_be_extended() -> None:
    few: dict[int, CampaignResult] = {}
    fly_rounds(CampaignOrder(5, 40, SPACE), FIELD, Shuffled(), few, lambda _: None)
    assert few == {number: each for number, each in all_of(Shuffled()).items() if number < 40}


def test_flight_can_be_drawn_again_by_number() -> None:
    flown = all_of(Shuffled())
    for number in (0, FIRST, FIRST + ROUND + 7):
        made = drawn(ORDER, number, flown)
        assert tuple(each.text for each in made.scenario.incidents) == flown[number].incidents
        assert made.tries == flown[number].tries


def test_truncated_line_counts_as_not_flown() -> None:
    lines = [result_line(each) for each in all_of(Shuffled()).values()]
    torn = [*lines[:-1], lines[-1][: len(lines[-1]) // 2]]
    assert len(read_results(torn)) == ORDER.flights - 1
    assert len(read_results([b"\xff\n", b"{}\n", b"\n", *lines])) == ORDER.flights


def test_pairs_of_kind_and_moment_are_counted() -> None:
    flown = all_of(Shuffled())
    seen = tally(flown[number] for number in sorted(flown))
    assert {each.label for each in seen.moments["px4"]} == {"airborne", "down"}
    assert sum(seen.tried.values()) == sum(len(each.tries) for each in flown.values())


# ------------------------------------------------------------------------------ processes


class Nothing(FlownMission):
    """Work that must not be called."""

    __slots__ = ()

    def fly(self, flight: CampaignFlight) -> CampaignResult:
        return result(flight)


class DiesOnce(Nothing):
    """Flight 3 kills its process, unless a marker file exists."""

    __slots__ = ()

    def fly(self, flight: CampaignFlight) -> CampaignResult:
        return _dies_once(Path(self.root.decode()), flight)


class DiesAlways(Nothing):
    """Flight 3 kills its process."""

    __slots__ = ()

    def fly(self, flight: CampaignFlight) -> CampaignResult:
        return _dies_always(flight)


def _dies_once(mark: Path, flight: CampaignFlight) -> CampaignResult:
    if flight.number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return result(flight)


def _dies_always(flight: CampaignFlight) -> CampaignResult:
    if flight.number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return result(flight)


def few() -> list[CampaignFlight]:
    return [CampaignFlight(number, drawn(ORDER, number, {}).scenario) for number in range(5)]


@pytest.mark.slow
def test_flight_of_a_dead_worker_is_flown_again(tmp_path: Path) -> None:
    processes = WorkerProcesses(1)
    flown = list(processes.fly(DiesOnce(b"", str(tmp_path / "died").encode(), ()), few()))
    processes.close()
    assert sorted(flown, key=lambda each: each.number) == [result(flight) for flight in few()]


@pytest.mark.slow
def test_flight_that_kills_every_worker_is_a_failure() -> None:
    processes = WorkerProcesses(1)
    flown = sorted(processes.fly(DiesAlways(b"", b"", ()), few()), key=lambda each: each.number)
    processes.close()
    assert flown == [FIELD.lost(flight) if flight.number == 3 else result(flight) for flight in few()]
    assert flown[3].failures[0].slug == LOST


def test_campaign_runs_in_one_process() -> None:
    assert list(Here().fly(Nothing(b"", b"", ()), few())) == [result(flight) for flight in few()]
    assert FIRST < ROUND


class Enough(Exception):
    """Raised to stop waiting for flights."""


class NeverEnds(Nothing):
    """A flight that does not end in time."""

    __slots__ = ()

    def fly(self, flight: CampaignFlight) -> CampaignResult:
        while True:
            signal.pause()


@pytest.mark.slow
def test_stop_does_not_wait_for_flights_in_progress() -> None:
    looks = iter([None, None])

    def look() -> None:
        if next(looks, Enough) is Enough:
            raise Enough

    processes = WorkerProcesses(1, look)
    with pytest.raises(Enough):
        list(processes.fly(NeverEnds(b"", b"", ()), few()))
    processes.close()


@pytest.mark.slow
def test_stop_prints_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the processes are gone before the pool notices that it is closed."""
    said = list[object]()
    monkeypatch.setattr(threading, "excepthook", said.append)
    looks = iter([None, None])

    def look() -> None:
        if next(looks, Enough) is Enough:
            raise Enough

    processes = WorkerProcesses(1, look)
    with pytest.raises(Enough):
        list(processes.fly(NeverEnds(b"", b"", ()), few()))
    assert processes._pool is not None
    for process in (*processes._pool._processes.values(),):
        process.kill()
        process.join()
    processes.close()
    assert said == []
