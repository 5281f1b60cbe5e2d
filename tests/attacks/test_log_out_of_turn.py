"""Logs of a holder of the log key whose flight violated the rules of executor and boundary: each record is
well-formed, but the order is wrong or records are missing.
"""

from functools import cache

import pytest
from msgspec.structs import replace

from reference.documents import hand, replacement
from reference.flat_case import MISSION, S
from reference.forgery import edit, expect, read, signed
from reference.world import LOG_KEY, ROOT_KEY, Run, loaded
from virtual.rows import rows

STEP, FALLBACK, CONTINGENCY = 0, 1, 2


@cache
def flight() -> tuple[bytes, ...]:
    """The whole mission without a fault."""
    run = Run(loaded()).until_over()
    return (*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None))


def number(event: str, step: int) -> int:
    return next(
        at for at, line in enumerate(flight()) if read(line).get("event") == event and read(line).get("step") == step
    )


def sent_after(at: int, *links: tuple[int, int, int, str]) -> list[bytes]:
    """The flight with these commands sent after record `at`."""
    moment = {key: read(flight()[at])[key] for key in ("at_us", "utc_us")}
    example = flight()[number("dispatched", 1)]
    more = [
        edit(example, kind=kind, step=step, link=link, detail=skill, token=900 + each, **moment)
        for each, (kind, step, link, skill) in enumerate(links)
    ]
    return [*flight()[: at + 1], *more, *flight()[at + 1 :]]


def found(lines: list[bytes]) -> tuple[str, int]:
    return expect(signed(lines, LOG_KEY), ROOT_KEY.public)


@pytest.mark.parametrize("left_out", [(0,), (1,), (0, 1), (2,)])
def test_step_without_decision_is_detected(left_out: tuple[int, ...]) -> None:
    lines = [line for line in flight() if read(line).get("step") not in left_out]
    later = next(at for at, line in enumerate(lines) if read(line).get("step", -1) > max(left_out))
    assert found(lines) == ("decision/not-current", later)


def test_step_sent_during_another_is_detected() -> None:
    lines = [line for at, line in enumerate(flight()) if at != number("succeeded", 0)]
    assert found(lines) == ("dispatch/out-of-turn", number("dispatched", 1) - 1)
    ended = edit(flight()[number("succeeded", 0)], event="replaced")
    lines = [ended if at == number("succeeded", 0) else line for at, line in enumerate(flight())]
    assert found(lines) == ("dispatch/out-of-turn", number("dispatched", 1))


@pytest.mark.parametrize("link", [(CONTINGENCY, -1, 2, "emergency_land"), (FALLBACK, 1, 1, "return_home")])
def test_mission_continued_after_return_is_detected(link: tuple[int, int, int, str]) -> None:
    slug, record = found(sent_after(number("succeeded", 1), link))
    assert (slug, record) == ("dispatch/mission-over", number("dispatched", 2) + 1)


@pytest.mark.parametrize(
    "links",
    [
        ((CONTINGENCY, -1, 2, "emergency_land"), (CONTINGENCY, -1, 0, "hover")),
        ((CONTINGENCY, -1, 2, "emergency_land"), (FALLBACK, 1, 0, "hover")),
        ((FALLBACK, 1, 1, "return_home"), (FALLBACK, 1, 0, "hover")),
        ((FALLBACK, 1, 0, "hover"), (FALLBACK, 1, 0, "hover")),
    ],
)
def test_chain_flown_backwards_is_detected(links: tuple[tuple[int, int, int, str], ...]) -> None:
    at = number("succeeded", 1)
    assert found(sent_after(at, *links)) == ("dispatch/backwards", at + 2)


def test_chain_of_ended_step_is_detected() -> None:
    at = number("succeeded", 1)
    assert found(sent_after(at, (FALLBACK, 0, 0, "emergency_land"))) == ("dispatch/lapsed", at + 1)


@rows(
    "link",
    [
        (CONTINGENCY, -1, 77, "hover"),
        (CONTINGENCY, -1, -5, "hover"),
        (CONTINGENCY, 1, 0, "hover"),
        (CONTINGENCY, -1, 0, "goto"),
        (FALLBACK, 1, 77, "hover"),
        (FALLBACK, 1, 0, "goto"),
        (FALLBACK, 1, -5, "hover"),
    ],
)
def test_step_or_link_not_in_bundle_is_refused(link: tuple[int, int, int, str]) -> None:
    at = number("succeeded", 1)
    assert found(sent_after(at, link)) == ("dispatch/other-skill", at + 1)


def test_step_under_another_name_is_detected() -> None:
    at = number("dispatched", 1)
    lines = [edit(line, detail="hover") if each == at else line for each, line in enumerate(flight())]
    assert found(lines) == ("dispatch/other-skill", at)


# ---------------------------------------------------------------- live missions


@cache
def live() -> tuple[bytes, ...]:
    """A leg supersedes another one in mid-flight."""
    go = loaded().bundle.mission.invocations[1]
    base = replace(MISSION, invocations=MISSION.invocations[:2])
    run = Run(loaded(mission=base), idle_us=S).until_flies("goto")
    mission = replace(base, issued_at_us=base.issued_at_us + 1, invocations=(*base.invocations, replace(go, step=2)))
    assert hand(run, replacement(run.loaded, 2, mission)) == "accepted"
    run.until_over()
    assert run.events.count("superseded") == 1
    return (*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None))


def live_number(event: str, step: int) -> int:
    return next(
        at for at, each in enumerate(map(read, live())) if (each.get("event"), each.get("step")) == (event, step)
    )


def test_step_that_supersedes_without_the_end_of_the_other_is_detected() -> None:
    at = live_number("superseded", 1)
    without = [line for number, line in enumerate(live()) if number != at]
    assert found(without) == ("dispatch/out-of-turn", live_number("dispatched", 2) - 1)
    replaced = edit(live()[at], event="replaced")
    assert found([replaced if number == at else line for number, line in enumerate(live())]) == (
        "dispatch/out-of-turn", live_number("dispatched", 2)
    )  # fmt: skip


def test_superseding_step_without_its_decision_is_detected() -> None:
    lines = [line for line in live() if (read(line).get("type"), read(line).get("step")) != ("decision", 2)]
    assert found(lines) == ("dispatch/not-permitted", live_number("dispatched", 2) - 1)


def test_chain_of_a_superseded_step_is_detected() -> None:
    at = live_number("dispatched", 2)
    moment = {key: read(live()[at])[key] for key in ("at_us", "utc_us")}
    link = edit(live()[at], kind=FALLBACK, step=1, link=0, detail="hover", token=900, **moment)
    assert found([*live()[: at + 1], link, *live()[at + 1 :]]) == ("dispatch/lapsed", at + 1)
