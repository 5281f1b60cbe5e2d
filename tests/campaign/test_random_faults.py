"""Flights of the simulated autopilots with random faults, as a campaign draws them: the judge, which looks at the true
state and shares no code with the runtime, finds no failure, and the log verifies.
"""

import pytest

from campaign.flying import flight_of, right, space
from rtshcua.campaign.drawing import CampaignTally

#: a seed of its own: not one of the flights that tests and pages tell of
SEED = 90_210
SAMPLE, SOAK = 3, 200


def failures(number: int) -> list[str]:
    """The failures of one flight of the campaign."""
    flight = flight_of(SEED, number, space(), CampaignTally())
    return [f"flight {number}: {each.slug}, {each.text}" for each in right(flight).result.failures]


@pytest.mark.claim("T2", drawn="by a campaign")
@pytest.mark.claim("T3", drawn="by a campaign")
@pytest.mark.slow
def test_some_flights_with_random_faults_do_not_fail() -> None:
    assert [each for number in range(SAMPLE) for each in failures(number)] == []


@pytest.mark.claim("T2", drawn="by a campaign")
@pytest.mark.claim("T3", drawn="by a campaign")
@pytest.mark.soak
@pytest.mark.parametrize("first", range(0, SOAK, 20))
def test_many_flights_with_random_faults_do_not_fail(first: int) -> None:
    assert [each for number in range(first, first + 20) for each in failures(number)] == []
