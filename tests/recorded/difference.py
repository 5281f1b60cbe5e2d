"""Differences between a simulated and a recorded session.

Answers are compared request by request; modes, landed states and texts by their times; height and place second by
second. A difference has a key, by which an accepted one is named, and a text with both sides.
"""

import re
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import dist
from typing import Any

from recorded.trace import CLIENT, SECOND, Heard, Question
from rtshcua.simulation.place import HomePosition

ANSWERED = ("AUTOPILOT_VERSION", "HOME_POSITION")
REQUESTS = ("MISSION_REQUEST", "MISSION_REQUEST_INT")


@dataclass(frozen=True)
class Difference:
    """A difference: its `key`, and the `recorded` and `simulated` facts."""

    key: str
    recorded: object
    simulated: object

    def __str__(self) -> str:
        return f"{self.key}: recorded {self.recorded}, simulated {self.simulated}"


def answers(questions: list[Question], recorded: list[Heard], simulated: list[Heard]) -> Iterator[Difference]:
    """Compare the answers to each request: acknowledgements, requested messages, parameters, uploads."""
    ends = [question.at_us for question in questions[1:]] + [questions[-1].at_us + 3 * SECOND]
    for question, end_us in zip(questions, ends, strict=True):
        real, own = (_answer(question, _between(heard, question.at_us, end_us)) for heard in (recorded, simulated))
        for what in real:
            if real[what] != own[what]:
                yield Difference(f"{question.key}, {what}", real[what], own[what])


def _answer(question: Question, heard: list[Heard]) -> dict[str, object]:
    m = question.heard.message
    seen: dict[str, object] = {}
    if hasattr(m, "command"):
        seen["acks"] = [h.message.result for h in heard if h.name == "COMMAND_ACK" and h.message.command == m.command]
        if m.command == 512:
            seen["message"] = sorted({h.name for h in heard} & set(ANSWERED) & _asked(int(m.param1)))
    if hasattr(m, "param_id"):
        values = [h.message.param_value for h in heard if h.name == "PARAM_VALUE" and h.message.param_id == m.param_id]
        seen["value"] = values[:1]
    if question.items:
        seen["asked with"] = [(h.name, h.message.seq) for h in heard if h.name in REQUESTS]
        seen["MISSION_ACK"] = [h.message.type for h in heard if h.name == "MISSION_ACK"]
    return seen


def _asked(number: int) -> set[str]:
    return {148: {"AUTOPILOT_VERSION"}, 242: {"HOME_POSITION"}}.get(number, set())


def _between(heard: list[Heard], start_us: int, end_us: int) -> list[Heard]:
    return heard[bisect_left(heard, start_us, key=_at) : bisect_left(heard, end_us, key=_at)]


def _at(heard: Heard) -> int:
    return heard.at_us


# ------------------------------------------------------------------------------------------------- states


def changes(
    what: str, read: Callable[[Heard], object], recorded: list[Heard], simulated: list[Heard], limit_us: int
) -> Iterator[Difference]:
    """Compare changes of the value that `read` returns (None: no value): those on one side only, or more than
    `limit_us` apart.

    The sides are aligned change by change; after a difference the comparison continues when both have the same value.
    """
    during = _between(simulated, recorded[0].at_us, recorded[-1].at_us)
    real, own = _changes(read, recorded), _changes(read, during)
    i = j = 0
    while i < len(real) or j < len(own):
        if i < len(real) and j < len(own) and real[i][1] == own[j][1] and abs(real[i][0] - own[j][0]) <= limit_us:
            i, j = i + 1, j + 1
        elif j >= len(own) or (i < len(real) and real[i][0] <= own[j][0]):
            yield Difference(f"{what} {real[i][1]}, {_nth(real, i)}", _moment(real[i][0]), "never then")
            i += 1
        else:
            yield Difference(f"{what} {own[j][1]}, {_nth(own, j)} here", "never then", _moment(own[j][0]))
            j += 1


def _changes(read: Callable[[Heard], object], heard: list[Heard]) -> list[tuple[int, object]]:
    found: list[tuple[int, object]] = []
    for h in heard:
        value = read(h)
        if value is not None and (not found or found[-1][1] != value):
            found.append((h.at_us, value))
    return found


def _nth(seen: list[tuple[int, object]], index: int) -> str:
    nth = sum(value == seen[index][1] for _, value in seen[: index + 1])
    return f"time {nth}"


def _moment(at_us: int) -> str:
    return f"at {at_us / SECOND:.1f} s"


def texts(recorded: list[Heard], simulated: list[Heard], limit_us: int) -> Iterator[Difference]:
    """Compare texts: those on one side only, or more than `limit_us` apart."""
    left = [h for h in _between(simulated, recorded[0].at_us, recorded[-1].at_us) if h.name == "STATUSTEXT"]
    count: dict[str, int] = {}
    for h in recorded:
        if h.name != "STATUSTEXT":
            continue
        text = _text(h)
        count[text] = count.get(text, 0) + 1
        same = [own for own in left if _text(own) == text and abs(own.at_us - h.at_us) <= limit_us]
        if same:
            left.remove(min(same, key=lambda own: abs(own.at_us - h.at_us)))
        else:
            yield Difference(f"text {text!r}, time {count[text]}", _moment(h.at_us), "never then")
    count.clear()
    for own in left:
        text = _text(own)
        count[text] = count.get(text, 0) + 1
        yield Difference(f"text {text!r}, time {count[text]} here", "never then", _moment(own.at_us))


def _text(heard: Heard) -> str:
    """Return severity and text without numbers, which vary."""
    return f"{heard.message.severity} {re.sub(r'[0-9]+([.][0-9]+)?', '#', heard.message.text)}"


# ------------------------------------------------------------------------------------------------- motion


def motion(
    home: HomePosition, recorded: list[Heard], simulated: list[Heard], up_m: float, away_m: float
) -> Iterator[Difference]:
    """Find intervals in which height or place differ by more than the limits, at received positions."""
    own = [h for h in simulated if h.name == "GLOBAL_POSITION_INT" and h.message.lat]
    real = [h for h in recorded if h.name == "GLOBAL_POSITION_INT" and h.message.lat]
    if not own:
        yield Difference("position", "some", "none")
        return
    yield from _stretches("height", up_m, real, own, lambda m: (m.relative_alt / 1000,))
    yield from _stretches("place", away_m, real, own, lambda m: home.local(m.lat, m.lon))


def targets(
    home: HomePosition, recorded: list[Heard], simulated: list[Heard], up_m: float, away_m: float, late_us: int
) -> Iterator[Difference]:
    """Compare reported targets, and find intervals in which one side reports none for `late_us`."""
    during = _between(simulated, recorded[0].at_us, recorded[-1].at_us)
    real, own = ([h for h in side if h.name == "POSITION_TARGET_GLOBAL_INT"] for side in (recorded, during))
    for side, others, whose in ((real, own, "recorded"), (own, real, "simulated")):
        alone = [h.at_us for h in side if not _between(others, h.at_us - late_us, h.at_us + late_us)]
        if alone:
            yield Difference(f"targets only {whose}", _moment(alone[0]), f"{len(alone)} of them, until {alone[-1]}")
    near = [h for h in real if _between(own, h.at_us - late_us, h.at_us + late_us)]
    yield from _stretches("target height", up_m, near, own, lambda m: (m.alt,), late_us)
    yield from _stretches("target place", away_m, near, own, lambda m: home.local(m.lat_int, m.lon_int), late_us)


def acknowledgements(recorded: list[Heard], simulated: list[Heard]) -> Iterator[Difference]:
    """Compare the results of each command of the client, in order."""
    real, own = _results(recorded), _results(simulated)
    for command in sorted({*real, *own}):
        if real.get(command) != own.get(command):
            yield Difference(f"command {command}", real.get(command), own.get(command))


def _results(heard: list[Heard]) -> dict[int, list[int]]:
    results: dict[int, list[int]] = {}
    for h in heard:
        if h.name == "COMMAND_ACK" and h.message.target_component in (0, CLIENT):
            results.setdefault(h.message.command, []).append(h.message.result)
    return results


def rates(names: Iterable[str], recorded: list[Heard], simulated: list[Heard], part: float) -> Iterator[Difference]:
    """Compare the numbers of messages of these names: by more than a share, and by more than two."""
    during = _between(simulated, recorded[0].at_us, recorded[-1].at_us)
    for name in names:
        real, own = (sum(h.name == name for h in side) for side in (recorded, during))
        if abs(real - own) > max(2, part * real):
            yield Difference(f"rate of {name}", real, own)


def _stretches(
    axis: str,
    limit: float,
    recorded: list[Heard],
    own: list[Heard],
    read: Callable[[Any], tuple[float, ...]],
    late_us: int = 0,
) -> Iterator[Difference]:
    """Find where the sides differ by more than `limit`, also within `late_us`."""
    worst: tuple[float, Heard, Any] | None = None
    start_us = 0
    times, places = [h.at_us for h in own], [read(h.message) for h in own]
    for h in recorded:
        at = min(bisect_left(times, h.at_us), len(own) - 1)
        real, mine = read(h.message), places[at]
        off = _off(real, mine)
        if late_us and (off > limit or times[at] >= h.at_us + late_us):
            near = places[bisect_left(times, h.at_us - late_us) : bisect_left(times, h.at_us + late_us)]
            off, mine = min((_off(real, other), other) for other in near)
        if off > limit:
            start_us = start_us if worst else h.at_us
            worst = max(worst or (0.0, h, mine), (off, h, mine), key=lambda w: w[0])
        elif worst is not None:
            yield _stretch(axis, start_us, h.at_us, worst, read)
            worst = None
    if worst is not None:
        yield _stretch(axis, start_us, recorded[-1].at_us, worst, read)


def _off(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return dist(a, b)


def _stretch(axis: str, start_us: int, end_us: int, worst: Any, read: Callable[[Any], Any]) -> Difference:
    off, heard, mine = worst
    rounded = [tuple(round(v, 1) for v in place) for place in (read(heard.message), mine)]
    return Difference(
        f"{axis} from {start_us // SECOND} s",
        f"{rounded[0]} {_moment(heard.at_us)}",
        f"{rounded[1]}: off by {off:.1f} m at most, until {end_us // SECOND} s",
    )
