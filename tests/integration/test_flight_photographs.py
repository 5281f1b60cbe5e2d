"""Three jobs with a camera that loses a tenth of its pictures, on both simulated autopilots: each picture that was
stored is a record, each one that is missing has an explanation, the log verifies, and the recorded positions show the
resolution that was proved.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import cos, dist, hypot, radians, sin, sqrt
from pathlib import Path
from statistics import fmean

import msgspec
import pytest

from reference.photographed import JOBS, LOSES
from reference.sources import LIBRARY
from reference.verifiers import agree
from rtshcua.adapters.vehicle.image_observer import ImageObserver
from rtshcua.app.testing.run import ISSUED_AT_US
from rtshcua.campaign.rounds import FlownMission
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.evidence.image_records import ImageDetail, MissingDetail
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.ground.prove.survey_quality import StepPictures
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Plan
from rtshcua.virtual.flight import LATER_US
from rtshcua.virtual.flight_record import ScenarioFlown, records_of
from rtshcua.virtual.judge import judge

AXIS, FLAT = 6_378_137_000, 0.00669438  # mm, and the square of the eccentricity: WGS 84
Place = tuple[float, float, float]  # mm east and north of home, and above it


def fly(text: str, flavour: str) -> tuple[ScenarioFlown, StepPictures]:
    """Fly the scenario of a source once, and return it with the numbers that were proved."""

    def read(path: str) -> bytes:
        return text.encode() if path == "job.rts" else Path(path).read_bytes()

    program = load(["job.rts"], read, LIBRARY)
    checked = examine_program(program, dialect.load())
    assert checked.diagnostics == ()
    found = scenarios(program, dialect.load(), ISSUED_AT_US, LATER_US)
    assert not has_errors(found.diagnostics)
    (one,) = found.found
    mission = FlownMission.of(one.policy.lowered.policy, one.mission, one.mission.issued_at_us)
    (pictures,) = checked.pictures["flight"]
    return mission.flown(one.scenario, flavour, 1), pictures


def effects(flown: ScenarioFlown, *events: str) -> list[tuple[str, str]]:
    """The events of its log with these names, and their details."""
    (life,) = flown.lives
    return [(each["event"], each["detail"]) for each in records_of(life) if each.get("event") in events]


def images(flown: ScenarioFlown) -> list[ImageDetail]:
    return [msgspec.json.decode(detail, type=ImageDetail) for _, detail in effects(flown, "image")]


def place(flown: ScenarioFlown, image: ImageDetail) -> Place:
    """Where an image was taken, by its record."""
    assert image.latitude is not None
    assert image.longitude is not None
    assert image.above_home_mm is not None
    return *local(flown, image.latitude, image.longitude), image.above_home_mm


def local(flown: ScenarioFlown, latitude: int, longitude: int) -> tuple[float, float]:
    """A place in mm east and north of home, by the radii of the ellipsoid there."""
    origin = flown.policy.projection
    home = radians(origin.latitude / 1e7)
    bend = 1 - FLAT * sin(home) ** 2
    north = radians((latitude - origin.latitude) / 1e7) * AXIS * (1 - FLAT) / bend**1.5
    east = radians((longitude - origin.longitude) / 1e7) * AXIS / sqrt(bend) * cos(home)
    return east, north


def verified(flown: ScenarioFlown) -> None:
    """The log is verified, all of its decisions are derived again, and its images are proved."""
    (life,) = flown.lives
    auditor = Auditor(flown.root)
    for line in life.lines:
        auditor.take(line)
    audit = auditor.audit()
    assert (audit.report.verdict, audit.report.failure) == (LogVerdict.VERIFIED, None)
    stored = {each.slug: each.text for each in audit.report.proven}["images"]
    assert stored.startswith(f"{sum(each.result for each in images(flown))} images")
    agree(b"".join(life.lines), audit)
    assert judge(flown).failures == ()


def explained(flown: ScenarioFlown, spacing: int, least: int) -> None:
    """Each stored image is recorded once, each command is accounted for, and wherever two images are too far apart
    there is a record of one that failed, or of an index that is missing.
    """
    found = images(flown)
    taken = [each for each in found if each.index is not None]
    assert sorted(each.utc_us or 0 for each in taken) == sorted(each.utc_us for each in flown.images)
    _, text = effects(flown, "images-missing")[-1]
    told = msgspec.json.decode(text, type=MissingDetail)
    commanded = sum(detail.startswith("2000 to ") for _, detail in effects(flown, "payload.sent"))
    assert told.taken == len(taken) >= least * 4 // 5
    assert told.failed + told.missing == commanded - len(taken) >= least // 25
    lost = {index for first, last in told.lost for index in range(first, last + 1)}
    assert len(lost) == told.missing
    before: ImageDetail | None = None
    failed = far = 0
    for each in found:
        if each.index is None:
            failed += 1
            continue
        if before is not None and before.index is not None:
            gap = set(range(before.index + 1, each.index))
            assert gap <= lost
            apart = dist(place(flown, before)[:2], place(flown, each)[:2])  # ways are counted over ground
            assert apart < spacing * (1.3 + failed + len(gap)), (apart, each)
            far += apart > spacing * 1.3
        before, failed = each, 0
    assert far >= least // 40, "whoever loses a tenth has gaps"


def pixel(away: float) -> float:
    """What a pixel of the camera shows at a distance, in um."""
    return away * 13_200 / 8.8 / 5_472


def distance(job: str, flown: ScenarioFlown, at: Place) -> float:
    """How far a place is from what is photographed: the ground, the tower, the face."""
    if job == "grid":
        return at[2]
    if job == "turbine":
        return hypot(*(a - b for a, b in zip(at, local(flown, 473_985_000, 85_460_000), strict=False))) - 3_000
    return at[1] - local(flown, 473_980_000, 0)[1]


def flown_path(plan: Plan) -> Iterator[Place]:
    """Places along the planned path, a metre apart."""
    heights = plan.heights or (plan.altitude,) * (len(plan.path) // 2)
    points = list(zip(plan.path[::2], plan.path[1::2], heights, strict=True))
    for one, other in pairwise(points):
        steps = max(1, round(dist(one, other) / 1_000))
        for step in range(steps):
            yield tuple(a + (b - a) * step / steps for a, b in zip(one, other, strict=True))  # type: ignore[misc]


def resolved(job: str, flown: ScenarioFlown, proved: int) -> None:
    """By the recorded places, a pixel shows on average what it does on the planned path, to 2 %; by that path at most
    what was proved, and nearly that.
    """
    shown = fmean(pixel(distance(job, flown, place(flown, each))) for each in images(flown) if each.index is not None)
    planned = [pixel(distance(job, flown, each)) for each in flown_path(flown.mission.invocations[1].plan)]
    assert abs(shown / fmean(planned) - 1) < 0.02, (shown, fmean(planned))
    assert abs(max(planned) / proved - 1) < 0.02, (max(planned), proved)
    assert max(planned) <= proved + 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("job", "flavour"),
    [
        ("bridge", "px4"),
        ("bridge", "ardupilot"),
        *(
            pytest.param(*each, marks=pytest.mark.soak)
            for each in (("turbine", "px4"), ("turbine", "ardupilot"), ("grid", "px4"), ("grid", "ardupilot"))
        ),
    ],
)
def test_a_job_is_photographed_without_an_unexplained_gap(job: str, flavour: str) -> None:
    flown, pictures = fly(JOBS[job].source + LOSES, flavour)
    assert flown.lives[0].ending == "completed"
    verified(flown)
    explained(flown, JOBS[job].spacing, JOBS[job].least)
    resolved(job, flown, pictures.pixel_um)


REQUIRED = ("succeeds with image within 3 s", "succeeds with all_images within 10 s required")


LOST = "at 0 s camera_loss(part = 10 %)"
REPORTS_LOST = "at 40 s link_loss(loss = 20 %, for = 20 s)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "faults", "ending"),
    [
        ("px4", REPORTS_LOST, "completed"),
        ("ardupilot", LOST, "aborted"),
        pytest.param("px4", LOST, "aborted", marks=pytest.mark.soak),
        pytest.param("ardupilot", "", "completed", marks=pytest.mark.soak),
    ],
)
def test_a_step_that_requires_all_images_waits_for_lost_reports_and_fails_without_pictures(
    flavour: str, faults: str, ending: str
) -> None:
    source = JOBS["bridge"].source.replace(*REQUIRED)
    assert source != JOBS["bridge"].source
    flown, _ = fly(source + LOSES.replace(LOST, faults), flavour)
    assert flown.lives[0].ending == ending
    verified(flown)
    _, text = effects(flown, "images-missing")[0]
    first = msgspec.json.decode(text, type=MissingDetail)
    assert (first.missing + first.failed > 0) == (ending == "aborted")
    failed = [detail for event, detail in effects(flown, "failed") if detail.startswith("images-missing")]
    assert bool(failed) == (ending == "aborted"), effects(flown, "failed")
    assert any(each.asked for each in images(flown)) == (faults == REPORTS_LOST)


@pytest.mark.slow
def test_a_success_without_images_that_its_contract_requires_is_found_in_the_log(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ImageObserver, "lacking", lambda observer, since_us: "")
    flown, _ = fly(JOBS["bridge"].source.replace(*REQUIRED) + LOSES, "ardupilot")
    (life,) = flown.lives
    assert life.ending == "completed"
    auditor = Auditor(flown.root)
    for line in life.lines:
        auditor.take(line)
    failure = auditor.audit().report.failure
    assert failure is not None
    assert failure.slug == "image/incomplete"
