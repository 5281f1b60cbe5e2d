"""The search notices when the runtime is broken: each change here makes it fail, and says how."""

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
#: it holds in the air for an approval that does not come
HOLDING = small("holding", (TAKEOFF, GOTO), ("good",), VEHICLE, confirm=True)
#: a silence of any length ends nothing
GOING_ON = small(
    "going on", (TAKEOFF, HOME), ("good", "blind"), (*VEHICLE, *LINK), contingency=(DOWN,), chain=(HOLD,),
    after=AfterSilence.CONTINUE,
)  # fmt: skip


def with_events(*events: str) -> Small:
    """A small run in good weather, where the vehicle does what it likes and besides these happen."""
    return with_fields(LITTLE, events=(*VEHICLE, *events))


def endless(found: Found) -> bool:
    """Whether time may pass for ever."""
    return bool(longest([[(target, units) for target, units, _ in edges] for edges in found.edges])[1])


# ------------------------------------------------------------------------------------------- what must never be


def two_at_once(of: Any) -> Any:
    """The command that flies is not ended when another one is sent."""
    return lambda self, now, event, detail="": None if event == "replaced" else of(self, now, event, detail)


def higher(of: Any) -> Any:
    """A command flies higher than what was permitted."""

    def command(self: Any, *key: int) -> Any:
        made = of(self, *key)
        return replace(made, altitude=made.altitude + 1)

    return command


def another_skill(of: Any) -> Any:
    """A link lands, whatever was permitted."""

    def command(self: Any, kind: int, *more: int) -> Any:
        made = of(self, kind, *more)
        return made if kind == 0 else replace(made, kind=MotionKind.LAND)

    return command


def past_the_executor(of: Any) -> Any:
    """What is sent is not what the executor gave out."""

    def send(self: Any, now: Any, dispatch: Any, *more: Any) -> bool:
        return bool(of(self, now, replace(dispatch) if isinstance(dispatch, Command) else dispatch, *more))

    return send


def ended_in_the_air(of: Any) -> Any:
    """Whoever interrupts it ends it, wherever the vehicle is."""
    return lambda self, now, cause, kind=0: self._end(now, cause)


def without_release(of: Any) -> Any:
    """It stands down without a word to whoever sends."""
    return lambda self, now: None


def nothing_ends(of: Any) -> Any:
    """A landing is taken for the end of a command, and of nothing else."""
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
    """A takeover and a crash are recorded, and nothing follows."""
    return lambda self, now, event: None


def judges_at_once(of: Any) -> Any:
    """When the link is back, what is known is judged as it is."""
    return lambda self, now_us: False


def grace_runs(of: Any) -> Any:
    """The time in which nothing was judged counts as if something had been."""
    return lambda self, us: None


def flies_on(of: Any) -> Any:
    """A hold that failed is recorded, and nothing follows."""

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


# --------------------------------------------------------------------------------------- what must always come


def lasting_links(of: Any) -> Any:
    """A link's time is never over."""

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
    # a circle in a part is one in the whole
    parts = (Search(with_events(event)).run(most) for most in (150, 400, 3_000))
    assert any(endless(found) for found in parts)
