"""A campaign's summary as one HTML page that needs nothing else: no script, no file, no network."""

from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Final

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup

from rtshcua.campaign.summary import CampaignSummary
from rtshcua.campaign.words import margin_told

_HEIGHT: Final = 48
_WIDTH: Final = 10


def report_page(summary: CampaignSummary) -> str:
    """The page; the same bytes for the same summary."""
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
    """Left edge, top and height of each bar."""
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
