"""A program that fails in the air warns that the vehicle may be flying, and names the command that lands it."""

from types import SimpleNamespace
from typing import Any

import pytest

from rtshcua.app.fly.flight_session import FlightSession


@pytest.mark.parametrize("error", [RuntimeError("bug"), KeyboardInterrupt(), MemoryError(), OSError(5, "gone")])
@pytest.mark.parametrize("aloft", [True, False])
def test_failure_is_reported_with_the_vehicles_possible_reaction(error: BaseException, aloft: bool) -> None:
    said: list[str] = []
    closed: list[Any] = []

    def follow() -> None:
        raise error

    flight: Any = FlightSession.__new__(FlightSession)
    flight._runtime = SimpleNamespace(aloft=aloft)
    flight._feed = SimpleNamespace(post=lambda note: said.append(note.text))
    flight._follow, flight._close = follow, closed.append
    flight._witnesses = SimpleNamespace(finish=lambda note, closed: None)
    with pytest.raises(type(error)):
        flight.fly()
    assert closed == [None], "the log stays unsigned, for recovery"
    assert [("may be flying" in text, "rtshcua run" in text) for text in said] == [(True, True)] * aloft
