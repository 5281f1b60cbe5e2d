"""Wrong runtimes complete calm flights; with faults the judge detects their defects."""

import pytest

from campaign.flying import SKILLS, calm, flight_of, flown, right, space, wrong_fails, wrongly
from campaign.wrong import BY_NAME, WRONG
from rtshcua.campaign.drawing import CampaignTally
from rtshcua.campaign.scenario_source import incident_text
from rtshcua.model import faults
from rtshcua.model.faults import Direction, Fault, FlightMode
from rtshcua.model.scenario import AtTime, Incident, Scenario, Start
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import judge

S = 1_000_000


def at(s: float, fault: Fault) -> Incident:
    when = AtTime(round(s * S), round(s * S))
    return Incident(when, fault, incident_text(when, fault, SKILLS))


def of(flavour: str, *incidents: Incident, battery: int | None = None) -> Scenario:
    return Scenario("by hand", (flavour,), 7, 7, Start(battery=battery), incidents, ())


def slugs(was: ScenarioFlown) -> set[str]:
    return {each.slug for each in judge(was).failures}


#: a scenario that shows each defect, and its slug
SHOWN: dict[str, tuple[Scenario, str]] = {
    "hover-by-mode": (of("px4", at(12, faults.Recall(0))), "no-stop"),
    "grace-through-silence": (
        of("px4", at(1.6, faults.MessageSilence(0, "GPS_RAW_INT", 8 * S)), at(3.8, faults.LinkSilence(0, 3_500_000))),
        "needless"),
    "mode-taken-ignored": (of("px4", at(12, faults.PilotMode(0, FlightMode.POSITION))), "motion-after-takeover"),
    "target-taken-ignored": (of("px4", at(12, faults.PilotPause(0))), "motion-after-takeover"),
    "first-link-skipped": (of("px4", at(12, faults.GpsLoss(0, 4 * S))), "chain"),
    "sent-before-recorded": (of("px4", at(12, faults.DiskStall(0, 10 * S))), "unrecorded"),
    "fallback-held-for-record": (of("px4", at(12, faults.DiskFull(0))), "not-ended"),
    "dispatch-unwritten": (of("px4", at(12, faults.Recall(0))), "unlogged-effect"),
    "late-frames-leave": (of("px4", at(18, faults.MessageSilence(0, "HEARTBEAT", 3 * S))), "late"),
    "aged-from-arrival": (of("px4", at(2, faults.LinkDelay(0, 2 * S, None, Direction.DOWN))), "untrue"),
    "stale-is-fresh": (of("px4", at(8, faults.MessageSilence(0, "BATTERY_STATUS"))), "derive"),
    "unknown-is-true": (of("px4", at(7, faults.MessageSilence(0, "GPS_RAW_INT"))), "derive"),
    "degrade-not-watched": (of("px4", at(12, faults.BatteryLevel(0, 4_500))), "not-watched"),
    "assume-not-watched": (of("px4", at(12, faults.GpsLoss(0, 4 * S))), "not-watched"),
    "deadline-moves": (of("px4", at(6, faults.MessageSilence(0, "GPS_RAW_INT", 8 * S))), "release"),
    "approval-taken-again": (of("px4", at(2, faults.Approval(0, "supervisor", 2)), battery=8_000), "derive"),
    "recall-ignored": (of("px4", at(12, faults.Recall(0))), "chain"),
    "stop-unobserved": (
        of("px4", at(12, faults.Recall(0)), at(12, faults.LinkSilence(0, 800_000, Direction.UP))), "no-stop"),
    "last-link-once": (
        of("px4", at(12.4, faults.MessageSilence(0, "HEARTBEAT", 25 * S)), at(12.5, faults.Recall(0))), "chain"),
    "restart-ends-in-air": (of("px4", at(12, faults.RuntimeKilled(0, 2 * S))), "not-ended"),
    "restart-over-pilot": (
        of("px4", at(12, faults.RuntimeKilled(0, 3 * S)), at(13, faults.PilotMode(0, FlightMode.POSITION))),
        "motion-after-takeover"),
    "full-disk-unnoticed": (of("px4", at(5, faults.DiskFull(0, 20 * S))), "unrecorded"),
    "airspace-unchecked": (of("px4", at(15, faults.GpsGlitch(0, 100_000, 0, 20 * S))), "derive"),
    "clock-moves-times": (of("px4", at(12, faults.ClockStep(0, 600 * S))), "needless"),
    "landing-by-word": (of("px4", at(12, faults.MessageSilence(0, "GPS_RAW_INT"))), "untrue"),
    "mode-not-asked": (of("px4", at(26.4, faults.PilotMode(0, FlightMode.POSITION))), "motion-after-takeover"),
    "denied-trusts-step": (of("px4", battery=8_000), "chain"),
    "crash-ignored": (of("ardupilot", at(30, faults.Kill(0))), "went-on"),
    "judged-before-fresh": (of("px4", at(12, faults.LinkSilence(0, 4 * S))), "chain"),
}  # fmt: skip


def test_wrong_runtime_is_undone_afterwards() -> None:
    """Regression: caches of the wrong runtime remained in later flights of the correct one."""
    scenario, slug = SHOWN["landing-by-word"]
    before = logs(flown(scenario))
    assert slugs(wrongly("landing-by-word", scenario)) == {slug}
    assert logs(flown(scenario)) == before


def logs(was: ScenarioFlown) -> list[bytes]:
    return [line for life in was.lives for line in life.lines]


#: how many of these `make test` flies
SOME = ("recall-ignored", "dispatch-unwritten", "first-link-skipped", "hover-by-mode")


@pytest.mark.claim("T2", broken="runtimes that are wrong in one of many ways (docs/flying/wrong-runtimes.md)")
@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[] if each in SOME else [pytest.mark.soak]) for each in BY_NAME]
)
def test_judge_detects_each_wrong_runtime(name: str) -> None:
    scenario, slug = SHOWN[name]
    assert slug in slugs(wrongly(name, scenario))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[] if each == "assume-not-watched" else [pytest.mark.soak]) for each in SHOWN]
)
def test_judge_does_not_share_the_runtimes_defects(name: str) -> None:
    """The judge shares no code with the runtime, so its defects change no verdict."""
    scenario, slug = SHOWN[name]
    was = wrongly(name, scenario)
    with BY_NAME[name].made():
        assert slug in slugs(was) or slug == "derive"  # the auditor shares the decision with the runtime


@pytest.mark.soak
@pytest.mark.parametrize("name", BY_NAME)
def test_correct_runtime_does_not_fail_in_these_flights(name: str) -> None:
    assert slugs(flown(SHOWN[name][0])) == set()


@pytest.mark.soak
@pytest.mark.parametrize(("name", "number"), [("restart-over-pilot", 4), ("mode-not-asked", 214)])
def test_aimed_campaign_finds_the_defect(name: str, number: int) -> None:
    flight = flight_of(
        1, number - 1, space(BY_NAME[name].aimed), CampaignTally()
    )  # the first round has no observations
    assert wrong_fails(name, flight)
    assert right(flight).result.failures == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "flavour"),
    [
        pytest.param(each.name, flavour, marks=[] if each.name == "hover-by-mode" else [pytest.mark.soak])
        for each in WRONG
        for flavour in ("px4", "ardupilot")
        if each.flavour in (None, flavour)
    ],
)
def test_wrong_runtimes_complete_a_calm_flight(name: str, flavour: str) -> None:
    was = wrongly(name, calm(flavour))
    assert (was.ending, slugs(was)) == ("completed", set())
