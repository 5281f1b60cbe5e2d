"""Pictures: one self-contained SVG file of maps and side views, for browsers and for programs that draw (SVG 1.1).

No script, no other file, and no network. A browser in dark mode shows dark colours. Such programs know no variables of
CSS, and scale the width of a line with its matrix: colours are written out, and outlines are in pixels.
"""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from textwrap import wrap
from typing import Final, NamedTuple

from markupsafe import Markup

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.drawing.canvas import LETTER, WIDTH, LabelBox, hatching
from rtshcua.ground.drawing.height_profile import HeightProfile
from rtshcua.ground.drawing.html import OWN, templates, visibly
from rtshcua.ground.drawing.zone_map import DrawingKey, ZoneMap

#: px: a line of text, a row of the legend, the sample of an entry, and what is kept free at the sides
_LINE, _ROW, _SAMPLE, _EDGE, _TITLE = 17, 20, 28, 12, 34
#: letters in a line
_LETTERS: Final = int((WIDTH - 2 * _EDGE) / LETTER)
#: the most lines of the title of a sheet, and of the sentences at one place of it
_TITLES, _NOTES = 3, 40


class PictureSheet(NamedTuple):
    """A part of a picture: its title, sentences above and below, a map and a side view. Nothing is drawn if there is no
    map.
    """

    title: str
    above: tuple[str, ...] = ()
    plan: ZoneMap | None = None
    side: HeightProfile | None = None
    below: tuple[str, ...] = ()


class PlacedText(NamedTuple):
    """A line of text on the page; `y` is its baseline."""

    y: float
    text: str


class PlacedKey(NamedTuple):
    """An entry of the legend on the page: the left end and the middle of its sample."""

    x: float
    y: float
    key: DrawingKey
    hatch: str


class PlacedSheet(NamedTuple):
    """A sheet on the page."""

    y: float
    titles: tuple[PlacedText, ...]
    texts: tuple[PlacedText, ...]
    keys: tuple[PlacedKey, ...]
    plan: ZoneMap | None
    plan_y: float
    side: HeightProfile | None
    side_y: float


def picture(title: str, sheets: Sequence[PictureSheet]) -> str:
    """Write a picture of sheets, one below the other. The same sheets give the same bytes."""
    environment, _ = templates(OWN)
    placed: list[PlacedSheet] = []
    y = 0.0
    for sheet in sheets:
        one, y = _placed(sheet, y)
        placed.append(one)
    told = " ".join(text for sheet in sheets for text in (sheet.title + ".", *sheet.above))
    text = environment.get_template("picture.svg").render(
        title=title, description=told, style=Markup(drawing_style()), sheets=placed, width=WIDTH, height=round(y),
        edge=_EDGE,
    )  # fmt: skip
    return visibly(text)


def map_picture(plan: ZoneMap) -> str:
    """Write a map alone as a picture."""
    environment, _ = templates(OWN)
    template = environment.get_template("lone_map.svg")
    return visibly(template.render(plan=plan, id="map", standalone=True, style=Markup(drawing_style())))


def _placed(sheet: PictureSheet, begin: float) -> tuple[PlacedSheet, float]:
    """A sheet on the page, and its lower end."""
    texts: list[PlacedText] = []
    keys: list[PlacedKey] = []
    lines = _lines(sheet.title, 0.62)[:_TITLES]
    titles = [PlacedText(begin + _TITLE + number * 22, line) for number, line in enumerate(lines)]
    y = titles[-1].y + 8

    def told(sentences: Sequence[str]) -> None:
        nonlocal y
        lines = [line for sentence in sentences for line in _lines(sentence)]
        more = [f"and {len(lines) - _NOTES} more lines"] if len(lines) > _NOTES else []
        for line in (*lines[:_NOTES], *more):
            y += _LINE
            texts.append(PlacedText(y, line))

    def legend(entries: Sequence[DrawingKey]) -> None:
        nonlocal y
        x, y = float(_EDGE), y + _ROW
        for key in entries:
            width = _SAMPLE + 8 + LETTER * len(key.words) + 18
            if x > _EDGE and x + width > WIDTH - _EDGE:
                x, y = float(_EDGE), y + _ROW
            hatch = hatching(LabelBox(x, y - 6, _SAMPLE, 12), WIDTH, y + 6) if key.kind == "forbidden" else ""
            keys.append(PlacedKey(x, y, key, hatch))
            x += width
        y += _ROW / 2

    told(sheet.above)
    plan_y = y = y + 12
    if sheet.plan is not None:
        y += sheet.plan.height
        legend(sheet.plan.keys)
        told([f"All of this lies in {', '.join(sheet.plan.around)}."] if sheet.plan.around else [])
        told(_unlabelled(sheet.plan.unlabelled))
        y += 14
    side_y = y
    if sheet.side is not None:
        y += sheet.side.height
        legend(sheet.side.keys)
        told(_unlabelled(sheet.side.unlabelled))
    told(sheet.below)
    return PlacedSheet(begin, tuple(titles), tuple(texts), tuple(keys), sheet.plan, plan_y, sheet.side, side_y), y + 24


def _unlabelled(names: Sequence[str]) -> list[str]:
    return [f"Not labelled for want of room: {'; '.join(names)}."] if names else []


def _lines(text: str, share: float = 1.0) -> list[str]:
    """A sentence in lines of a share of the width."""
    return wrap(visible(" ".join(text.split())), int(_LETTERS * share)) or [""]


@cache
def drawing_style() -> str:
    """The style of drawings, with the values of its variables: those of a light page, and those of a dark one."""
    environment, _ = templates(OWN)
    assert environment.loader is not None
    page, rules = (environment.loader.get_source(environment, name)[0] for name in ("page.css", "drawing.css"))
    light, dark = (dict(re.findall(r"(--[\w-]+): ([^;]+);", block)) for block in _variables(page))

    def with_values(values: dict[str, str]) -> str:
        return re.sub(r"var\((--[\w-]+)\)", lambda found: values[found[1]], rules)

    coloured = "".join(_coloured(with_values(dark)))
    return f"{with_values(light)}@media (prefers-color-scheme: dark) {{\n{coloured}}}\n"


def _variables(page: str) -> tuple[str, str]:
    """The declarations of the variables of a light and of a dark page: the first two `:root` of the style."""
    light, dark = re.findall(r":root \{(.*?)\}", page, re.DOTALL)[:2]
    return light, dark


def _coloured(rules: str) -> Iterator[str]:
    """The declarations of rules that have a colour."""
    for selector, declared in re.findall(r"^(\S.*?) \{ (.*?) \}$", rules, re.MULTILINE):
        colours = re.findall(r"(?:fill|stroke): #\w+;", declared)
        if colours:
            yield f"{selector} {{ {' '.join(colours)} }}\n"
