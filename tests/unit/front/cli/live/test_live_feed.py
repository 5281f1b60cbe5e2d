"""The feed never waits for the view."""

import time

import pytest

from rtshcua.app.fly.story import Happened, Happening, Note
from rtshcua.front.cli.render.live import feed as feed_module
from rtshcua.front.cli.render.live.feed import Feed


def event(number: int) -> Happened:
    return Happened(Happening("ready", number, detail="x" * 500))


def test_a_view_that_does_not_read_holds_nobody_up(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(feed_module, "_MODULE", "timeit")  # does not read its input, and exits by itself
    with Feed("-n1") as feed:
        started = time.monotonic()
        for number in range(2_000):  # far more than a pipe holds
            feed.post(event(number))
            feed.post(Note("dropped when there is no room"), keep=False)
        assert time.monotonic() - started < 2
    assert not feed.shown


def test_kept_lines_are_shown_in_order(capfd: pytest.CaptureFixture[str]) -> None:
    with Feed("json") as feed:
        for number in range(500):
            feed.post(event(number))
    assert feed.shown
    lines = capfd.readouterr().out.splitlines()
    assert [f'"t_us":{number},' in line for number, line in enumerate(lines)] == [True] * 500


def test_a_view_that_cannot_start_is_not_shown(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(feed_module, "_MODULE", "rtshcua.no_such_module")
    with Feed("lines") as feed:
        for number in range(300):
            feed.post(event(number))
    assert not feed.shown
