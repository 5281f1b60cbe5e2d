"""Renders a policy report as one self-contained HTML page: no script, no other file, no network."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import hypot
from typing import Final, NamedTuple

from markupsafe import Markup

from rtshcua.ground.drawing.canvas import number
from rtshcua.ground.drawing.height_profile import planned_heights
from rtshcua.ground.drawing.html import rendered, templates, visibly
from rtshcua.ground.drawing.picture import drawing_style
from rtshcua.ground.drawing.profile import profiles
from rtshcua.ground.drawing.zone_map import mission_map, zone_maps
from rtshcua.ground.editor.keyword_help import REASONS
from rtshcua.ground.geometry.inspection import CentreLine
from rtshcua.ground.geometry.polygons import Ring
from rtshcua.ground.geometry.shapes import polygonal
from rtshcua.ground.geometry.survey import NO_AIM, PathAim, survey
from rtshcua.ground.report.glance import glance
from rtshcua.ground.report.report_model import Chapter, PolicyReport

#: where the templates are
PACKAGE: Final = "rtshcua.ground.report"


class GlossaryEntry(NamedTuple):
    """A term and its meaning."""

    word: str
    meaning: str


GLOSSARY: Final = (
    GlossaryEntry("above home", "Height over the place where the vehicle starts, not over the ground below it."),
    GlossaryEntry(
        "agent",
        "A program that proposes missions. It can request what it is permitted, and cannot command the vehicle.",
    ),
    GlossaryEntry("airspace", "Where the vehicle may be, whatever is requested."),
    GlossaryEntry(
        "charge", "How full the battery is. Each skill has an upper bound for its charge, which the checks use."
    ),
    GlossaryEntry("contingency", "What flies when a step is denied while the vehicle is in the air."),
    GlossaryEntry(
        "digest",
        "A number computed from everything that is signed. If a single letter changes, the digest changes, so two "
        "documents with the same digest have the same content.",
    ),
    GlossaryEntry(
        "fallback", "What flies when a step that was allowed cannot go on: the chain of its skill, in order."
    ),
    GlossaryEntry("forbid", "A rule that denies. It outweighs every permit."),
    GlossaryEntry(
        "mission", "An ordered list of steps, proposed for a role, and checked against the policy before it flies."
    ),
    GlossaryEntry("permit", "A rule that allows. What no permit allows is denied."),
    GlossaryEntry("phase", "A named part of a mission, such as departure."),
    GlossaryEntry(
        "policy", "The rules of one vehicle: who may request what, where and when. Its version only increases."
    ),
    GlossaryEntry("role", "The role on whose behalf a step is requested, such as operator or supervisor."),
    GlossaryEntry("signal", "Something that the vehicle reports about itself or its surroundings."),
    GlossaryEntry("skill", "Something that the vehicle can do, with its limits. Nothing else can be requested."),
    GlossaryEntry(
        "source", "Who makes a request for a role: a person at the controls, an agent, software on board, a reflex."
    ),
    GlossaryEntry(
        "unknown",
        "A signal that was never received, is too old, or reports that its value is not known. An unknown signal never "
        "permits anything: a permit that needs it does not hold, a prohibition that needs it makes the step wait, an "
        "approval that depends on it is required, and a rule that would fly something else makes the step wait.",
    ),
    GlossaryEntry(
        "zone", "An area on the ground with, perhaps, a floor, a ceiling and times. Its border does not belong to it."
    ),
)


#: the size of the footer on A4: margins of 14 and 16 mm, letters of 6 pt, 1.3 mm wide
FOOT_LINES, FOOT_COLUMNS = 4, 116


def page(report: PolicyReport) -> str:
    """Render a report. The same report gives the same bytes."""
    return rendered(
        PACKAGE,
        "policy_report.html",
        _footer(report),
        book=report,
        glossary=GLOSSARY,
        reasons=REASONS,
        anchor_of=_reason,
        glance=glance,
        plans=zone_maps,
        mission_plan=mission_map,
        mission_side=planned_heights,
        profiles=profiles,
        pattern=pattern,
        anchors=_anchors,
        chunks=_chunks,
    )


def _footer(report: PolicyReport) -> str:
    """The style of the footer of printed pages: a line for each policy with name, version and full digest, or if that
    does not fit, all on one line with the first half of each digest.

    The name of a policy has only letters, digits and `_`, so it is safe in a CSS string.
    """
    lines = [f"{each.name} {each.version}: {each.digest}" for each in report.chapters]
    if len(lines) > FOOT_LINES or max(map(len, lines), default=0) > FOOT_COLUMNS:
        lines = [", ".join(f"{each.name} {each.version}: {each.digest[:32]}" for each in report.chapters)]
    signed = "\\a ".join(lines)
    return f'@page {{ @bottom-left {{ content: "{signed}"; font: 6pt monospace; white-space: pre-wrap; }} }}\n'


def _anchors(chapter: Chapter, number_: int) -> dict[str, str]:
    """The anchors of the names of a chapter and of the reasons of decisions."""
    kinds = {
        "signal": [each.name for each in chapter.signals],
        "zone": [each.name for each in chapter.zones],
        "skill": [each.name for each in chapter.skills],
    }
    known = {name: f"p{number_}-{kind}-{at}" for kind, names in kinds.items() for at, name in enumerate(names)}
    return {reason: _reason(reason) for reason in REASONS} | known


def _reason(reason: str) -> str:
    """The anchor of a reason."""
    return f"reason-{reason.replace('/', '-')}"


def _chunks(digest: str) -> list[str]:
    """A digest in groups of eight characters, which are easy to compare."""
    return [digest[at : at + 8] for at in range(0, len(digest), 8)]


class PatternSample(NamedTuple):
    """A sample area for the drawing of a pattern, in mm, its holes, and what the pattern aims at."""

    area: Ring
    structure: Ring = ()
    aim: PathAim = NO_AIM


#: the sample areas, counter-clockwise; the altitude and the distance to their edge; the entry
_HOUSE: Final = ((0, 0), (120_000, 0), (150_000, 55_000), (120_000, 90_000), (0, 90_000))
_YARD: Final = ((0, 0), (150_000, 0), (150_000, 90_000), (0, 90_000))
_TOWER: Final = ((69_000, 39_000), (69_000, 51_000), (81_000, 51_000), (81_000, 39_000))
_ROAD: Final = ((0, 1_000), (83_000, 1_000), (164_000, 61_000), (136_000, 99_000), (67_000, 49_000), (0, 49_000))
_WALL: Final = ((0, 20_000), (150_000, 20_000), (150_000, 80_000), (0, 80_000))
_SAMPLES: Final = {
    "corridor": PatternSample(
        _ROAD, aim=PathAim(CentreLine(((0, 25_000), (75_000, 25_000), (150_000, 80_000)), 24_000))
    ),
    "face": PatternSample(_WALL, aim=PathAim(CentreLine(((4_000, 50_000), (146_000, 50_000)), 30_000), 18_000)),
    "around": PatternSample(_YARD, _TOWER, PathAim(None, 22_000)),
}
_HEIGHT, _INSET, _ENTRY = 20_000, 3_000, (5_000, 5_000)
#: px
_WIDTH, _TALL, _MARGIN, _ARROW = 320, 208, 14, 7.0


@dataclass(frozen=True, slots=True)
class Pattern:
    """A drawing: the outline of the area, of a structure or the line in it and of the path as points, the path's begin,
    and arrows as SVG paths.
    """

    width: int
    height: int
    area: str
    structure: str
    way: str
    start: tuple[float, float]
    arrows: tuple[str, ...]


@cache
def pattern(name: str) -> Pattern:
    """Draw a survey pattern, by its name, over a sample area with the real planner."""
    sample = _SAMPLES.get(name, PatternSample(_HOUSE))
    shape = polygonal((sample.area, sample.structure) if sample.structure else (sample.area,))
    way = survey(shape, name, _HEIGHT, _INSET, _ENTRY, sample.aim)
    assert way is not None
    scale = (_WIDTH - 2 * _MARGIN) / max(x for x, _ in sample.area)

    def at(x: int, y: int) -> tuple[float, float]:
        return _MARGIN + x * scale, _TALL - _MARGIN - y * scale

    points = [at(*each) for each in way]
    legs = list(pairwise(points))
    shown = legs[:: max(1, len(legs) // 5)]
    line = () if sample.aim.line is None else sample.aim.line.points
    closed = (*sample.structure, *sample.structure[:1])
    return Pattern(
        _WIDTH,
        _TALL,
        _outline([at(*each) for each in sample.area]),
        _outline([at(*each) for each in closed or line]),
        _outline(points),
        points[0],
        tuple(_arrow(*leg) for leg in shown),
    )


def pattern_picture(name: str) -> str:
    """Draw a survey pattern as an SVG file of its own."""
    environment, _ = templates(PACKAGE)
    style = Markup("".join(line + "\n" for line in drawing_style().splitlines() if _drawn(line)))
    return visibly(environment.get_template("pattern.svg").render(name=name, figure=pattern(name), style=style))


def _drawn(rule: str) -> bool:
    """Whether a line of the style concerns the drawing of a pattern."""
    return rule.startswith((".sheet ", ".zone ", ".zone.derived", ".way ", ".arrow", ".stop ", "@media", "}"))


def _outline(points: list[tuple[float, float]]) -> str:
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    """An arrow head in the middle of a leg, as an SVG path."""
    along = hypot(end[0] - start[0], end[1] - start[1])
    dx, dy = (end[0] - start[0]) / along * _ARROW, (end[1] - start[1]) / along * _ARROW
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    tip, left, right = (x + dx, y + dy), (x - dx - dy / 2, y - dy + dx / 2), (x - dx + dy / 2, y - dy - dx / 2)
    return "M" + "L".join(f"{number(px)} {number(py)}" for px, py in (tip, left, right)) + "Z"
