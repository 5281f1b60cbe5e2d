"""What each Ctrl-C asks for."""

import os
import signal
from typing import Any

import pytest

from rtshcua.cli import interrupts
from rtshcua.cli.interrupts import Interrupts, Wish


@pytest.fixture
def at(monkeypatch: pytest.MonkeyPatch) -> Any:
    moment = [100.0]
    monkeypatch.setattr(interrupts.time, "monotonic", lambda: moment[0])
    return moment


def press(number: signal.Signals = signal.SIGINT) -> None:
    os.kill(os.getpid(), number)


def test_land_then_know_then_leave(at: Any) -> None:
    with Interrupts() as requests:
        assert requests.wish() is None
        press()
        assert requests.wish() is Wish.LAND
        press()
        assert requests.wish() is Wish.KNOW
        at[0] += 2
        press()
        assert requests.wish() is Wish.LEAVE
        assert requests.wish() is None


def test_slow_ones_only_ask(at: Any) -> None:
    with Interrupts() as requests:
        press(signal.SIGTERM)
        assert requests.wish() is Wish.LAND
        for _ in range(4):
            at[0] += 10
            press(signal.SIGHUP)
            assert requests.wish() is Wish.KNOW


def test_none_is_lost_when_they_come_at_once(at: Any) -> None:
    with Interrupts() as requests:
        for _ in range(3):
            press()
        assert [requests.wish() for _ in range(4)] == [Wish.LAND, Wish.KNOW, Wish.LEAVE, None]


def test_the_handlers_before_are_put_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interrupts():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before
