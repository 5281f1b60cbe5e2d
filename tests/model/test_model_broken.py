"""The search notices when the runtime is broken: each change here makes it fail, and says how."""

from collections.abc import Callable
from dataclasses import replace as with_fields
from typing import Any

import pytest
from msgspec.structs import replace

from model.graph import longest
from model.searching import Broken, Search
from model.small import LINK, TINY, VEHICLE, Small
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.commands import Commands
from rtshcua.onboard.ports import Dispatch
from rtshcua.onboard.runtime.conduct import Conduct
from rtshcua.onboard.runtime.dispatcher import Dispatcher
from rtshcua.onboard.runtime.fallback import Fallback, Progress
from rtshcua.onboard.runtime.supervisor import Supervisor


def with_events(*events: str) -> Small:
    """The tiny run in good weather, where the vehicle does what it likes and besides these happen."""
    return with_fields(TINY, profiles=("good",), events=(*VEHICLE, *events))


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

    def command(self: Any, kind: int, step: int, link: int, token: int) -> Any:
        made = of(self, kind, step, link, token)
        return made if kind == 0 else replace(made, kind=MotionKind.LAND)

    return command


def past_the_executor(of: Any) -> Any:
    """What is sent is not what the executor gave out."""

    def send(self: Any, now: Any, dispatch: Any, *more: Any) -> bool:
        return bool(of(self, now, replace(dispatch) if isinstance(dispatch, Dispatch) else dispatch, *more))

    return send


def ended_in_the_air(of: Any) -> Any:
    """Whoever interrupts it ends it, wherever the vehicle is."""
    return lambda self, now, cause: self.end(now, cause)


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
    "ended in the air": (Conduct, "break_off", ended_in_the_air, "it ended", "interrupted"),
    "a landing ends nothing": (Conduct, "down", nothing_ends, "it ended in the air", "interrupted"),
    "without release": (Dispatcher, "release", without_release, "it ended", "taken over"),
}


@pytest.mark.parametrize("name", NEVER)
def test_what_must_never_be_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, method, broken, words, event = NEVER[name]
    monkeypatch.setattr(owner, method, broken(getattr(owner, method)))
    with pytest.raises(Broken, match=words):
        Search(with_events(event)).run()


# --------------------------------------------------------------------------------------- what must always come


def lasting_links(of: Any) -> Any:
    """A link's time is never over."""

    def turn(self: Any, now: Any, state: Any) -> Progress:
        return Progress.ON_ITS_WAY if self._dispatcher.active is not None else of(self, now, state)

    return turn


ENDLESS: dict[str, tuple[type, str, Callable[[Any], Any], str]] = {
    "steps last": (Supervisor, "violated", lambda of: lambda self, state, now: None, "interrupted"),
    "links last": (Fallback, "turn", lasting_links, "interrupted"),
    "nothing is insisted on": (
        Fallback, "_insist", lambda of: lambda self, now, state: Progress.ON_ITS_WAY, "interrupted"),
    "silence is waited out": (Conduct, "stand_down", lambda of: lambda self, now, ending: None, LINK[0]),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDLESS)
def test_a_path_without_an_end_is_seen(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, method, broken, event = ENDLESS[name]
    monkeypatch.setattr(owner, method, broken(getattr(owner, method)))
    parts = (Search(with_events(event)).run(most) for most in (400, 3_000))  # a circle in a part is one in the whole
    assert any(longest(found.edges)[1] for found in parts)
