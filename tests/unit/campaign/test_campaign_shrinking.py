"""Shrinking keeps only the needed faults of a failing scenario, with round parameters."""

from rtshcua.campaign.drawing import CampaignTally, FaultSpace, Moment, draw
from rtshcua.campaign.scenario_source import incident_text, scenario_text
from rtshcua.campaign.shrinking import shrink
from rtshcua.model.faults import Fault, GpsLoss, LinkSilence, WindStep
from rtshcua.model.scenario import AtTime, Incident, Scenario, Start
from virtual.rows import rows

S = 1_000_000
SKILLS = ("takeoff", "goto", "goto", "return_home")
SPACE = FaultSpace(SKILLS, {"px4": 60 * S, "ardupilot": 70 * S}, ("supervisor",))


def at(us: int, fault: Fault) -> Incident:
    when = AtTime(us, us)
    return Incident(when, fault, incident_text(when, fault, SKILLS))


def of(*incidents: Incident) -> Scenario:
    return Scenario("x", ("px4",), 7, 7, Start(battery=6_000), incidents, ())


def kinds(scenario: Scenario) -> list[type[Fault]]:
    return [type(each.fault) for each in scenario.incidents]


def test_unneeded_faults_are_removed() -> None:
    full = of(at(3 * S, WindStep(0, 9_000)), at(5 * S, GpsLoss(0, S)), at(6 * S, LinkSilence(0, S)))
    small, flown = shrink(full, SKILLS, lambda scenario: GpsLoss in kinds(scenario))
    assert kinds(small) == [GpsLoss]
    assert small.start == Start()
    assert 0 < flown < 60


def test_faults_that_fail_only_together_are_kept() -> None:
    full = of(at(3 * S, WindStep(0, 9_000)), at(5 * S, GpsLoss(0, S)), at(6 * S, LinkSilence(0, S)))
    small, _ = shrink(full, SKILLS, lambda scenario: {GpsLoss, LinkSilence} <= set(kinds(scenario)))
    assert kinds(small) == [GpsLoss, LinkSilence]


def test_parameters_become_weaker_and_rounder() -> None:
    full = of(at(34_560_000, LinkSilence(0, 17_300_000)))

    def fails(scenario: Scenario) -> bool:
        fault = scenario.incidents[0].fault if scenario.incidents else None
        return isinstance(fault, LinkSilence) and (fault.for_us or 0) >= 3 * S

    small, _ = shrink(full, SKILLS, fails)
    assert [each.text for each in small.incidents] == ["at 30 s link_silence(for = 4 s)"]


@rows("number", range(40))
def test_shrinking_terminates(number: int) -> None:
    scenario = draw(3, number, SPACE, CampaignTally({"px4": [Moment("landed", 9 * S)]})).scenario
    small, flown = shrink(scenario, SKILLS, lambda _: True, most=2_000)
    assert small.incidents == ()
    assert flown < 100


@rows("number", range(40))
def test_minimal_scenario_has_no_smaller_candidate(number: int) -> None:
    scenario = draw(3, number, SPACE, CampaignTally()).scenario
    many = len(scenario.incidents)

    def keeps(one: Scenario) -> bool:
        return len(one.incidents) == many

    small, flown = shrink(scenario, SKILLS, keeps, most=2_000)
    assert flown < 2_000
    assert shrink(small, SKILLS, keeps)[0] == small


def test_shrinking_respects_the_flight_limit() -> None:
    full = of(*(at(n * S, GpsLoss(0, S)) for n in range(20)))
    assert shrink(full, SKILLS, lambda scenario: len(scenario.incidents) >= 10, most=5)[1] == 5


def test_scenario_text_parses_to_the_scenario() -> None:
    scenario = of(at(0, LinkSilence(0, 5 * S, held=True)), at(2 * S, WindStep(0, 12_000, 270)))
    assert scenario_text(scenario, "short", "lib:missions/short.rts", "found\nby flight 7") == (
        "// found\n"
        "// by flight 7\n"
        'import "lib:missions/short.rts"\n'
        "\n"
        'scenario "x" {\n'
        "  flies  short\n"
        "  aboard px4\n"
        "  seeds  7\n"
        "  start  battery = 60 %\n"
        "  at 0 s link_silence(for = 5 s, held = yes)\n"
        "  at 2 s wind(speed = 12 m/s, from = 270 deg)\n"
        "}\n"
    )
