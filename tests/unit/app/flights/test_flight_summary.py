"""The six lines of a report in cases that a clean flight does not have, and the tables of events that it uses."""

import ast
from base64 import b64encode
from pathlib import Path

import pytest

from reference import documents
from reference.forgery import edit
from rtshcua.app.flights.flight_summary import CAUSES
from rtshcua.app.flights.flight_timeline import IN_LANE
from rtshcua.app.logged_decision import _FOLLOWS, _TURNS
from virtual.flight_reports import MADE_US, told

CHECKOUT = Path(__file__).resolve().parents[4]
#: effects that are no event of a flight: notes, records of the log's own, and what only ends another event
QUIET = {
    "anchored", "attested", "boundary", "clock", "dispatched", "noted", "permitted", "not-permitted", "preparation",
    "prepared", "not-prepared", "ready", "released", "repeated", "replaced", "replan", "said", "simulated", "succeeded",
    "superseded", "idle", "idle-over",
}  # fmt: skip


@pytest.fixture(scope="module")
def lines(completed: Path) -> list[bytes]:
    return (completed / "log.jsonl").read_bytes().splitlines(keepends=True)


def effect(lines: list[bytes], event: str, step: int, detail: str, **more: object) -> bytes:
    """An effect in the form of the log's others."""
    first = next(line for line in lines if b'"type":"effect"' in line)
    return edit(first, event=event, step=step, detail=detail, **more)


def allowed(lines: list[bytes], at: Path) -> str:
    return told(lines, at).summary[1].answer


def deferred(lines: list[bytes], step: int) -> bytes:
    decision = next(line for line in lines if b'"type":"decision"' in line)
    return edit(decision, step=step, outcome="defer", reason="approval/awaited", target_link=-1)


def test_nobody_was_asked(lines: list[bytes], tmp_path: Path) -> None:
    assert allowed(lines, tmp_path).endswith("No person was asked to approve a step.")


def test_answers_are_told_apart(lines: list[bytes], tmp_path: Path) -> None:
    of = documents.low()
    yes, no = (b64encode(documents.approval(of, granted=granted)).decode() for granted in (1, 0))
    answered = [*lines[:-1], deferred(lines, 1), effect(lines, "approval", 1, yes, seq=900), deferred(lines, 2),
                effect(lines, "approval", 2, no, seq=901), deferred(lines, 0)]  # fmt: skip
    text = allowed(answered, tmp_path)
    assert "Granted by signature: step 2: granted as supervisor" in text
    assert "Refused by signature: step 3: refused as supervisor" in text
    assert "A person was asked to approve step 1, and nobody answered." in text
    assert "No person was asked" not in text


def test_malformed_answer_is_neither(lines: list[bytes], tmp_path: Path) -> None:
    text = allowed([*lines[:-1], effect(lines, "approval", 1, "AAAA")], tmp_path)
    assert "Granted" not in text
    assert "Refused" not in text


def test_mode_none_enforces_nothing(lines: list[bytes], tmp_path: Path) -> None:
    text = allowed([edit(lines[0], mode="none"), *lines[1:]], tmp_path)
    assert text.startswith("Nobody had to: in mode `none` nothing is enforced.")


def test_flight_without_a_command_flew_nothing(lines: list[bytes], tmp_path: Path) -> None:
    first = next(number for number, line in enumerate(lines) if b'"event":"dispatched"' in line)
    report = told(lines[:first], tmp_path)
    assert report.summary[2].answer.startswith("Nothing: no command was sent to the vehicle")
    assert [each.lane for each in report.timeline].count("dispatched") == 0


def test_log_that_stopped_growing_says_so(lines: list[bytes], tmp_path: Path) -> None:
    ended = told(lines[:12], tmp_path).summary[3].answer
    assert "whatever records the flight has stopped" in ended
    now = edit(lines[11], utc_us=MADE_US - 5_000_000)
    assert "stopped" not in told([*lines[:11], now], tmp_path).summary[3].answer


def test_log_that_breaks_off_at_a_flaw_says_where(lines: list[bytes], tmp_path: Path) -> None:
    ended = told([*lines[:12], b"{}\n", *lines[13:]], tmp_path).summary[3].answer
    assert "Then the log breaks off: record 12 " in ended


@pytest.mark.parametrize("event", ["landed", "released", "time-over", "violated", "failed", "replaced"])
def test_whatever_has_the_token_of_a_command_ends_it(lines: list[bytes], tmp_path: Path, event: str) -> None:
    at = max(number for number, line in enumerate(lines) if b'"event":"succeeded"' in line)
    changed = [*lines[:at], edit(lines[at], event=event), *lines[at + 1 :]]
    bar = [each for each in told(changed, tmp_path).timeline if each.lane == "dispatched"][-1]
    assert bar.told.endswith(f": {event}")


def test_repetitions_count_for_the_decision_that_they_repeat(lines: list[bytes], tmp_path: Path) -> None:
    at = next(number for number, line in enumerate(lines) if b'"type":"decision"' in line)
    waits = [deferred(lines, 0), effect(lines, "repeated", 0, "41", kind=0, link=-1)]
    other = [deferred(lines, 0), effect(lines, "repeated", 1, "41", kind=0, link=-1)]
    assert told([*lines[:at], *waits], tmp_path).decisions[0].repeats == 42
    assert told([*lines[:at], *other], tmp_path).decisions[0].repeats == 1


def test_each_cause_has_words_and_each_event_a_lane() -> None:
    assert CAUSES.keys() >= _TURNS - _FOLLOWS
    assert IN_LANE.keys() >= _TURNS
    assert not IN_LANE.keys() & QUIET


def test_events_of_the_runtime_are_in_a_lane_or_quiet() -> None:
    found = set()
    for path in (CHECKOUT / "rtshcua" / "onboard" / "runtime").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Attribute)
                and node.func.attr in ("effect", "end")
            ):
                found |= {each.value for each in node.args[1:2] if isinstance(each, ast.Constant)}
    assert len(found) > 10
    assert {each for each in found if isinstance(each, str)} <= IN_LANE.keys() | QUIET
