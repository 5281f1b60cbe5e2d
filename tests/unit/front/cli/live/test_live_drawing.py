"""The live view for a person: lines, the screen, and the map."""

import json

import pytest

from rtshcua.app.fly.story import (
    FlightPlanView,
    Happened,
    Happening,
    LiveStep,
    Message,
    Note,
    SignalFormat,
    Snapshot,
    Summary,
)
from rtshcua.front.cli.render.live.board import Board
from rtshcua.front.cli.render.live.chart import chart
from rtshcua.front.cli.render.live.lines import as_json, plain, sentence
from rtshcua.front.cli.render.live.screen import picture
from rtshcua.onboard.runtime.view import RunStage, RuntimeView, SignalReading

PLAN = FlightPlanView(
    mission="inspect", intent="Look at it.", policy="bridge@7", vehicle="quad-07", mode="software", speed=10.0,
    phases=("departure", "inspection"),
    steps=(LiveStep("takeoff(altitude = 20 m)", 0), LiveStep("inspect_area(area = bridge_a)", 1)),
    signals=(
        SignalFormat("battery", "ratio", {}), SignalFormat("gps.fix", "GPS_FIX_TYPE", {3: "fix_3d"}),
        SignalFormat("position", "position", {}), SignalFormat("height", "altitude", {}),
    ),
    position="position", path=((40_000, 20_000),),
)  # fmt: skip
SIGNALS = (
    SignalReading("battery", (8_050,), 300_000, False), SignalReading("gps.fix", (3,), 5_000_000, True),
    SignalReading("position", (10_000, -4_000), 100_000, False), SignalReading("height", (None,), 0, False),
)  # fmt: skip


def view(left_us: int | None, stage: RunStage = RunStage.RUNNING) -> RuntimeView:
    return RuntimeView(1, stage, "inspection", 1, 2, "inspect_area", left_us, True, True, True, SIGNALS, (), None)


DENIED = Happening("decision", 9_000_000, 1, "inspect_area(area = bridge_a)", "fallback", "safety/degraded",
                   "battery < 25 %", "return_home()")  # fmt: skip
SUMMARY = Summary(
    "inspect", "bridge@7", "quad-07", "px4", "software", "aborted", 6, 2, 1, {"allow": 1, "deny": 0, "fallback": 1},
    192_000_000, 40, True, "runs/x", "runs/x/log.jsonl", "rtshcua verify-log runs/x/log.jsonl",
)  # fmt: skip


def drawn(*messages: Message) -> str:
    board = Board()
    for message in messages:
        board.take(message)
    return "\n".join(each.plain for each in picture(board, 120, 40))


def test_a_refusal_says_why_and_what_flies_instead() -> None:
    assert sentence(DENIED) == (
        "fallback     inspect_area(area = bridge_a)  because safety/degraded: `battery < 25 %`; instead return_home()"
    )


def test_external_text_cannot_control_the_terminal() -> None:
    nasty = "\x1b[2J\x07\r\nroot"
    assert (
        sentence(Happening("failed", 1, 0, "takeoff()", detail=nasty))
        == "failed       takeoff()  <U+001B>[2J<U+0007><U+000D><U+000A>root"
    )
    assert "\x1b" not in drawn(PLAN, Note(nasty), Happened(Happening("failed", 1, 0, nasty, detail=nasty)))


def test_repeated_step_is_shown_as_repeated() -> None:
    told = sentence(Happening("refused", 1, 0, "takeoff()", detail="permit/unsent"))
    assert told == "refused      takeoff()  nothing was sent: the step is tried again until its deadline"
    assert sentence(Happening("refused", 1, 0, "takeoff()", detail="permit/sent")).endswith("permit/sent")


def test_plain_lines() -> None:
    said = [line for message in (PLAN, Happened(DENIED), Note("busy"), SUMMARY) for line in plain(message)]
    assert said[0] == "mission inspect under bridge@7 on quad-07, mode software"
    assert said[1].startswith("     9.00 s  fallback     inspect_area")
    assert said[2] == "             busy"
    assert said[3:] == [
        "aborted: 1 of 2 steps done in 3 min 12 s",
        "  decided  1 allow, 1 fallback",
        "  log      runs/x/log.jsonl (40 records, whole)",
        "  next     rtshcua verify-log runs/x/log.jsonl",
    ]


def test_json_lines() -> None:
    said = [
        json.loads(line)
        for message in (PLAN, Snapshot(view(1)), Happened(DENIED), SUMMARY)
        for line in as_json(message)
    ]
    assert [each["event"] for each in said] == ["plan", "decision", "summary"]
    assert said[1]["reason"] == "safety/degraded"
    assert said[2]["exit_code"] == 6


def test_the_screen_shows_steps_state_and_countdown() -> None:
    text = drawn(
        PLAN, Happened(Happening("succeeded", 1, 0, "takeoff(altitude = 20 m)")), Snapshot(view(40_000_000)),
        Happened(Happening("dispatched", 2, 1, "inspect_area(area = bridge_a)")), Snapshot(view(10_000_000)),
    )  # fmt: skip
    assert "✓  1 takeoff(altitude = 20 m)" in text
    assert "▶  2 inspect_area(area = bridge_a)" in text
    assert "80.5 %" in text
    assert "fix_3d" in text
    assert "fix_3d, 5.0 s old" in text
    assert "10.0 m E, 4.0 m S" in text
    assert "no value" in text
    assert "contract inspect_area  may go on for 10.0 s" in text
    assert "running, mode software, 10x speed" in text
    assert "X" in text


def test_the_screen_counts_down_to_a_dispatch() -> None:
    assert "to be dispatched within 1.5 s" in drawn(PLAN, Snapshot(view(1_500_000, RunStage.DECIDING)))


def test_a_refused_step_is_marked_and_a_fallback_is_not_a_step() -> None:
    board = Board()
    board.take(PLAN)
    board.take(Happened(DENIED))
    board.take(Happened(Happening("decision", 1, 1, "fallback: return_home()", "allow", "admitted")))
    assert board.steps == {1: "refused"}


def test_before_anything_is_known_the_screen_says_so() -> None:
    assert "starting" in drawn()


@pytest.mark.parametrize("here", [(0, 0), (40_000, 20_000), (-900_000, 5_000)])
def test_the_map_has_its_size_and_shows_the_vehicle(here: tuple[int, int]) -> None:
    lines = chart([(0, 0), here], [(40_000, 20_000)], here, 30, 8).lines()
    assert [len(line) for line in lines] == [30] * 8
    assert sum(line.count("X") for line in lines) == 1


def test_the_map_has_north_up_and_east_right() -> None:
    lines = chart([], [(100_000, 0)], (0, 100_000), 20, 10).lines()

    def at(letter: str) -> tuple[int, int]:
        return next((row, line.index(letter)) for row, line in enumerate(lines) if letter in line)

    assert at("X")[0] < at("H")[0]
    assert at("o")[1] > at("H")[1]
