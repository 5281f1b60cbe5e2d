"""The export of a flight whose mission was replaced in the air."""

import json
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from reference.forgery import edit
from reference.kept_frames import kept
from reference.low_source import INSPECTION, low_source
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.app.programs import compile_sources
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli import app
from rtshcua.mavlink import tlog
from rtshcua.model.flat.mission import Mission
from rtshcua.onboard.ports import Presented
from rtshcua.wire.keys import Duty
from rtshcua.wire.replacement import sign_replacement
from virtual import case
from virtual.flight import Flight
from virtual.shipped import simulated

pytestmark = pytest.mark.slow

Sign = Callable[[Mission], bytes]


def compiled(folder: Path, work: str) -> tuple[Mission, bytes]:
    folder.mkdir()
    source = folder / "low.rts"
    source.write_text(low_source(work))
    found, _ = compile_sources([source], mission=None, issued_at_us=case.flat.ISSUED)
    assert found.mission is not None
    return found.mission, case.seal(found.mission, found.policy)


@pytest.fixture(scope="module")
def replaced(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Mission, Sign]:
    """A run in which a step was replaced by `hover(5 s)`; that mission; and what signs another replacement."""
    top = tmp_path_factory.mktemp("replaced")
    _, bundle = compiled(top / "low", INSPECTION)
    shorter, _ = compiled(top / "shorter", "hover(5 s)")
    flight = Flight(bundle, simulated("px4"))
    entries = kept(flight)
    presented: list[int] = []

    first = flight.loaded.in_force

    def sign(mission: Mission) -> bytes:
        return sign_replacement(mission, over=first.bundle, flight=first.flight, kept=2, key=case.KEYS[Duty.MISSION])

    def each(flying: Flight) -> Any:
        if presented or not any(b'"event":"dispatched"' in line and b'"step":1' in line for line in flying.sink.lines):
            return ()
        presented.append(flying.clock.elapsed_us)
        return [Presented(flying.clock.elapsed_us, sign(shorter), 1)]

    lines = flight.fly(each).lines
    run = top / "run"
    run.mkdir()
    (run / "log.jsonl").write_bytes(b"".join(lines))
    (run / "telemetry.tlog").write_bytes(b"".join(tlog.encode(at_us, frame) for at_us, frame in entries))
    assert presented
    assert any(b'"event":"replacement"' in line for line in lines)
    return run, shorter, sign


def test_the_plan_is_the_mission_with_the_steps_that_replaced_others(
    replaced: tuple[Path, Mission, Sign], tmp_path: Path
) -> None:
    plan, words = tmp_path / "flight.plan", tmp_path / "flight.geojson"
    assert app.main(["export", str(replaced[0]), "--to", "plan", "-o", str(plan)]) == ExitCode.OK
    items = json.loads(plan.read_text(encoding="utf-8"))["mission"]["items"]
    assert [each["params"][0] for each in items if each["command"] == 19] == [5.0]
    assert app.main(["export", str(replaced[0]), "--to", "geojson", "-o", str(words)]) == ExitCode.OK
    found = json.loads(words.read_text(encoding="utf-8"))["features"]
    decisions = [each["properties"]["words"] for each in found if each["properties"]["kind"] == "decision"]
    assert any("`hover(time = 5 s)`" in each for each in decisions)


def test_steps_that_were_replaced_were_in_force(replaced: tuple[Path, Mission, Sign]) -> None:
    flight = read_flight(replaced[0] / "log.jsonl")
    assert not isinstance(flight, Refusal)
    now = flight.mission.invocations
    assert set(map(msgspec.json.encode, now)) < set(map(msgspec.json.encode, flight.steps))
    assert len(flight.steps) > len(now)


def test_a_forged_replacement_is_refused(
    replaced: tuple[Path, Mission, Sign], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing of it is verified, so its paths may be anything."""
    run, shorter, sign = replaced
    steps = shorter.invocations
    plan = msgspec.structs.replace(steps[-1].plan, path=(1, 2, 3))
    forged = msgspec.structs.replace(shorter, invocations=(*steps[:-1], msgspec.structs.replace(steps[-1], plan=plan)))
    lines = (run / "log.jsonl").read_bytes().splitlines(keepends=True)
    at = next(number for number, line in enumerate(lines) if b'"event":"replacement"' in line)
    lines[at] = edit(lines[at], detail=b64encode(sign(forged)).decode())
    log = tmp_path / "log.jsonl"
    log.write_bytes(b"".join(lines))
    for to in ("plan", "kml", "csv"):
        assert app.main(["export", str(log), "--to", to, "-o", str(tmp_path / "out")]) == ExitCode.INPUT
        assert "the replaced mission" in capsys.readouterr().err
