"""The images of whole flights: every picture is a record, lost reports are requested again, gaps are listed before the
landing, and the audits agree. A ground station takes the pictures.
"""

from typing import Any

import pytest

from rtshcua.evidence.report import LogVerdict
from rtshcua.model import faults
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Plan
from virtual import case
from virtual.flight import Flight, Flown
from virtual.photographer import Photographer, agree_with_truth, details_of, gaps_of

S, M = case.S, case.M


def flight(flavour: str, *happens: faults.Fault, gimbal: bool = False, far: int = 60 * M) -> Flight:
    up, leg, home = case.short_steps()
    leg = case.step(1, 1, case.flat.GOTO, Plan(MotionKind.FLY, (far, 20 * M), 15 * M, 0), far, 20 * M, 15 * M)
    config = case.simulated(flavour, camera=True, gimbal=gimbal, faults=tuple(happens), utc_us=1_700_000_000_000_000)
    return Flight(case.seal(case.mission((up, leg, home))), config)


def verified(flown: Flown) -> Any:
    report = flown.audit().report
    assert report.failure is None, report.failure
    assert report.verdict is LogVerdict.VERIFIED
    return {each.slug: each.text for each in report.proven}


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_every_image_is_a_record_and_every_lost_one_is_explained(flavour: str) -> None:
    flying = flight(flavour, faults.CameraLoss(0, 1_000), gimbal=True)
    flown = flying.fly(Photographer(flying))
    assert flown.ending == "completed"
    agree_with_truth(flown, flavour)
    shots = flown.vehicle.simulation.shots
    stored = [shot for shot in shots if shot.stored]
    images = [each for each in details_of(flown) if each.result]
    assert len(images) == len(stored) > 20
    last = gaps_of(flown)[-1]
    lost = len(shots) - len(stored)
    assert lost > 0
    if flavour == "px4":
        assert (last.missing, last.failed, last.taken) == (0, lost, len(stored)), "its failures were reported"
    else:
        assert (last.missing, last.failed, last.taken) == (lost, 0, len(stored)), "its index skips what was lost"
    assert f"{len(images)} images" in verified(flown)["images"]


def test_lost_reports_are_requested_again() -> None:
    flying = flight("px4")
    photographer = Photographer(flying, lost=0.4)
    flown = flying.fly(photographer)
    agree_with_truth(flown, "px4")
    images, stored = details_of(flown), [shot for shot in flown.vehicle.simulation.shots if shot.stored]
    assert len(images) == len(stored) > 20
    assert sum(each.asked > 0 for each in images) == photographer.asked > 4
    assert gaps_of(flown)[-1].missing == 0
    verified(flown)


def test_what_never_arrives_is_listed_before_the_landing_after_few_requests() -> None:
    flying = flight("px4")
    photographer = Photographer(flying, never=lambda m: m.image_index in (4, 5, 9))
    flown = flying.fly(photographer)
    first, last = gaps_of(flown)[0], gaps_of(flown)[-1]
    assert first.lost == last.lost == ((4, 5), (9, 9))
    records = [(each["type"], each.get("event"), each.get("detail")) for each in flown.records]
    home = next(
        at for at, each in enumerate(records) if each[:2] == ("effect", "dispatched") and each[2] == "return_home"
    )
    landed = next(at for at, each in enumerate(records) if each[1] == "succeeded" and at > home)
    assert home <= next(at for at, each in enumerate(records) if each[1] == "images-missing") < landed
    verified(flown)


def test_images_after_the_last_report_are_missed_by_their_number() -> None:
    flying = flight("px4")
    flown = flying.fly(Photographer(flying, never=lambda m: m.image_index >= 15))
    stored = sum(shot.stored for shot in flown.vehicle.simulation.shots)
    first, last = gaps_of(flown)[0], gaps_of(flown)[-1]
    assert first.last >= 15, "before the landing"
    assert len(details_of(flown)) == last.taken == 15
    assert last.lost == ((15, last.last),)
    assert stored - 2 <= last.last + 1 <= stored, "pictures of the last seconds on the ground"
    verified(flown)


@pytest.mark.parametrize("counter", list(faults.CameraCounter))
def test_a_camera_that_restarts_begins_a_new_series_or_goes_on(counter: faults.CameraCounter) -> None:
    flying = flight("px4", faults.CameraReboot(20 * S, 3 * S, counter))
    flown = flying.fly(Photographer(flying))
    agree_with_truth(flown, "px4")
    images, stored = details_of(flown), [shot for shot in flown.vehicle.simulation.shots if shot.stored]
    assert len(images) == len(stored)
    restarts = counter is faults.CameraCounter.RESTARTS
    assert {each.series for each in images} == ({0, 1} if restarts else {0})
    assert all(each.missing == 0 for each in gaps_of(flown))
    verified(flown)


def test_a_vehicle_without_a_camera_is_asked_nothing_about_images() -> None:
    for flavour in ("px4", "ardupilot"):
        flying = Flight(case.seal(case.mission(case.low_steps(leg=False))), case.simulated(flavour))
        heard: list[bytes] = []
        flying.vehicle.simulation.heard = lambda at_us, frame, heard=heard: heard.append(frame)  # type: ignore[misc]
        flown = flying.fly()
        assert not flown.effects("image")
        assert not flown.effects("images-missing")
        assert not any(frame[7] == 76 and frame[10:14] in (b"\x00\x80\x83C", b"\x00\x004C") for frame in heard)
