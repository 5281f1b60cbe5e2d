"""The handbook as one HTML page that needs nothing else: no script, no file, no network.

Everything that a source says is escaped where it enters the page (Jinja's autoescape); the policy of the page
(CSP level 3) then forbids whatever is not its own style, which it names by its digest.
"""

import re
from base64 import b64encode
from functools import cache
from hashlib import sha256
from importlib.resources import files

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup, escape

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.editor.keyword_help import REASONS
from rtshcua.ground.report.drawing.canvas import number
from rtshcua.ground.report.drawing.patterns import drawn
from rtshcua.ground.report.drawing.plan import mission_plan, plans
from rtshcua.ground.report.drawing.profile import profiles
from rtshcua.ground.report.glance import glance
from rtshcua.ground.report.glossary import GLOSSARY
from rtshcua.ground.report.model import Chapter, Handbook

_TEMPLATES = (
    "handbook.html",
    "glance.html",
    "chapter.html",
    "rights.html",
    "skills.html",
    "patterns.html",
    "sign.html",
    "map.svg",
    "profile.svg",
    "checked.html",
    "handbook.css",
)
#: what a reader does not see, or what turns around the text beside it: a comment or an intent may hold any of it
_HIDDEN = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]"
)
#: what fits at the foot of a page of A4: margins of 14 and 16 mm, letters of 6 pt that are 1.3 mm wide
FOOT_LINES, FOOT_COLUMNS = 4, 116
#: a number and its unit stay on one line
_UNIT = re.compile(r"(?<=\d) (?=(?:m/s|km/h|cm|mm|km|m|mV|V|%|s|ms|us|min|h|deg|N|S|E|W)\b|%)")


def page(handbook: Handbook) -> str:
    """The page; the same bytes for the same handbook."""
    environment, style = templates()
    style += _footer(handbook)
    text = environment.get_template("handbook.html").render(
        book=handbook,
        style=Markup(style),
        style_digest=b64encode(sha256(style.encode()).digest()).decode("ascii"),
        glossary=GLOSSARY,
        reasons=REASONS,
        anchor_of=_reason,
        glance=glance,
        plans=plans,
        mission_plan=mission_plan,
        profiles=profiles,
        pattern=drawn,
        anchors=_anchors,
        chunks=_chunks,
    )
    return visibly(text)


def visibly(text: str) -> str:
    """A page with what a reader would not see shown as what it is."""
    return _HIDDEN.sub(lambda found: escape(visible(found[0])), text)


def _footer(handbook: Handbook) -> str:
    """A rule of the style that puts what is signed at the foot of every printed page: on a line each name, version and
    whole digest. Where that does not fit, of each digest the first half, one after the other.

    A policy's name has letters, digits and `_` only, and so it may stand in a string of CSS.
    """
    lines = [f"{each.name} {each.version}: {each.digest}" for each in handbook.chapters]
    if len(lines) > FOOT_LINES or max(map(len, lines), default=0) > FOOT_COLUMNS:
        lines = [", ".join(f"{each.name} {each.version}: {each.digest[:32]}" for each in handbook.chapters)]
    signed = "\\a ".join(lines)
    return f'@page {{ @bottom-left {{ content: "{signed}"; font: 6pt monospace; white-space: pre-wrap; }} }}\n'


@cache
def templates() -> tuple[Environment, str]:
    """The templates, which take a while to compile, and the style of the page."""
    folder = files("rtshcua.ground.report") / "templates"
    texts = {name: (folder / name).read_text(encoding="utf-8") for name in _TEMPLATES}
    environment = Environment(
        loader=DictLoader(texts),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"told": _told, "px": number}
    return environment, texts["handbook.css"]


def _told(text: str, anchors: dict[str, str] | None = None) -> Markup:
    """A sentence: names become code, and lead to where they are explained."""
    parts = []
    for number_, part in enumerate(_UNIT.sub("\u00a0", text).split("`")):
        if number_ % 2 == 0:
            parts.append(escape(part))
            continue
        code = Markup("<code>{}</code>").format(part)
        anchor = (anchors or {}).get(part)
        parts.append(code if anchor is None else Markup('<a href="#{}">{}</a>').format(anchor, code))
    return Markup("").join(parts)


def _anchors(chapter: Chapter, number_: int) -> dict[str, str]:
    """Where the names of a chapter, and the reasons of decisions, are explained."""
    kinds = {
        "signal": [each.name for each in chapter.signals],
        "zone": [each.name for each in chapter.zones],
        "skill": [each.name for each in chapter.skills],
    }
    known = {name: f"p{number_}-{kind}-{at}" for kind, names in kinds.items() for at, name in enumerate(names)}
    return {reason: _reason(reason) for reason in REASONS} | known


def _reason(reason: str) -> str:
    """Where a reason is explained."""
    return f"reason-{reason.replace('/', '-')}"


def _chunks(digest: str) -> list[str]:
    """A digest in groups of eight, which a person can compare."""
    return [digest[at : at + 8] for at in range(0, len(digest), 8)]
