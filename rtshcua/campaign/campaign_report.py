"""The report of a campaign: as JSON, and as one HTML page without scripts or external resources."""

from base64 import b64encode
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Annotated, Any, Final, NamedTuple

import msgspec
from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup

from rtshcua.campaign.rounds import CampaignResult, JudgeFinding
from rtshcua.model.faults import KINDS


class MarginUnit(NamedTuple):
    """A margin's title and displayed unit, and how many of its own units make one displayed unit."""

    title: str
    unit: str
    parts: int


#: by the names of `rtshcua.virtual.judge.Margins`
MARGINS: Final[Mapping[str, MarginUnit]] = {
    "fence_mm": MarginUnit("least distance to the airspace's edge, inside", "m", 1_000),
    "obstacle_mm": MarginUnit("least distance to an obstacle", "m", 1_000),
    "stop_us": MarginUnit("time from the cause of a fallback to its first frame", "s", 1_000_000),
    "takeover_us": MarginUnit("time from a takeover to the last motion frame", "s", 1_000_000),
    "ended_us": MarginUnit("time until the vehicle stopped moving after the end of the run", "s", 1_000_000),
}

#: the name of a fault kind in sources and `--fault`, by class name; the longer one if there are two
FAULTS: Final[Mapping[str, str]] = {
    kind.__name__: word for word, kind in sorted(KINDS.items(), key=lambda each: len(each[0]))
}


def margin_told(name: str, value: int) -> str:
    """Return a margin with its unit, to three digits."""
    told = MARGINS[name]
    return f"{value / told.parts:.3g} {told.unit}"


#: bars of a histogram
_BARS: Final = 24
#: a number of a report; a file with another one was not written by us
Whole = Annotated[int, msgspec.Meta(ge=-(1 << 53), le=1 << 53)]


class FindingSummary(msgspec.Struct, frozen=True):
    """All flights with the same failure: their count, and the lowest numbers."""

    slug: str
    flights: Whole
    first: tuple[Whole, ...]
    text: str
    incidents: tuple[str, ...]
    why: str = ""
    scenario: str = ""


class MarginSummary(msgspec.Struct, frozen=True):
    """One margin over all flights: least and greatest values with their flights, median and histogram.

    `name` ends in the unit (us, mm); `title` is displayed.
    """

    name: str
    title: str
    flights: Whole
    least: Whole
    least_in: Whole
    middle: Whole
    greatest: Whole
    greatest_in: Whole
    bars: tuple[Whole, ...]
    """The number of flights in each of equal intervals from the least to the greatest value."""


class CampaignSummary(msgspec.Struct, frozen=True):
    """The content of `report.json`. Times in us; `endings` by autopilot, `kinds` by kind of fault."""

    mission: str
    campaign: int
    flights: Whole
    failed: Whole
    flown_us: Whole
    took_us: Whole
    endings: dict[str, dict[str, Whole]]
    failures: tuple[FindingSummary, ...]
    exceptions: tuple[FindingSummary, ...]
    margins: tuple[MarginSummary, ...]
    kinds: dict[str, dict[str, Whole]]
    near: dict[str, dict[str, Whole]]
    """How often a kind of fault took place near a state change."""


def summarise(
    mission: str, campaign: int, results: Mapping[int, CampaignResult], scenarios: Mapping[str, str]
) -> CampaignSummary:
    """Summarise results by number; `scenarios` has the file of the smallest scenario of a failure, by slug."""
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
    """Return the summary as JSON values."""
    made: dict[str, Any] = msgspec.to_builtins(summary)
    return made


_HEIGHT: Final = 48
_WIDTH: Final = 10


def report_page(summary: CampaignSummary) -> str:
    """Return the HTML page; the same bytes for the same summary."""
    environment, style = _environment()
    labels = sorted({label for counts in summary.near.values() for label in counts})
    endings = sorted({ending for counts in summary.endings.values() for ending in counts})
    return environment.get_template("report.html").render(
        summary=summary,
        labels=labels,
        endings=endings,
        most=max((count for counts in summary.near.values() for count in counts.values()), default=1),
        style=Markup(style),
        style_digest=b64encode(sha256(style.encode()).digest()).decode("ascii"),
        bars=_bars,
        told=margin_told,
        hours=summary.flown_us / 3_600_000_000,
        width=_WIDTH,
        height=_HEIGHT,
    )


def _bars(counts: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return left edge, top and height of each bar."""
    most = max(counts, default=1) or 1
    heights = [0 if count == 0 else max(1, round(count * _HEIGHT / most)) for count in counts]
    return [(number * _WIDTH, _HEIGHT - height, height) for number, height in enumerate(heights)]


@cache
def _environment() -> tuple[Environment, str]:
    folder = files("rtshcua.campaign") / "templates"
    template = (folder / "report.html").read_text(encoding="utf-8")
    loader = DictLoader({"report.html": template})
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return environment, (folder / "report.css").read_text(encoding="utf-8")
