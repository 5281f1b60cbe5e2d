"""The boundary is lost in flight: frames signed ahead bring the vehicle down, like a fallback by the boundary."""

import ctypes
from collections.abc import Callable
from itertools import product
from typing import Any

import pytest

from boundary.losing import KEY, Apart, S, to_and_fro
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.report import LogVerdict
from rtshcua.mavlink.framing import message_id
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG, SET_POSITION_TARGET_GLOBAL_INT
from rtshcua.onboard.enforcement.isolated import DISPATCH, ENFORCE, STATEMENT
from rtshcua.onboard.ports import Ending
from rtshcua.simulation.config import SimulationConfig
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK
from virtual import case
from virtual.sampling import each_once

FLAVOURS = ("px4", "ardupilot")
KEYS = {"signed": KEY, "keyless": None}
#: all motion frames are among these
MOVING = (COMMAND_INT, COMMAND_LONG, SET_POSITION_TARGET_GLOBAL_INT)

Make = Callable[..., Apart]


@pytest.fixture
def apart(boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch) -> Make:
    def made(flavour: str, key: bytes | None = KEY, legs: int = 2, **more: Any) -> Apart:
        bundle = case.seal(case.mission(to_and_fro(legs)))
        return Apart(boundary, monkeypatch, bundle, config(flavour, key, **more), key)

    return made


def config(flavour: str, key: bytes | None, **more: Any) -> SimulationConfig:
    return case.simulated(flavour, signing_key=key, utc_us=case.flat.ISSUED + 60 * S, **more)


def at(moment_us: int) -> Callable[[Apart], bool]:
    return lambda of: of.flight.clock.elapsed_us >= moment_us


def flies(step: int) -> Callable[[Apart], bool]:
    """Five seconds after the vehicle was observed to fly this step."""
    since: list[int] = []

    def dies(of: Apart) -> bool:
        view = of.flight.runtime.view(of.flight.clock.now())
        if view.step == step and view.stage.name == "RUNNING" and not since:
            since.append(of.flight.clock.elapsed_us)
        return bool(since) and of.flight.clock.elapsed_us - since[0] >= 5 * S

    return dies


def after_loss(flown: Any) -> list[tuple[int, int, int]]:
    """The links that flew without the boundary."""
    lost = next(n for n, record in enumerate(flown.records) if record.get("event") == "boundary-lost")
    after = flown.records[lost:]
    assert not [record for record in after if record["type"] == "decision"]
    return [(r["kind"], r["step"], r["link"]) for r in after if r.get("event") == "dispatched"]


def came_down(flown: Any) -> None:
    """Check that the vehicle landed by our command, and that the log proves exactly what the boundary signed."""
    assert flown.ending is Ending.ABORTED
    truth = flown.vehicle.simulation.truth()
    assert not truth.in_air
    assert not truth.armed
    report = flown.audit().report
    assert report.failure is None
    assert report.verdict is LogVerdict.INCOMPLETE
    assert report.shortfall is not None
    assert report.shortfall.slug == "boundary/lost"


@pytest.mark.soak  # each takes as long as ten tests
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_ten_minutes_after_takeoff(flavour: str, key: str, apart: Make) -> None:
    of = apart(flavour, KEYS[key], legs=80, hover_us=40 * 60 * S)
    took_off: list[int] = []

    def dies(of: Apart) -> bool:
        if of.vehicle.simulation.truth().in_air and not took_off:
            took_off.append(of.flight.clock.elapsed_us)
        return bool(took_off) and of.flight.clock.elapsed_us - took_off[0] >= 600 * S

    flown = of.fly(dies)
    came_down(flown)
    links = after_loss(flown)
    step = links[0][1]
    assert step > 10
    assert links == [(FALLBACK_LINK, step, 0), (FALLBACK_LINK, step, 1)], "hover, and when its time is over, home"
    assert (of.gate.counts.unverified > 100) == (key == "signed")


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "second"), each_once(product(FLAVOURS, KEYS), (12, 30, 20)))
def test_vehicle_lands_after_the_loss_of_the_boundary(vehicle: tuple[str, str], second: int, apart: Make) -> None:
    flavour, key = vehicle
    came_down(apart(flavour, KEYS[key]).fly(at(second * S)))


@pytest.mark.soak
@pytest.mark.parametrize("second", range(3, 100, 2))
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_at_each_moment(flavour: str, key: str, second: int, apart: Make) -> None:
    of = apart(flavour, KEYS[key])
    flown = of.fly(at(second * S))
    assert not flown.vehicle.simulation.truth().in_air
    if flown.ending is not Ending.COMPLETED:
        assert flown.ending in (Ending.ABORTED, Ending.REFUSED)


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_takeoff_still_on_ground_gets_land_command(flavour: str, apart: Make) -> None:
    of = apart(flavour)

    def dies(of: Apart) -> bool:
        truth = of.vehicle.simulation.truth()
        return truth.armed and not truth.in_air

    flown = of.fly(dies)
    assert flown.ending in (Ending.ABORTED, Ending.REFUSED)
    assert after_loss(flown)[:1] in ([], [(CONTINGENCY_LINK, -1, 2)])
    assert not flown.vehicle.simulation.truth().in_air


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_frames_that_are_lost_on_the_way_are_sent_again_from_the_copies(flavour: str, apart: Make) -> None:
    of, lost = apart(flavour), []

    def lose(frame: bytes) -> bool:
        if of.dead and message_id(frame, 0) in MOVING and len(lost) % 4 != 3:
            lost.append(frame)
            return True
        lost.append(b"") if of.dead else None
        return False

    of.vehicle.lose = lose
    flown = of.fly(flies(1))
    came_down(flown)
    assert sum(map(bool, lost)) >= 3
    assert len({frame for frame in lost if frame}) == sum(map(bool, lost)), "each copy leaves once"


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_next_link_flies_when_one_fails(flavour: str, apart: Make) -> None:
    """No frame of the first link arrives, even after retries."""
    of = apart(flavour)
    moving: list[str] = []

    def lose(frame: bytes) -> bool:
        active = of.flight.runtime.view(of.flight.clock.now()).contract
        if of.dead and message_id(frame, 0) in MOVING:
            moving.append(active)
            return active == "hover"
        return False

    of.vehicle.lose = lose
    flown = of.fly(flies(1))
    came_down(flown)
    assert [(kind, link) for kind, _, link in after_loss(flown)] == [(FALLBACK_LINK, 0), (FALLBACK_LINK, 1)]
    # no more requests: each frame is sent after a heartbeat, once a second on PX4, for 5 s
    assert moving.count("hover") in (5, 6)
    failed = [record["detail"] for record in flown.records if record.get("event") == "failed"]
    assert failed, "what did not arrive had no effect"


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_return_continues_after_boundary_loss(flavour: str, apart: Make) -> None:
    of = apart(flavour)
    flown = of.fly(flies(3))
    assert after_loss(flown) == []
    came_down(flown)


@pytest.mark.slow
def test_frames_ahead_are_renewed_silently_during_flight(apart: Make) -> None:
    """A long flight without a loss: no note reports a failed signature."""
    flown = apart("px4", legs=8).fly(lambda _: False)
    assert flown.ending is Ending.COMPLETED
    report = flown.audit().report
    assert report.verdict is LogVerdict.VERIFIED
    assert [claim.slug for claim in report.unproven if "signed ahead" in claim.text] == ["boundary"]
    noted = [record["detail"] for record in flown.records if record.get("event") == "noted"]
    assert not [text for text in noted if "ahead" in text]


@pytest.mark.slow
@pytest.mark.parametrize("call", [DISPATCH, STATEMENT], ids=["at a dispatch", "at a seal"])
def test_earlier_decision_is_recorded_before_loss_despite_late_seal(
    call: int, apart: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The boundary dies in the call after its decision about a leg, in the same step."""
    of = apart("px4", legs=4)
    answer, calls = of._answer, []

    def dies(octets: bytes) -> bytes:
        calls.append(octets[0])
        if octets[0] == call and calls.count(ENFORCE) == 4 and ENFORCE in calls[-3:]:
            of.lose()
            raise BrokenPipeError
        return answer(octets)

    of._answer = dies
    monkeypatch.setattr(Recorder, "overdue", lambda self, now: calls.count(ENFORCE) == 4)
    came_down(of.fly(lambda _: False))
    assert of.dead
