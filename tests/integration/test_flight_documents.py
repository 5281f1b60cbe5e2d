"""Documents on whole flights in virtual time: approvals in the air, replacements, and recalls."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from reference.low_source import INSPECTION, low_source
from rtshcua.app.programs import compile_sources
from rtshcua.evidence.report import LogVerdict
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.onboard.ports import Ending, Event, Presented
from rtshcua.wire.approval import ApprovalDocument, sign_approval
from rtshcua.wire.keys import Duty
from rtshcua.wire.recall import RecallDocument, sign_recall
from rtshcua.wire.replacement import sign_replacement
from virtual import case
from virtual.flight import Flight, Flown
from virtual.shipped import simulated

S = case.S
ASKED = 2


def compiled(folder: Path, work: str) -> tuple[Mission, bytes]:
    source = folder / "low.rts"
    source.write_text(low_source(work))
    found, _ = compile_sources([source], mission=None, issued_at_us=case.flat.ISSUED)
    assert found.mission is not None, found.diagnostics
    return found.mission, case.seal(found.mission, found.policy)


@pytest.fixture(scope="module")
def low(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return compiled(tmp_path_factory.mktemp("low"), INSPECTION)[1]


@pytest.fixture(scope="module")
def shorter(tmp_path_factory: pytest.TempPathFactory) -> Mission:
    return compiled(tmp_path_factory.mktemp("shorter"), "hover(5 s)")[0]


def fly(bundle: bytes, flavour: str, when: str, document: Callable[[Flight], bytes]) -> Flown:
    """Fly, and hand the document in 2 s after a record with these words; the log verifies."""
    flight = Flight(bundle, simulated(flavour))
    since: list[int] = []

    def each(flight: Flight) -> Sequence[Event]:
        now_us = flight.clock.elapsed_us
        if not since and any(when.encode() in line for line in flight.sink.lines[1:]):
            since.append(now_us)
        if len(since) == 1 and now_us - since[0] >= 2 * S:
            since.append(now_us)
            return [Presented(now_us, document(flight), 1)]
        return ()

    flown = flight.fly(each)
    assert len(since) == 2, "it was never handed in"
    audit = flown.audit()
    assert audit.report.verdict is LogVerdict.VERIFIED, audit.report
    return flown


def approval(flight: Flight, granted: int = 1) -> bytes:
    step = flight.loaded.bundle.mission.invocations[ASKED]
    utc_us = flight.clock.now().utc_us
    flying = flight.loaded.in_force
    said = ApprovalDocument(
        flying.flight, flying.bundle.mission_digest, step.invocation_id, step.binding, "quad-07", "supervisor", granted,
        utc_us, utc_us + 60 * S,
    )  # fmt: skip
    return sign_approval(said, case.KEYS[Duty.APPROVAL])


@pytest.mark.slow
def test_step_waits_in_the_air_for_an_approval(low: bytes) -> None:
    flown = fly(low, "px4", "approval/awaited", approval)
    assert flown.ending is Ending.COMPLETED
    assert flown.dispatched() == ["takeoff", "goto", "hover", "inspect_area", "return_home"]
    assert [(step, outcome) for step, outcome, _ in flown.decisions() if step == ASKED] == [(2, "defer"), (2, "allow")]


@pytest.mark.slow
def test_refused_approval_returns_home(low: bytes) -> None:
    flown = fly(low, "ardupilot", "approval/awaited", lambda flight: approval(flight, 0))
    assert flown.ending is Ending.ABORTED
    assert "inspect_area" not in flown.dispatched()
    assert flown.decisions()[-1] == (2, "deny", "approval/refused")


@pytest.mark.slow
def test_agent_replaces_the_mission_in_flight(low: bytes, shorter: Mission) -> None:
    expected: list[Sequence[Invocation]] = []

    def document(flight: Flight) -> bytes:
        vehicle: Any = flight.vehicle
        vehicle.expect = expected.append
        flying = flight.loaded.in_force
        return sign_replacement(shorter, over=flying.bundle, flight=flying.flight, kept=2, key=case.KEYS[Duty.MISSION])

    flown = fly(low, "ardupilot", '"detail":"goto"', document)
    assert flown.ending is Ending.COMPLETED
    assert flown.dispatched() == ["takeoff", "goto", "hover", "return_home"]
    assert [[step.contract.name for step in steps] for steps in expected] == [flown.dispatched()]


def test_replacement_requests_reports_for_its_deadlines(low: bytes, shorter: Mission) -> None:
    def quick(step: Invocation) -> Invocation:
        return replace(step, contract=replace(step.contract, deadline_us=200_000))

    vehicle = Flight(low, simulated("px4")).vehicle
    vehicle.poll(vehicle.clock.monotonic_us, 10 * S)
    before = dict(vehicle.driver.stream_requests.plan.intervals)
    vehicle.expect([quick(step) for step in shorter.invocations])
    after = vehicle.driver.stream_requests.plan.intervals
    assert before["GPS_RAW_INT"] > after["GPS_RAW_INT"] == 100_000


@pytest.mark.slow
def test_recall_flies_the_contingency(low: bytes) -> None:
    def document(flight: Flight) -> bytes:
        utc_us = flight.clock.now().utc_us
        flying = flight.loaded.in_force
        said = RecallDocument("quad-07", flying.flight, flying.bundle.mission_digest, b"", utc_us, utc_us + 60 * S)
        return sign_recall(said, case.KEYS[Duty.APPROVAL])

    flown = fly(low, "px4", '"detail":"goto"', document)
    assert flown.ending is Ending.RECALLED
    assert flown.dispatched()[:2] == ["takeoff", "goto"]
    assert {record["kind"] for record in flown.effects("dispatched")[2:]} == {2}
    assert not flown.vehicle.simulation.truth().in_air
