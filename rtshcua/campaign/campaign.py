"""A campaign, from round to round: what was seen in one tells the next where to look.

Flights of a round are drawn by what all rounds before it found, and by nothing else, so that a campaign is the same
however many workers fly it, in whatever order they come back, and wherever it was interrupted.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from rtshcua.campaign.drawing import Drawn, FaultSpace, draw
from rtshcua.campaign.flights import CampaignFlight, FlownMission
from rtshcua.campaign.results import CampaignResult, tally
from rtshcua.campaign.workers import FlightWorkers

#: flights of a round; the first is small, for it knows nothing of the mission
FIRST: Final = 20
ROUND: Final = 100


@dataclass(frozen=True, slots=True)
class CampaignOrder:
    """What is asked for: flights 0 to `flights` - 1 of the campaign of this seed."""

    seed: int
    flights: int
    space: FaultSpace


def rounds(flights: int) -> Iterator[range]:
    """The numbers of each round."""
    first = 0
    while first < flights:
        end = min(flights, first + (ROUND if first else FIRST))
        yield range(first, end)
        first = end


def drawn(order: CampaignOrder, number: int, past: Mapping[int, CampaignResult]) -> Drawn:
    """One flight, as the campaign draws it: `past` has all of the rounds before its own."""
    first = next(each for each in rounds(order.flights) if number in each)[0]
    return draw(order.seed, number, order.space, tally(past[n] for n in range(first)))


def fly_rounds(
    order: CampaignOrder,
    field: FlownMission,
    workers: FlightWorkers,
    past: dict[int, CampaignResult],
    keep: Callable[[CampaignResult], None],
) -> None:
    """Flies what `past` has not yet, and adds it to that; `keep` is called with each result as it comes."""
    for numbers in rounds(order.flights):
        left = [number for number in numbers if number not in past]
        if not left:
            continue
        known = tally(past[number] for number in range(numbers[0]))
        flights = []
        for number in left:
            made = draw(order.seed, number, order.space, known)
            flights.append(CampaignFlight(number, made.scenario, made.tries))
        for result in workers.fly(field, flights):
            past[result.number] = result
            keep(result)
