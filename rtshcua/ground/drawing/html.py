"""Renders pages: one self-contained HTML file each, without another file and without network.

All texts of sources are escaped (Jinja's autoescape). A page's Content Security Policy (level 3) also forbids every
style and script except its own, which it names by digest.
"""

import re
from base64 import b64encode
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Final

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup, escape

from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.drawing.canvas import number

#: invisible and reordering characters, which a comment or an intent may contain
_HIDDEN = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ufffe\uffff]"
)
#: the package of the common templates and the common style
OWN: Final = "rtshcua.ground.drawing"
#: the space between a number and its unit, where a line must not break
_UNIT = re.compile(r"(?<=\d) (?=(?:m/s|km/h|cm|mm|km|m|mV|V|%|s|ms|us|min|h|deg|N|S|E|W)\b|%)")


def rendered(package: str, template: str, more_style: str = "", **values: object) -> str:
    """Render a template with values, the common style and an additional one. The template is in the folder `templates`
    of the package, and may include the common ones.
    """
    environment, style = templates(package)
    style += more_style
    digest = b64encode(sha256(style.encode()).digest()).decode("ascii")
    text = environment.get_template(template).render(style=Markup(style), style_digest=digest, **values)
    return visibly(text)


def visibly(text: str) -> str:
    """Replace invisible characters of a page by visible descriptions."""
    return _HIDDEN.sub(lambda found: escape(visible(found[0])), text)


@cache
def templates(package: str) -> tuple[Environment, str]:
    """The compiled templates, and the style of the page, which is followed by that of a package with its own."""
    texts = {
        each.name: each.read_text(encoding="utf-8")
        for name in (OWN, package)
        for each in sorted((files(name) / "templates").iterdir(), key=lambda file: file.name)
        if each.is_file()
    }
    styles = [text for name, text in texts.items() if name.endswith(".css")]
    environment = Environment(
        loader=DictLoader(texts),
        autoescape=True,
        optimized=False,  # most templates are rendered once: optimising takes longer than it saves
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"told": _told, "px": number}
    return environment, "".join(styles)


def _told(text: str, anchors: dict[str, str] | None = None) -> Markup:
    """Convert a sentence to HTML: names become code, with links to their explanations."""
    text = _UNIT.sub("\u00a0", text)
    if "`" not in text:
        return escape(text)
    parts = []
    for number_, part in enumerate(text.split("`")):
        if number_ % 2 == 0:
            parts.append(escape(part))
            continue
        code = Markup("<code>{}</code>").format(part)
        anchor = (anchors or {}).get(part)
        parts.append(code if anchor is None else Markup('<a href="#{}">{}</a>').format(anchor, code))
    return Markup("").join(parts)
