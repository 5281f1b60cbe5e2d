"""Drawing: reproducible by seed, with the stated distribution, preferring untried pairs."""

from collections import Counter
from dataclasses import fields

from rtshcua.campaign.drawing import ANYWHERE, GROUPS, HOW_MANY, RANGES, CampaignTally, Drawn, FaultSpace, Moment, draw
from rtshcua.model import faults
from rtshcua.model.scenario import AfterStep, AtTime

S = 1_000_000
SPACE = FaultSpace(("takeoff", "goto", "goto", "return_home"), {"px4": 60 * S, "ardupilot": 70 * S}, ("supervisor",))
SEEN = CampaignTally({"px4": [Moment("takeoff sent", 2 * S), Moment("landed", 50 * S)], "ardupilot": []})


def drawn(count: int, tally: CampaignTally = SEEN, space: FaultSpace = SPACE) -> list[Drawn]:
    return [draw(1, number, space, tally) for number in range(count)]


def test_drawing_is_determined_by_the_seed() -> None:
    assert drawn(50) == drawn(50)
    assert drawn(50) != [draw(2, number, SPACE, SEEN) for number in range(50)]


def test_every_parameter_of_every_kind_has_a_range() -> None:
    words = {"at_us", "way", "held", "mode", "message", "role", "says", "counter"}
    parameters = [
        (kind, each.name) for kind in set(faults.KINDS.values()) for each in fields(kind) if each.name not in words
    ]
    assert len(parameters) > 50
    assert [each for each in parameters if each not in RANGES and (None, each[1]) not in RANGES] == []


def test_every_fault_kind_is_in_exactly_one_group() -> None:
    grouped = [kind for _, kinds in GROUPS for kind in dict.fromkeys(kinds)]
    assert sorted(kind.__name__ for kind in grouped) == sorted({kind.__name__ for kind in faults.KINDS.values()})


def test_all_kinds_flavours_and_triggers_are_drawn() -> None:
    flights = drawn(1_500)
    incidents = [each for one in flights for each in one.scenario.incidents]
    assert {type(each.fault) for each in incidents} == set(faults.KINDS.values())
    assert {type(each.when) for each in incidents} == {AtTime, AfterStep}
    assert Counter(one.scenario.flavours for one in flights) == {("px4",): 750, ("ardupilot",): 750}


def test_number_of_faults_follows_its_distribution() -> None:
    many = Counter(len(one.scenario.incidents) for one in drawn(2_000))
    for number, part in enumerate(HOW_MANY, 1):
        assert abs(many[number] / 20 - part) < 4, (number, many[number])


def test_faults_cluster_near_observed_state_changes() -> None:
    times = [
        each.when.from_us
        for one in drawn(1_000)
        if one.scenario.flavours == ("px4",)
        for each in one.scenario.incidents
        if isinstance(each.when, AtTime)
    ]
    near = sum(any(-3 * S <= time - at <= 6 * S for at in (2 * S, 50 * S)) for time in times)
    assert near > 0.75 * len(times)
    assert all(time >= 0 for time in times)


def test_half_of_the_flights_prefer_untried_pairs() -> None:
    worn = CampaignTally(SEEN.moments, {(kind.__name__, "landed"): 1_000 for kind in faults.KINDS.values()})
    tried = Counter(label for one in drawn(1_000, worn)[::2] for _, label in one.tries)
    even = Counter(label for one in drawn(1_000)[::2] for _, label in one.tries)
    assert tried["landed"] < 0.75 * even["landed"]
    assert set(even) == {"landed", "takeoff sent", ANYWHERE}


def test_excluded_kinds_are_not_drawn() -> None:
    wind = FaultSpace(SPACE.skills, SPACE.lasts_us, kinds=frozenset({faults.WindStep}))
    assert {type(each.fault) for one in drawn(50, space=wind) for each in one.scenario.incidents} == {faults.WindStep}
