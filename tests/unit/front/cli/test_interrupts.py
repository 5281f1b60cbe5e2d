"""The effect of each Ctrl-C."""

import os
import signal
import threading
from typing import Any

import pytest

from rtshcua.app.fly import stop_wishes
from rtshcua.app.fly.stop_wishes import Interrupts, Wish
from rtshcua.front.cli.interrupts import Stopped, StopRequest


@pytest.fixture
def at(monkeypatch: pytest.MonkeyPatch) -> Any:
    moment = [100.0]
    monkeypatch.setattr(stop_wishes.time, "monotonic", lambda: moment[0])
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


def test_simultaneous_signals_are_not_lost(at: Any) -> None:
    with Interrupts() as requests:
        for _ in range(3):
            press()
        assert [requests.wish() for _ in range(4)] == [Wish.LAND, Wish.KNOW, Wish.LEAVE, None]


def test_the_handlers_before_are_put_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interrupts():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stop_request_raises_only_at_its_checkpoints(number: signal.Signals) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        with StopRequest() as stop:
            stop.look()
            press(number)
            assert stop.asked
            for _ in range(2):
                with pytest.raises(Stopped):
                    stop.look()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGINT, before)


def test_ignored_sigint_stays_ignored() -> None:
    """A shell starts background jobs this way."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with StopRequest() as stop:
            press()
            assert not stop.asked
            press(signal.SIGTERM)
            assert stop.asked
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_install_no_handler() -> None:
    seen = []

    def work() -> None:
        with StopRequest() as stop:
            seen.append(stop.asked)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [False]
