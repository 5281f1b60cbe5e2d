"""Temporal monitors are checked against the recorded states of a log."""

import json
from functools import cache

from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import loaded
from reference.flat_case import CONTRACTS, MISSION, POLICY, TAKEOFF, WIND, M, S, apply, clause, const, signal
from reference.forgery import edit, expect, flight
from reference.forgery import signed as signed_by_the_simulator
from reference.world import LOG_KEY, ROOT_KEY, Run
from reference.world import loaded as in_force
from rtshcua.ground.audit.audit import audit
from rtshcua.ground.audit.decisions import MonitorHistory
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import Monitor, MonitorKind
from rtshcua.model.flat.situation import Now
from virtual.rows import rows

LETTERS = {"T": 1, "F": 2, "U": 4}
WINDS: dict[str, int | None] = {"T": 4 * M, "F": 9 * M, "U": None}
FOR, WITHIN, RISING, FALLING = MonitorKind
CALM = clause("wind.speed < 8 m/s", apply(Op.LT, signal(WIND), const(8 * M)))
SAID = clause("wind.speed < 8 m/s for the last 3 s", (Op.MONITOR, 0, 0))


@rows(
    ("kind", "wind", "said", "refused"),
    [
        (FOR, "F", "F", None),
        (FOR, "F", "U", 0),
        (FOR, "U", "T", 0),
        (FOR, "U", "F", None),
        (FOR, "T", "F", None),  # it was false at a time without a record
        (FOR, "FTTT", "FFFT", None),  # one second each; false left the window of 3 s
        (FOR, "FTTT", "FFTT", 2),
        (FOR, "UTTT", "UUTT", 2),
        (FOR, "UTTTT", "UUUTT", None),
        (WITHIN, "T", "F", 0),
        (WITHIN, "U", "F", 0),
        (WITHIN, "U", "T", None),
        (WITHIN, "TFFF", "TTUF", 2),
        (WITHIN, "TFFFF", "TTTFF", None),
        (WITHIN, "F", "T", None),
        (RISING, "F", "T", 0),
        (RISING, "F", "U", 0),
        (RISING, "U", "T", 0),
        (RISING, "U", "F", None),
        (RISING, "T", "T", None),
        (FALLING, "T", "U", 0),
        (FALLING, "U", "T", 0),
        (FALLING, "F", "T", None),
    ],
)
def test_monitor_value_is_accepted_or_found_by_hand(kind: int, wind: str, said: str, refused: int | None) -> None:
    window_us = 0 if kind in (RISING, FALLING) else 3 * S - S // 2
    observed = MonitorHistory(loaded(replace(POLICY, monitors=(Monitor(kind, window_us, CALM),))))
    found = []
    for number, (letter, claim) in enumerate(zip(wind, said, strict=True)):
        state = replace(flat.state({WIND: WINDS[letter]}), monitors=(LETTERS[claim],))
        flaw = observed.check(state, Now(number * S, flat.ISSUED + number * S, 0))
        found.append(None if flaw is None else flaw.slug)
    assert [number for number, slug in enumerate(found) if slug is not None] == ([] if refused is None else [refused])


def test_flaw_names_the_possible_values_of_the_monitor() -> None:
    observed = MonitorHistory(loaded(replace(POLICY, monitors=(Monitor(FOR, S, CALM), Monitor(WITHIN, S, CALM)))))
    flaw = observed.check(replace(flat.state({WIND: None}), monitors=(1, 2)), flat.NOW)
    assert flaw is not None
    assert "wind.speed < 8 m/s" in flaw.text
    assert (flaw.slug, flaw.found, flaw.expected) == ("decision/monitor", "true", "false or unknown")


@cache
def flown() -> tuple[bytes, ...]:
    """A closed log of a flight whose take-off waited for the wind to calm."""
    takeoff = replace(CONTRACTS[TAKEOFF], require=(SAID,), assume=(), reads=(WIND,), deadline_us=30 * S)
    policy = replace(POLICY, monitors=(Monitor(FOR, 3 * S, CALM),), contracts=(takeoff, *CONTRACTS[1:]))
    first = replace(MISSION.invocations[0], contract=takeoff)
    run = Run(in_force(policy, replace(MISSION, invocations=(first, *MISSION.invocations[1:])))).until_over()
    return (*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None))


def forged(number: int, **state: object) -> tuple[str, int]:
    lines = list(flown())
    lines[number] = edit(lines[number], state=json.loads(lines[number])["state"] | state)
    failure = audit(signed_by_the_simulator(lines, LOG_KEY), ROOT_KEY.public).report.failure
    assert failure is not None
    return failure.slug, failure.record


def decisions() -> list[int]:
    return [number for number, line in enumerate(flown()) if b'"type":"decision"' in line]


def test_log_with_monitors_passes() -> None:
    report = audit(flown(), ROOT_KEY.public).report
    assert report.failure is None
    assert report.shortfall is None
    assert "monitors" in [claim.slug for claim in report.unproven]


@rows("monitors", [[], [1, 1], [0], [3], [8], [-1]])
def test_malformed_monitor_values_are_found(monitors: list[int]) -> None:
    slug, record = forged(decisions()[0], monitors=monitors)
    assert record == decisions()[0]
    assert slug == ("record/not-canonical" if not monitors else "decision/inputs")


def test_monitor_values_without_a_monitor_are_found() -> None:
    lines = list(flight())
    number = next(number for number, line in enumerate(lines) if b'"type":"decision"' in line)
    lines[number] = edit(lines[number], state=json.loads(lines[number])["state"] | {"monitors": [1]})
    assert expect(signed_by_the_simulator(lines)) == ("decision/inputs", number)


def test_changed_monitor_value_changes_the_derived_decision() -> None:
    waits, begins = decisions()[:2]
    assert forged(waits, monitors=[1]) == ("decision/outcome", waits)
    assert forged(begins, monitors=[4]) == ("decision/outcome", begins)
    assert forged(begins, monitors=[2]) == ("decision/outcome", begins)
