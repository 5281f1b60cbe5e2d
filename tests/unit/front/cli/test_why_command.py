"""`rtshcua why`: for a given state and from a log, as text and JSON, and wrong input."""

import json
from pathlib import Path

import pytest

from reference.flat_case import BATTERY, POSITION_X, S
from reference.forgery import flight
from reference.world import FakeVehicle, Run
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.onboard.ports import CommandFailed, Interrupted

CHECKOUT = Path(__file__).resolve().parents[4]
STANDARD = str(CHECKOUT / "missions" / "standard.rts")
AT = ("--at", "2026-05-01T10:00:00Z")


def why(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = app.main(["why", *words])
    out, err = capsys.readouterr()
    return code, out, err


def shown(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, object]:
    code, out, err = why(capsys, *words, "--json")
    assert (code, err) == (ExitCode.OK, "")
    found: dict[str, object] = json.loads(out)
    return found


def test_steps_of_the_standard_mission_are_admitted(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for step in range(6):
        found = shown(capsys, STANDARD, "--step", str(step + 1), *AT)
        assert (found["outcome"], found["reason"]) == ("allow", "admitted"), step


@pytest.mark.parametrize(
    ("settings", "reason", "clause", "would_pass"),
    [
        (["battery=32 %"], "state/violated", "battery > 35 %", ["35.01 %"]),
        (["battery=20%"], "state/violated", "battery > 35 %", ["35.01 %"]),
        (["gps.fix=unknown"], "state/unknown", "gps.fix >= fix_3d", []),
        (["gps.fix=fix_2d"], "state/unknown", "gps.fix >= fix_3d", []),  # `unknown at`, as in a test
        (["position=47.39729 N, 8.54771 E"], "safety/airspace", "airspace inside city outside school", []),
    ],
)
def test_a_state_by_hand(
    settings: list[str], reason: str, clause: str, would_pass: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for setting in settings for word in ("--state", setting)]
    found = shown(capsys, STANDARD, "--step", "3", *AT, *options)
    assert (found["reason"], found["clause"]) == (reason, clause)
    assert [each["words"] for each in found["would_pass"]] == would_pass


def test_explanation_shows_stages_clause_and_nearest_values(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = why(capsys, STANDARD, "--step", "3", *AT, "--state", "battery=32 %")
    assert code == ExitCode.OK
    assert "fallback, state/violated" in out
    assert "> require   false: `battery > 35 %`   with battery = 32 %" in out
    assert "would pass    battery = 35.01 %" in out
    assert "7  safety         not reached" in out
    assert "may fly       hover for 10 s" in out


def test_late(capsys: pytest.CaptureFixture[str]) -> None:
    found = shown(capsys, STANDARD, "--step", "3", *AT, "--waited", "4990")
    assert (found["outcome"], found["reason"]) == ("fallback", "timing/no-slack")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([STANDARD], "`--step` is missing"),
        ([STANDARD, "--step", "7"], "the mission has no step 7"),
        ([STANDARD, "--step", "1", "--state", "batery=3 %"], "did you mean `battery`?"),
        ([STANDARD, "--step", "1", "--state", "battery"], "has no `=`"),
        ([STANDARD, "--step", "1", "--state", "battery=3 m"], "write a ratio with one of the units `%`"),
        ([STANDARD, "--step", "1", "--state", "battery=-1 %"], "its values are from `0 %` to `100 %`"),
        ([STANDARD, "--step", "1", "--state", "battery=101 %"], "the nearest is `100 %`"),
        ([STANDARD, "--step", "1", "--state", "battery=9 %", "--state", "battery = 9 %"], "`battery` is given twice"),
        ([STANDARD, "--step", "1", "--state", "battery=much"], "is not a value of `battery`"),
        ([STANDARD, "--step", "1", "--state", "gps.fix=fix_4d"], "did you mean `fix_"),
        ([STANDARD, "--step", "1", "--state", "position=here"], "is not a value of `position`"),
        ([STANDARD, "--step", "1", "--state", "position=0.5 N, 8.5 E"], "too far from the vehicle's home"),
        ([STANDARD, "--step", "1", "--at", "noon"], "is not a UTC time"),
        ([STANDARD, "--record", "3"], "is not a log"),
    ],
)
def test_wrong_words(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = why(capsys, *words)
    assert (code, out) == (ExitCode.USAGE, "")
    assert message in err


def test_invalid_bundle_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.bundle"
    path.write_bytes(b"nothing of ours")
    code, _, err = why(capsys, str(path), "--step", "1")
    assert code in (ExitCode.INPUT, ExitCode.UNTRUSTED)
    assert "accepted: a source" in err
    assert why(capsys, str(tmp_path / "missing.bundle"), "--step", "1")[0] == ExitCode.INPUT


def test_a_source_with_an_error_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.rts"
    path.write_text("mission m under p@1 on q { }", encoding="utf-8")
    code, _, err = why(capsys, str(path), "--step", "1")
    assert code == ExitCode.DIAGNOSTICS
    assert "E0201" in err


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "log.jsonl"
    path.write_bytes(b"".join(flight()))
    return path


def test_log_shows_the_latest_or_the_requested_decision(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = shown(capsys, str(log.parent))
    assert {step["verdict"] for step in found["steps"]} == {"passes"}
    again = shown(capsys, str(log), "--record", str(found["record"]))
    assert again == found


def test_missing_record_is_refused(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = why(capsys, str(log), "--record", "9999")
    assert (code, out) == (ExitCode.INPUT, "")
    assert "run `rtshcua show` for the records" in err
    assert why(capsys, str(log), "--step", "2")[0] == ExitCode.USAGE


OVER_TIME = """
import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/goto.rts"
import "lib:skills/hover.rts"

policy calm version 1 {
  permit  takeoff by role operator through agent
  permit  goto by role operator through agent  when wind.speed < 8 m/s for the last 3 s
  forbid  goto by any when rising landed == in_air within the last 10 s
  permit  hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
}

mission up under calm@1 on surveyor {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) goto(47.39774 N, 8.54569 E, altitude = 20 m) }
  phase recovery  { return_home() }
}
"""


@pytest.mark.parametrize(
    ("settings", "outcome"),
    [
        (["wind.speed=7 m/s"], "allow"),
        (["wind.speed=9 m/s"], "deny"),
        (["wind.speed=unknown"], "deny"),
        (["wind.speed=7 m/s", "wind.speed < 8 m/s=false"], "deny"),
        (["wind.speed < 8 m/s=true", "wind.speed=9 m/s"], "allow"),
    ],
)
def test_by_hand_a_state_has_lasted_as_long_as_conditions_look_back(
    settings: list[str], outcome: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "calm.rts"
    path.write_text(OVER_TIME, encoding="utf-8")
    options = [word for setting in settings for word in ("--state", setting)]
    assert shown(capsys, str(path), "--step", "2", *options)["outcome"] == outcome


CONFIRMED = """
import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"

role supervisor, safety
policy seen version 1 {
  permit  takeoff by role operator through agent
  confirm takeoff by role supervisor within 30 s
  confirm takeoff by role supervisor and another of role safety within 30 s
  permit  hover, return_home, emergency_land by any
  contingency hover for 10 s, return_home, emergency_land
}

mission up under seen@1 on surveyor {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) }
  phase recovery  { return_home() }
}
"""


def test_decision_after_an_approval_is_explained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "seen.rts"
    path.write_text(CONFIRMED, encoding="utf-8")
    asked = (str(path), "--step", "1")
    assert shown(capsys, *asked)["reason"] == "approval/awaited"
    assert shown(capsys, *asked, "--approved")["outcome"] == "allow"
    assert shown(capsys, *asked, "--approved", "--state", "battery=9 %")["reason"] == "state/violated"
    assert shown(capsys, *asked, "--approved", "--waited", "31000")["reason"] == "timing/no-slack"
    assert "approvals     supervisor and safety, when the step was released" in why(capsys, *asked, "--approved")[1]


def late_until(ends: int) -> list[bytes]:
    """The log of a run whose take-off was late a number of times; then it flies, or its deadline passes."""
    run = Run().until_flies("takeoff")
    for _ in range(ends):
        run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "late"))
        if run.ending is not None:
            break
    run.until_over()
    return [*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]


def test_takeoff_late_beyond_its_deadline_names_the_busy_computer(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    log = tmp_path / "log.jsonl"
    log.write_bytes(b"".join(late_until(1_000)))
    cause = shown(capsys, str(log))["cause"]
    assert isinstance(cause, dict)
    assert "late: nothing was sent: this computer was too busy" in cause["what"]


def test_late_takeoff_that_flew_is_not_a_cause(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    log.write_bytes(b"".join(late_until(2)))
    assert shown(capsys, str(log))["cause"] is None


def logged(run: Run) -> bytes:
    return b"".join([*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)])


def stalled(run: Run, slot: int | None) -> bytes:
    """The log of a run that stalled for 14 s in its third step; afterwards `slot` is unknown."""
    run.until_flies("inspect_area")
    if slot is not None:
        run.vehicle.values[slot] = None
    run.clock.advance(14 * S)
    run.step()
    return logged(run.until_over())


def test_unknown_inputs_after_a_stall_are_attributed_to_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    log.write_bytes(stalled(Run(vehicle=FakeVehicle(deaf={"inspect_area"})), POSITION_X))
    found = shown(capsys, str(log))
    cause, (stall,) = found["cause"], found["stalls"]  # type: ignore[misc]
    assert cause == stall
    assert "stood-still" in stall["what"]
    assert "for 14000 ms" in stall["what"]
    assert "violated" in " ".join(each["what"] for each in found["ended"])  # type: ignore[attr-defined]
    page = why(capsys, str(log))[1]
    assert "Stalls of the computer" in page


def test_survived_stall_is_shown_but_not_the_cause(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    log.write_bytes(stalled(Run(), None))
    found = shown(capsys, str(log))
    assert found["cause"] is None
    assert len(found["stalls"]) == 1  # type: ignore[arg-type]


def test_later_end_is_not_attributed_to_a_stall(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run = Run(vehicle=FakeVehicle(deaf={"inspect_area"})).until_flies("inspect_area")
    run.clock.advance(14 * S)
    run.step()
    for _ in range(20):
        run.tick()
    run.tick(Interrupted(0))
    log = tmp_path / "log.jsonl"
    log.write_bytes(logged(run.until_over()))
    cause = shown(capsys, str(log))["cause"]
    assert isinstance(cause, dict)
    assert "interrupted" in cause["what"]


def test_deferred_then_allowed_step_shows_both_decisions(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run = Run(vehicle=FakeVehicle(silent={BATTERY}))
    run.until(lambda run: "defer" in [each.get("outcome") for each in run.records])
    run.vehicle.silent.clear()
    run.until_flies("takeoff")
    run.tick(Interrupted(0))
    log = tmp_path / "log.jsonl"
    log.write_bytes(logged(run.until_over()))
    found = shown(capsys, str(log))
    assert (found["outcome"], found["allowed"]["what"].split()[0]) == ("defer", "allow")  # type: ignore[index]
    assert found["allowed"]["seq"] > found["record"]  # type: ignore[index]
    page = why(capsys, str(log))[1]
    assert "Before that, the last decision on a step that was not `allow`" in page
    assert "Later decision that allowed the same step" in page
