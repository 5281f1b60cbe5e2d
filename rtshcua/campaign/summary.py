"""What a campaign found, as one object for programs, and for the page that people read."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

import msgspec

from rtshcua.campaign.results import CampaignResult, JudgeFinding
from rtshcua.campaign.words import FAULTS, MARGINS

#: bars of a histogram
_BARS: Final = 24


class FindingSummary(msgspec.Struct, frozen=True):
    """All flights that the judge found the same fault in: how many, and those with the lowest numbers."""

    slug: str
    flights: int
    first: tuple[int, ...]
    text: str
    incidents: tuple[str, ...]
    why: str = ""
    scenario: str = ""


class MarginSummary(msgspec.Struct, frozen=True):
    """One of the judge's numbers over all flights: the least and the greatest, in which flight, and the spread.

    `name` ends in its unit (us, mm); `title` is for people.
    """

    name: str
    title: str
    flights: int
    least: int
    least_in: int
    middle: int
    greatest: int
    greatest_in: int
    bars: tuple[int, ...]
    """How many flights in each of as many equal parts from the least to the greatest."""


class CampaignSummary(msgspec.Struct, frozen=True):
    """What `report.json` holds. Times in us; `endings` by kind of autopilot, `kinds` by kind of fault as in sources."""

    mission: str
    campaign: int
    flights: int
    failed: int
    flown_us: int
    took_us: int
    endings: dict[str, dict[str, int]]
    failures: tuple[FindingSummary, ...]
    exceptions: tuple[FindingSummary, ...]
    margins: tuple[MarginSummary, ...]
    kinds: dict[str, dict[str, int]]
    near: dict[str, dict[str, int]]
    """How often a kind of fault was near a state change."""


def summarise(
    mission: str, campaign: int, results: Mapping[int, CampaignResult], scenarios: Mapping[str, str]
) -> CampaignSummary:
    """Of results by number; `scenarios` says in which file the shrunken flight of a failure is kept, by slug."""
    ordered = [results[number] for number in sorted(results)]
    endings: defaultdict[str, Counter[str]] = defaultdict(Counter)
    kinds: defaultdict[str, Counter[str]] = defaultdict(Counter)
    near: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for result in ordered:
        endings[result.flavour][result.ending] += 1
        for kind in sorted({kind for kind, _ in result.tries}):
            kinds[FAULTS[kind]][result.ending] += 1
            kinds[FAULTS[kind]]["failed"] += bool(result.failures)
        for kind, label in result.tries:
            near[FAULTS[kind]][label] += 1
    return CampaignSummary(
        mission,
        campaign,
        len(ordered),
        sum(bool(each.failures) for each in ordered),
        sum(each.flown_us for each in ordered),
        sum(each.took_us for each in ordered),
        _plain(endings),
        _found(ordered, lambda result: result.failures, scenarios),
        _found(ordered, lambda result: result.exceptions, {}),
        tuple(_margins(ordered)),
        _plain(kinds),
        _plain(near),
    )


def _plain(counted: Mapping[str, Counter[str]]) -> dict[str, dict[str, int]]:
    return {name: dict(sorted(counts.items())) for name, counts in sorted(counted.items())}


def _found(
    results: Sequence[CampaignResult],
    of: Callable[[CampaignResult], Iterable[JudgeFinding]],
    scenarios: Mapping[str, str],
) -> tuple[FindingSummary, ...]:
    found: dict[tuple[str, str], list[tuple[CampaignResult, JudgeFinding]]] = {}
    for result in results:
        for slug, why in {(each.slug, each.why) for each in of(result)}:
            one = next(each for each in of(result) if (each.slug, each.why) == (slug, why))
            found.setdefault((slug, why), []).append((result, one))
    return tuple(
        FindingSummary(
            slug,
            len(flights),
            tuple(result.number for result, _ in flights[:10]),
            flights[0][1].text,
            flights[0][0].incidents,
            why,
            scenarios.get(slug, ""),
        )
        for (slug, why), flights in sorted(found.items(), key=lambda each: (-len(each[1]), each[0]))
    )


def _margins(results: Sequence[CampaignResult]) -> Iterable[MarginSummary]:
    names = sorted({name for result in results for name in result.margins})
    for name in names:
        values = sorted((result.margins[name], result.number) for result in results if name in result.margins)
        (least, least_in), (greatest, greatest_in) = values[0], values[-1]
        bars = [0] * _BARS
        for value, _ in values:
            bars[min(_BARS - 1, (value - least) * _BARS // max(greatest - least, 1))] += 1
        middle = values[len(values) // 2][0]
        yield MarginSummary(
            name, MARGINS[name].title, len(values), least, least_in, middle, greatest, greatest_in, tuple(bars)
        )


def as_json(summary: CampaignSummary) -> dict[str, Any]:
    """For a program."""
    made: dict[str, Any] = msgspec.to_builtins(summary)
    return made
