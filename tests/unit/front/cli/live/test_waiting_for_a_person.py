"""A step that waits for a person is shown with the role, the time left and the command; so is a recall. The view fits a
small terminal, and has a map.
"""

import io
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from itertools import chain

import msgspec
import pytest
from rich.console import Console

from reference.documents import ASKED, approval, low, recall
from reference.flat_case import POLICY, S
from reference.world import START, Run
from rtshcua.app.fly.narrator import Answering, Teller, plan_of
from rtshcua.app.fly.story import (
    Area,
    Asks,
    FlightPlanView,
    Happened,
    Happening,
    LiveStep,
    Message,
    Note,
    SignalFormat,
    Snapshot,
    Summary,
    tenths,
)
from rtshcua.front.cli.render.live import screen
from rtshcua.front.cli.render.live.board import Board
from rtshcua.front.cli.render.live.chart import FENCE, HOMEWARD, KEEP_OUT, ZONE, chart
from rtshcua.front.cli.render.live.lines import as_json, plain, typed
from rtshcua.front.cli.render.live.screen import picture
from rtshcua.onboard.ports import Presented
from rtshcua.onboard.runtime.view import RunStage, RuntimeView, SignalReading

SOCKET = "/tmp/a socket"
COMMAND = ("rtshcua", "approve", "low.bundle", "--step", "3", "--role", "supervisor", "--to", SOCKET)
ASKS = Asks(("supervisor",), 4 * S, 34 * S, (COMMAND,))
WAITS = Happening("decision", 4 * S, 2, "inspect_area(area = bridge_a)", "defer", "approval/awaited",
                  "confirm inspect_area", asks=ASKS)  # fmt: skip
PLAN = FlightPlanView(
    mission="inspect", intent="Look at it.", policy="bridge@7", vehicle="quad-07", mode="software", speed=10.0,
    phases=("departure", "inspection", "recovery"),
    steps=tuple(LiveStep(f"goto(target = 47.3987{number} N, 8.54698 E, altitude = 9 m, speed = 6 m/s)", number // 6)
                for number in range(18)),
    signals=(SignalFormat("position", "position", {}), SignalFormat("height", "altitude", {}), SignalFormat("climb",
        "speed", {})),
    position="position", path=((40_000, 20_000), (90_000, 30_000)),
    areas=(
        Area("city", "inside", ((-100_000, -90_000, 170_000, -90_000, 170_000, 90_000, -100_000, 90_000),)),
        Area("school", "outside", ((-60_000, -60_000, -20_000, -60_000, -20_000, -20_000, -60_000, -20_000),)),
        Area("bridge", "", ((30_000, 10_000, 60_000, 10_000, 60_000, 40_000, 30_000, 40_000),)),
    ),
)  # fmt: skip
SIGNALS = (
    SignalReading("position", (30_000, -40), 100_000, False), SignalReading("height", (-30,), 0, False),
    SignalReading("climb", (-49,), 0, False), *(SignalReading(f"other.signal.{number}", (None,), 0,
        False) for number in range(6)),
)  # fmt: skip
SUMMARY = Summary(
    "inspect", "bridge@7", "quad-07", "px4", "software", "aborted", 6, 2, 1, {"allow": 1, "deny": 0, "fallback": 1},
    192 * S, 40, True, "runs/x", "runs/x/log.jsonl", "rtshcua verify-log runs/x/log.jsonl",
)  # fmt: skip


def view(at_us: int = 5 * S, stage: RunStage = RunStage.DECIDING, step: int = 2) -> RuntimeView:
    return RuntimeView(at_us, stage, "departure", step, 18, "hover", 2 * S, True, True, True, SIGNALS, (), None)


def board(*messages: Message) -> Board:
    found = Board()
    for message in messages:
        found.take(message)
    return found


def shown(found: Board, width: int = 80, height: int = 24) -> list[str]:
    return [each.plain for each in picture(found, width, height)]


def waiting() -> tuple[Run, Teller, list[Happening]]:
    """A flight that waits for its supervisor, and the events shown of it."""
    run = Run(low())
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, START.monotonic_us,
                    Answering("low.bundle", SOCKET))  # fmt: skip
    told: list[Happening] = []
    while not any(each.asks for each in told):
        before = len(run.lines)
        run.tick()
        told += filter(None, map(teller.tell, run.lines[before:]))
    return run, teller, told


# ------------------------------------------------------------------------------------------ whom, how long, what


def test_flight_prints_role_time_and_command_of_a_pending_approval() -> None:
    _, _, told = waiting()
    what = next(each for each in told if each.asks is not None)
    assert what.asks is not None
    confirm = next(rule for rule in low().bundle.policy.rules if rule.text == what.clause)
    assert (what.step, what.asks.roles) == (ASKED, ("supervisor",))
    assert 0 < what.asks.until_us - what.asks.asked_us <= confirm.within_us
    assert what.asks.commands == (
        ("rtshcua", "approve", "low.bundle", "--step", str(ASKED + 1), "--role", "supervisor", "--to", SOCKET),
    )


def test_plain_view_shows_a_copyable_command() -> None:
    lines = list(plain(Happened(WAITS)))
    text = "\n".join(lines)
    assert "WAITS FOR A PERSON: supervisor" in text
    assert "step 3" in text
    assert "30 s left, then it is denied" in text
    assert all(len(each) <= 80 for each in lines[1:])
    first = next(number for number, each in enumerate(lines) if "rtshcua approve" in each)
    assert shlex.split("\n".join(lines[first:]).replace("\\\n", "")) == [*COMMAND]


def test_pending_approval_is_in_json_too() -> None:
    (told,) = map(json.loads, as_json(Happened(WAITS)))
    assert told["asks"]["roles"] == ["supervisor"]
    assert told["asks"]["commands"] == [[*COMMAND]]
    assert told["asks"]["until_us"] - told["asks"]["asked_us"] == 30 * S


def test_approval_for_a_fast_clock_is_valid_longer() -> None:
    run, _, _ = waiting()
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, 0, Answering("b", "s", ahead=True))
    asked = next(each for each in map(teller.tell, run.lines[1:]) if each is not None and each.asks)
    assert asked.asks is not None
    assert "--for 3600" in " ".join(asked.asks.commands[0])
    teller.replace(run.loaded.bundle.mission)
    again = next(each for each in map(teller.tell, run.lines[1:]) if each is not None and each.asks)
    assert again.asks is not None
    assert "--replacement FILE" in " ".join(again.asks.commands[0])


def test_missing_operator_socket_is_reported() -> None:
    run, _, _ = waiting()
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, 0)
    asked = next(each for each in map(teller.tell, run.lines[1:]) if each is not None and each.asks)
    assert asked.asks is not None
    assert asked.asks.commands == ()
    assert "this run has no `--operator-socket`" in " ".join(" ".join(plain(Happened(asked))).split())


def test_two_approvals_are_requested_until_both_are_given() -> None:
    both = Asks(
        ("chief", "safety"), 0, 60 * S, tuple((*COMMAND[:6], role, "--to", "s") for role in ("chief", "safety"))
    )
    of = Happening("decision", 0, 2, "inspect_area()", "defer", "approval/awaited", "c", asks=both)
    found = board(PLAN, Happened(of), Snapshot(view()))
    assert "PERSON: chief and safety" in "\n".join(found.banner(80))
    assert "\n".join(found.banner(80)).count("rtshcua approve") == 2
    found.take(Happened(Happening("approval", 1, 2, "inspect_area()", role="chief")))
    assert "PERSON: safety" in "\n".join(found.banner(80))
    assert "chief agreed" in "\n".join(found.banner(80))
    assert "--role chief" not in "\n".join(found.banner(80))
    found.take(Happened(Happening("decision", 2, 2, "inspect_area()", "allow", "admitted")))
    assert found.banner(80) == []


def test_answer_is_shown_with_its_role() -> None:
    run, teller, _ = waiting()
    before = len(run.lines)
    run.tick(Presented(run.clock.now().monotonic_us, approval(run.loaded), 1))
    answered = [each for each in map(teller.tell, run.lines[before:]) if each is not None and each.event == "approval"]
    assert [each.role for each in answered] == ["supervisor"]
    no = Happening("approval", 1, 2, role="")
    assert board(PLAN, Happened(WAITS), Happened(no)).banner(80) == [], "a no ends the wait"


# ------------------------------------------------------------------------------------------ the screen


def test_screen_counts_down_and_shows_the_command() -> None:
    found = board(PLAN, Happened(WAITS), Snapshot(view(5 * S)))
    text = "\n".join(shown(found))
    assert "29 s left" in text
    assert "rtshcua approve low.bundle --step 3" in text
    assert "to be dispatched within" not in text, "the step has another time than the person"
    found.take(Snapshot(view(33 * S)))
    assert "1 s left" in "\n".join(shown(found))


@pytest.mark.parametrize(
    "over",
    [
        Happened(Happening("dispatched", 6 * S, 2, "inspect_area()")), Snapshot(view(stage=RunStage.RUNNING)),
        Snapshot(view(stage=RunStage.FALLING)), Snapshot(view(step=3)),
        Happened(Happening("decision", 6 * S, 2, "inspect_area()", "deny", "approval/timed-out")),
    ],
)  # fmt: skip
def test_the_banner_goes_when_the_wait_is_over(over: Message) -> None:
    assert board(PLAN, Happened(WAITS), Snapshot(view()), over).banner(80) == []


def test_a_recall_is_a_banner_that_stays() -> None:
    run = Run(low()).until_flies("goto")
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, 0)
    before = len(run.lines)
    run.tick(Presented(run.clock.now().monotonic_us, recall(run.loaded), 1))
    told = [each for each in map(teller.tell, run.lines[before:]) if each is not None]
    assert [each.event for each in told][:1] == ["recall"]
    found = board(PLAN, *map(Happened, told), Snapshot(view(stage=RunStage.FALLING)))
    assert "RECALLED" in "\n".join(shown(found))
    assert any("** RECALLED" in line for each in told for line in plain(Happened(each)))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def rung(monkeypatch: pytest.MonkeyPatch, file: io.StringIO, *messages: Message) -> str:
    monkeypatch.setattr(screen, "Console", lambda: Console(file=file, width=80, height=24))
    screen.draw(iter(messages))
    return file.getvalue()


def test_the_bell_rings_once_for_a_wait_and_only_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    story = (PLAN, Happened(WAITS), Snapshot(view()), Snapshot(view(6 * S)), Happened(WAITS), Snapshot(view(7 * S)))
    assert rung(monkeypatch, Terminal(), *story).count("\a") == 1
    assert "\a" not in rung(monkeypatch, io.StringIO(), *story)
    assert "\a" not in rung(monkeypatch, Terminal(), PLAN, Snapshot(view()))


def test_the_plain_view_rings_once_on_a_terminal_and_never_in_a_pipe() -> None:
    told = b"".join(msgspec.json.encode(each) + b"\n" for each in (PLAN, Happened(WAITS), Happened(WAITS)))
    command = [sys.executable, "-P", "-m", "rtshcua.front.cli.render.live", "lines"]
    piped = subprocess.run(command, input=told, capture_output=True, check=True)
    assert b"WAITS FOR A PERSON" in piped.stdout
    assert b"\a" not in piped.stdout
    ours, theirs = os.openpty()
    try:
        subprocess.run(command, input=told, stdout=theirs, check=True)
        assert os.read(ours, 1 << 16).count(b"\a") == 1
    finally:
        os.close(ours)
        os.close(theirs)


def test_each_step_that_waits_rings() -> None:
    assert board(PLAN, Happened(WAITS)).rings == 1
    assert board(PLAN, Happened(WAITS), Happened(WAITS)).rings == 1, "the same wait"
    later = Happening("decision", 9 * S, 5, "goto()", "defer", "approval/awaited", "c", asks=ASKS)
    assert board(PLAN, Happened(WAITS), Happened(later)).rings == 2


# ------------------------------------------------------------------------------------------ 80 x 24


def stories() -> Iterator[tuple[Message, ...]]:
    many = tuple(
        Happened(Happening("obeyed", number * S, 1, "goto(target = 47.39876 N, 8.54698 E)", detail="it flies " * 30))
        for number in range(30)
    )
    last = Happened(Happening("gap", 99 * S, detail="the very newest"))
    yield (PLAN, Snapshot(view(stage=RunStage.RUNNING)), *many, last)
    yield (PLAN, Happened(WAITS), Snapshot(view()), *many, last)
    yield (PLAN, last)
    yield (PLAN, Snapshot(view(stage=RunStage.WAITING, step=0)), Note("x" * 500), last)
    yield (PLAN, Snapshot(view(stage=RunStage.ENDED, step=18)), *many, SUMMARY, last)


@pytest.mark.parametrize("size", [(80, 24), (80, 10), (40, 24), (120, 50), (200, 20), (30, 6)])
def test_live_view_fits_any_size_and_shows_the_newest_line(size: tuple[int, int]) -> None:
    width, height = size
    for story in stories():
        if board(*story).banner(width) and height < 10:
            continue  # a required action is shown before past events
        lines = shown(board(*story), width, height)
        assert len(lines) <= height
        assert max(map(len, lines)) <= width
        assert "the very newest" in " ".join(" ".join(lines[-2:]).split()), lines


def test_at_40_columns_the_command_is_whole() -> None:
    lines = shown(board(PLAN, Happened(WAITS), Snapshot(view())), 40, 24)
    first = next(number for number, each in enumerate(lines) if "rtshcua approve" in each)
    last = next(number for number in range(first, 24) if not lines[number].rstrip().endswith("\\"))
    typed_in = "\n".join(each.rstrip() for each in lines[first : last + 1])
    assert shlex.split(typed_in.replace("\\\n", "")) == [*COMMAND]


def test_at_80_columns_the_current_step_the_signals_and_the_map_are_there() -> None:
    found = board(PLAN, Snapshot(view(stage=RunStage.RUNNING, step=12)))
    text = "\n".join(shown(found))
    assert " 13 goto(" in text, "far down the list"
    assert "position" in text
    assert "X" in text
    assert " N\n" in text
    assert "↑" in text
    assert "├──" in text


def test_no_value_is_minus_nothing() -> None:
    text = "\n".join(shown(board(PLAN, Snapshot(view(stage=RunStage.RUNNING)))))
    assert "-0.0" not in text
    assert "30.0 m E, 0.0 m N" in text
    assert [tenths(each) for each in (-49, -50, 0, 49, 1_250, -12_340)] == ["0.0", "-0.1", "0.0", "0.0", "1.3", "-12.3"]


def test_before_anything_is_known_there_is_one_line() -> None:
    assert shown(Board()) == ["starting"]


# ------------------------------------------------------------------------------------------ the map


def kinds(found: object) -> set[str]:
    return {cell.shows for cell in chain.from_iterable(found.rows)}  # type: ignore[attr-defined]


def test_the_map_shows_zones_fence_keep_out_and_the_way_home() -> None:
    found = chart([(0, 0), (30_000, 0)], PLAN.path, (90_000, 30_000), 36, 12, PLAN.areas)
    assert {FENCE, KEEP_OUT, ZONE, HOMEWARD} <= kinds(found)
    assert not found.beyond
    without = chart([(0, 0)], PLAN.path, (90_000, 30_000), 36, 12, PLAN.areas, homeward=False)
    assert HOMEWARD not in kinds(without)


def test_only_keep_out_zones_are_hatched() -> None:
    def dots(kind: str) -> int:
        area = Area("z", kind, ((-40_000, -40_000, 40_000, -40_000, 40_000, 40_000, -40_000, 40_000),))
        found = chart([], [(-40_000, -40_000), (40_000, 40_000)], None, 30, 12, [area])
        return sum(cell.letter != " " for row in found.rows for cell in row)

    assert dots("outside") > 2 * dots("inside")


def test_a_hole_in_a_zone_is_not_hatched() -> None:
    ring = (-40_000, -40_000, 40_000, -40_000, 40_000, 40_000, -40_000, 40_000)
    hole = (-30_000, -30_000, -30_000, 30_000, 30_000, 30_000, 30_000, -30_000)
    path = [(-40_000, -40_000), (40_000, 40_000)]
    whole, holed = (chart([], path, None, 30, 12, [Area("z", "outside", each)]) for each in ((ring,), (ring, hole)))
    assert sum(c.letter != " " for r in holed.rows for c in r) < sum(c.letter != " " for r in whole.rows for c in r)


def test_a_zone_far_larger_than_the_flight_does_not_shrink_it() -> None:
    far = Area("country", "inside", ((-(9**9), -(9**9), 9**9, -(9**9), 9**9, 9**9, -(9**9), 9**9),))
    found = chart([], [(40_000, 0)], (0, 0), 36, 12, [far])
    assert found.beyond
    assert found.bar_m <= 20


def test_a_zone_that_is_cut_by_the_edge_of_the_map_is_drawn_up_to_it() -> None:
    half = Area("half", "inside", ((10_000, -(9**9), 9**9, -(9**9), 9**9, 9**9, 10_000, 9**9),))
    found = chart([], [(40_000, 0)], (0, 0), 36, 12, [half])
    assert not found.beyond
    assert all(any(cell.shows == FENCE for cell in row) for row in found.rows), "one line from top to bottom"


def test_the_scale_is_true() -> None:
    found = chart([], [(0, 0), (100_000, 0)], None, 40, 10)
    ((row, home),) = [
        (r, c) for r, cells in enumerate(found.rows) for c, cell in enumerate(cells) if cell.letter == "H"
    ]
    other = max(c for c, cell in enumerate(found.rows[row]) if cell.letter == "o")
    metres = (other - home) * found.bar_m / found.bar_columns
    assert 85 <= metres <= 115
    assert str(found.bar_m)[0] in "125"


def test_the_plan_of_a_mission_has_its_zones_and_its_fence() -> None:
    plan = plan_of(POLICY, low().bundle.mission, mode="software", speed=1.0)
    of = {area.name: area for area in plan.areas}
    for numbers, kind in ((POLICY.airspace.inside, "inside"), (POLICY.airspace.outside, "outside")):  # type: ignore[union-attr]
        for number in numbers:
            assert of[POLICY.zones[number].name].kind == kind
    assert all(len(ring) >= 6 and len(ring) % 2 == 0 for area in plan.areas for ring in area.rings)


def test_a_command_over_several_lines_is_the_same_command() -> None:
    words = ("rtshcua", "approve", "a b.bundle", *(f"--option-{number}" for number in range(12)), "it's")
    lines = typed(words, 40)
    assert len(lines) > 2
    assert all(len(each) <= 40 for each in lines)
    assert shlex.split("\n".join(lines).replace("\\\n", "")) == [*words]
