"""The search detects a broken runtime: each mutation here makes it fail with its message."""

from collections.abc import Callable
from dataclasses import replace as with_fields
from typing import Any

import pytest
from msgspec.structs import replace

from model.graph import longest
from model.searching import Broken, Found, Search
from model.small import BACK, DOWN, HOLD, LINK, VEHICLE, WORST, Small, small
from reference.flat_case import GOTO, HOME, TAKEOFF
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import AfterSilence
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.ports import Command
from rtshcua.onboard.runtime.controller import MissionController
from rtshcua.onboard.runtime.dispatcher import Dispatcher
from rtshcua.onboard.runtime.fallback_flight import Fallback
from rtshcua.onboard.runtime.link import LinkSupervision
from rtshcua.onboard.runtime.runtime import EventHandler
from rtshcua.onboard.runtime.supervisor import Grace, Supervisor

LITTLE = small("little", (TAKEOFF, HOME), ("good",), VEHICLE, contingency=(BACK, DOWN), chain=(HOLD,))
#: a run that holds in the air for an approval that never arrives
HOLDING = small("holding", (TAKEOFF, GOTO), ("good",), VEHICLE, confirm=True)
#: a run in which no silence ends the mission
GOING_ON = small(
    "going on", (TAKEOFF, HOME), ("good", "blind"), (*VEHICLE, *LINK), contingency=(DOWN,), chain=(HOLD,),
    after=AfterSilence.CONTINUE,
)  # fmt: skip


def with_events(*events: str) -> Small:
    """A small run in good weather with arbitrary vehicle behaviour and these events."""
    return with_fields(LITTLE, events=(*VEHICLE, *events))


def endless(found: Found) -> bool:
    """Whether some path never ends."""
    return bool(longest([[(target, units) for target, units, _ in edges] for edges in found.edges])[1])


# ------------------------------------------------------------------------------------------- safety


def two_at_once(of: Any) -> Any:
    """Do not end the running command when another one is sent."""
    return lambda self, now, event, detail="": None if event == "replaced" else of(self, now, event, detail)


def higher(of: Any) -> Any:
    """Command a greater height than permitted."""

    def command(self: Any, *key: int) -> Any:
        made = of(self, *key)
        return replace(made, altitude=made.altitude + 1)

    return command


def another_skill(of: Any) -> Any:
    """Let a link land, whatever was permitted."""

    def command(self: Any, kind: int, *more: int) -> Any:
        made = of(self, kind, *more)
        return made if kind == 0 else replace(made, kind=MotionKind.LAND)

    return command


def past_the_executor(of: Any) -> Any:
    """Send a command other than that of the executor."""

    def send(self: Any, now: Any, dispatch: Any, *more: Any) -> bool:
        return bool(of(self, now, replace(dispatch) if isinstance(dispatch, Command) else dispatch, *more))

    return send


def ended_in_the_air(of: Any) -> Any:
    """Let an interrupt end the run, also in the air."""
    return lambda self, now, cause, kind=0: self._end(now, cause)


def without_release(of: Any) -> Any:
    """Stand down without releasing the vehicle."""
    return lambda self, now: None


def nothing_ends(of: Any) -> Any:
    """Treat a landing only as the end of a command."""
    return lambda self, now: self.dispatcher.landed()


NEVER: dict[str, tuple[type, str, Callable[[Any], Any], str, str]] = {
    "two at once": (Dispatcher, "end", two_at_once, "two commands at once", "interrupted"),
    "higher": (Commands, "command", higher, "not what was permitted", "interrupted"),
    "another skill": (Commands, "command", another_skill, "another skill", "interrupted"),
    "past the executor": (Dispatcher, "_send", past_the_executor, "sent past the executor", "interrupted"),
    "ended in the air": (MissionController, "break_off", ended_in_the_air, "it ended", "interrupted"),
    "a landing ends nothing": (MissionController, "down", nothing_ends, "it ended in the air", "interrupted"),
    "without release": (Dispatcher, "release", without_release, "it went on after", "taken over"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NEVER)
def test_broken_safety_property_is_detected(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, method, broken, words, event = NEVER[name]
    monkeypatch.setattr(owner, method, broken(getattr(owner, method)))
    with pytest.raises(Broken, match=words):
        Search(with_events(event)).run()


def goes_on(of: Any) -> Any:
    """Record a takeover or a crash without a reaction."""
    return lambda self, now, event: None


def judges_at_once(of: Any) -> Any:
    """Judge the old state as soon as the link is back."""
    return lambda self, now_us: False


def grace_runs(of: Any) -> Any:
    """Count the time without judgement as normal time."""
    return lambda self, us: None


def flies_on(of: Any) -> Any:
    """Record a failed hold without a reaction."""

    def fall_back(self: Any, kind: int, cause: Any = None, *, holds: bool = True) -> None:
        if holds:
            of(self, kind, *([] if cause is None else [cause]))

    return fall_back


AFTER: dict[str, tuple[type, str, Callable[[Any], Any], str, Small]] = {
    "it goes on after a takeover": (EventHandler, "_ended", goes_on, "it went on", with_events("taken over")),
    "it goes on after a crash": (EventHandler, "_ended", goes_on, "it went on", with_events(*WORST)),
    "stale state is judged": (
        LinkSupervision, "awaits", judges_at_once, "judged what was known before a silence",
        with_events(*LINK, "silence")),
    "grace runs through silence": (
        Grace, "stood", grace_runs, "its grace ran while the link was down",
        GOING_ON),
    "a failed stop flies on": (
        MissionController, "fall_back", flies_on, "left flying after a stop that failed", HOLDING),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", AFTER)
def test_broken_liveness_property_is_detected(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, method, broken, words, of = AFTER[name]
    monkeypatch.setattr(owner, method, broken(getattr(owner, method)))
    with pytest.raises(Broken, match=words):
        Search(of).run()


# --------------------------------------------------------------------------------------- liveness


def lasting_links(of: Any) -> Any:
    """Let the time limit of a link never expire."""

    def turn(self: Any, now: Any, state: Any) -> bool:
        return True if self._dispatcher.active is not None else of(self, now, state)

    return turn


ENDLESS: dict[str, tuple[type, str, Callable[[Any], Any], str]] = {
    "steps last": (Supervisor, "violated", lambda of: lambda self, state, now, *_: None, "interrupted"),
    "links last": (Fallback, "turn", lasting_links, "interrupted"),
    "nothing is insisted on": (
        Fallback, "_insist", lambda of: lambda self, now, state: True, "interrupted"),
    "silence is waited out": (MissionController, "stand_down", lambda of: lambda self, now, ending: None, LINK[0]),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", ENDLESS)
def test_endless_path_is_detected(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, method, broken, event = ENDLESS[name]
    monkeypatch.setattr(owner, method, broken(getattr(owner, method)))
    # a cycle in a part is a cycle in the whole
    parts = (Search(with_events(event)).run(most) for most in (150, 400, 3_000))
    assert any(endless(found) for found in parts)
