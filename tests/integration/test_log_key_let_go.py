"""The log key signs the first record of a flight; after that the process no longer holds it."""

import gc
from typing import Any

import pytest

from rtshcua.app.fly.flight_session import FlightSession
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.wire.keys import Duty, SigningKey


class Enough(Exception):
    """This is all that is asked."""


def held(public: bytes) -> list[SigningKey]:
    """All objects that are that key. It was made in this test, so none is among those that are frozen."""
    gc.collect()
    return [each for each in gc.get_objects() if isinstance(each, SigningKey) and each.public == public]


@pytest.mark.slow
def test_log_key_is_released_before_the_flight(ground: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = ground.bundle()
    public = ground.store.signing_key(Duty.LOG).public
    here = ground.store.signing_key(Duty.LOG)
    assert held(public) == [here], "it would be found"
    del here
    found: list[int] = []

    def fly(session: FlightSession) -> Any:
        found.append(len(held(public)))
        session.refuse()
        raise Enough

    monkeypatch.setattr(FlightSession, "fly", fly)
    monkeypatch.chdir(ground.folder)
    assert app.main(["run", bundle, "--json", "--speed", "20"]) == ExitCode.FAULT
    assert found == [0]
