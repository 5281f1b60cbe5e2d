"""`rtshcua qualify` over real UDP, and its record in `run` and `doctor`: one sortie for all tests."""

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rtshcua import library
from rtshcua.diagnostics.exits import ExitCode

SHORT = str(library.root() / "missions/short.rts")
SPEED = 3


def notes(run: Any) -> list[str]:
    (rehearsal,) = run.events
    return list(rehearsal["notes"])


def simulated(ground: Any, port: int, return_m: int) -> Any:
    """A vehicle in a process of its own, whose owner has set the height of its return."""
    module, pace = [sys.executable, "-m", "rtshcua.simulation"], ["--port", str(port), "--speed", str(SPEED)]
    own, ground.command = ground.command, module
    vehicle = ground.start(*pace, "--flavour", "ardupilot", "--return-at", str(return_m))
    ground.command = own
    vehicle.until("ready")
    return vehicle


def doctor(ground: Any, link: list[str]) -> dict[str, Any]:
    (found,) = ground.start("doctor", *link, "short.bundle", "--seconds", "6", "--json").end().events
    return next(each for each in found["findings"] if each["slug"] == "autopilot/qualified")


@pytest.mark.slow
def test_qualify_flies_a_sortie_and_writes_a_record(ground: Any, port: int, tmp_path: Path) -> None:
    link = ["--connect", f"udpin:127.0.0.1:{port}"]
    as_quad = [*link, "--vehicle", "quad-07", "--speed", str(SPEED), "--json"]
    words = [*ground.afresh, "compile", SHORT, "-o", "short.bundle"]
    subprocess.run(words, cwd=tmp_path, env=ground.environment, check=True, capture_output=True)
    vehicle = simulated(ground, port, 30)

    rehearsal = ground.start("run", "short.bundle", "--dry-run", *as_quad).end()
    assert any("is not qualified: no flight test" in text for text in notes(rehearsal)), rehearsal.events

    ground.command = ground.afresh
    flown = ground.start("qualify", SHORT, "--sitl", "--only", "climb", *as_quad).end()
    ground.command = None
    said = flown.events[-1]
    checks = {each["slug"]: each for each in said["checks"]}
    assert flown.code == said["exit_code"] == ExitCode.OK, (flown.stderr, said)
    assert (said["qualified"], said["not_flown"]) == (False, ["leg"])
    assert {checks[slug]["outcome"] for slug in ("stop/climb", "land/down", "fence/on", "sortie/climb")} == {"held"}
    assert checks["takeover/mode"]["outcome"] == "unchecked"
    assert Path(said["record"]).parent.name == "qualifications"
    assert [event["event"] for event in flown.events if event["event"] in ("sortie", "summary")] == [
        "sortie",
        "summary",
    ]

    rehearsal = ground.start("run", "short.bundle", "--dry-run", *as_quad).end()
    (note,) = [text for text in notes(rehearsal) if "qualified" in text]
    assert note.startswith("this vehicle was qualified in simulation only, on ")
    assert doctor(ground, link)["found"] in note

    vehicle.signal(signal.SIGTERM)
    vehicle.end()
    simulated(ground, port, 40)  # somebody has set it otherwise
    finding = doctor(ground, link)
    assert finding["verdict"] == "warn"
    assert "has changed since: parameters `RTL_ALT`" in finding["found"]
