"""Search a redacted page for what should be gone, in everything that it has.

The page's own style and scripts are compared with those that ship, octet by octet; all other text is searched: what is
visible, attributes, comments, the data for its scripts, the embedded document, and a script that does not ship. Letters
count in either case, in every form of Unicode and percent-encoded, and `-`, `_`, `.` and spaces are the same.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from html.parser import HTMLParser
from importlib.abc import InspectLoader
from importlib.resources import files
from importlib.util import find_spec
from types import CodeType
from typing import Any, Final
from unicodedata import normalize
from urllib.parse import unquote

from rtshcua.evidence.note import octets
from rtshcua.ground.drawing import html
from rtshcua.ground.flight import embedding
from rtshcua.ground.flight.flight_content import FlightReport, as_plain
from rtshcua.ground.flight.flight_page import PACKAGE, script

#: digests and keys
HEX: Final = re.compile(r"\b[0-9a-f]{32,}\b")
#: a shorter name in ASCII is not searched for: it stands in other words, and in drawings
_LEAST: Final = 3
_SCRIPTS: Final = ("cursor.js", "growing.js", "tiles.js", "sort.js")
#: the modules whose sentences a page has
_TELLING: Final = (
    "rtshcua.app.flights.flight_view", "rtshcua.app.flights.decision_views", "rtshcua.app.flights.redaction",
    "rtshcua.app.flights.flight_summary", "rtshcua.app.flights.flight_timeline", "rtshcua.app.flights.telemetry_prose",
    "rtshcua.app.flights.collected_flight", "rtshcua.app.autopilot_bindings",
    "rtshcua.app.flights.flight_report", "rtshcua.app.telling.record_prose", "rtshcua.app.telling.prose",
    "rtshcua.app.wording", "rtshcua.model.step_number", "rtshcua.model.quantity", "rtshcua.evidence.report",
    "rtshcua.evidence.gaps", "rtshcua.evidence.attested", "rtshcua.ground.audit.audit", "rtshcua.app.sidecar_files",
    "rtshcua.app.verify_log", "rtshcua.ground.flight.flight_page", "rtshcua.ground.flight.logbook_page",
    "rtshcua.ground.drawing.flat_site", "rtshcua.ground.drawing.height_profile", "rtshcua.ground.drawing.time_charts",
    "rtshcua.ground.drawing.zone_map",
)  # fmt: skip
_DIGEST: Final = re.compile(r"'sha256-[A-Za-z0-9+/]{43}='")
_DECIMALS: Final = re.compile(r"-?\d{1,3}\.\d{4,}")
#: a digest is shown as so many groups
_GROUP, _GROUPS = re.compile(r"[0-9a-f]{8}"), 8
_WHOLE: Final = re.compile(r"-?\b\d{7,10}\b")
#: about a degree, in 1e-7 degree
_NEAR: Final = 10_000_000


def shape(text: str) -> str:
    """A text as it is compared: letters in one case and form, separators as one space."""
    return re.sub(r"[\s_.\-\u00ad\u200b]+", " ", normalize("NFKC", text).casefold()).strip()


def words_of(text: str) -> set[str]:
    """The words of a text, and the text, as they are compared."""
    return {shape(text), *shape(text).split(), *(shape(word) for word in re.findall(r"\w+", text))}


@cache
def ordinary_words() -> frozenset[str]:
    """The words that every page may have: of the templates, and of our sentences. A name that is one of these cannot be
    told from them.
    """
    found: set[str] = set()
    for package in (html.OWN, PACKAGE):
        for each in (files(package) / "templates").iterdir():
            if each.is_file():
                found |= words_of(each.read_text(encoding="utf-8"))
    for name in _TELLING:
        spec = find_spec(name)
        code = spec.loader.get_code(name) if spec is not None and isinstance(spec.loader, InspectLoader) else None
        for text in () if code is None else _constants(code):
            found |= words_of(text)
    return frozenset(found)


def _constants(code: CodeType) -> Iterator[str]:
    """The texts in a code, without what documents it: that comes first."""
    for number, each in enumerate(code.co_consts):
        if isinstance(each, CodeType):
            yield from _constants(each)
        elif isinstance(each, str) and number and "\n" not in each:
            yield each
        elif isinstance(each, tuple | frozenset):
            yield from (text for text in each if isinstance(text, str))


class _Reader(HTMLParser):
    """Splits a page into texts, and the elements whose content is none."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.texts: list[str] = []
        self.attributes: list[str] = []
        #: style and scripts: the tag, the type, the id, the content
        self.raw: list[tuple[str, str, str, str]] = []
        self._open: tuple[str, str, str] | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [each for name, value in attrs for each in (name, value or "")]
        if tag in ("script", "style"):
            of = dict(attrs)
            self._open = tag, of.get("type") or "", of.get("id") or ""
            self.raw.append((*self._open, ""))

    def handle_endtag(self, tag: str) -> None:
        if tag in ("script", "style"):
            self._open = None

    def handle_data(self, data: str) -> None:
        if self._open is None:
            self.texts.append(data)
        else:
            self.raw[-1] = (*self._open, self.raw[-1][3] + data)

    def handle_comment(self, data: str) -> None:
        self.texts.append(data)

    def handle_decl(self, decl: str) -> None:
        self.texts.append(decl)

    def handle_pi(self, data: str) -> None:
        self.texts.append(data)

    def unknown_decl(self, data: str) -> None:
        self.texts.append(data)


def _without_digests(texts: Sequence[str]) -> Iterator[str]:
    """The texts without digests that are shown in groups: one of these may consist of decimal digits alone."""
    shown = [text for text in texts if text.strip()]
    groups = "".join("x" if _GROUP.fullmatch(text.strip()) else "." for text in shown)
    for run in re.finditer(r"x+|\.+", groups):
        if len(run[0]) != _GROUPS:
            yield from shown[run.start() : run.end()]


class LeftOver:
    """Searches for names, except those that are ordinary words or that the report `said` in a field of a closed list;
    and, near `home` (1e-7 degree), for places. `may_stay` is that of the lines of the embedded log.
    """

    def __init__(
        self, names: Sequence[str], said: set[str], may_stay: Callable[[bytes], bool], home: tuple[int, int] | None
    ) -> None:
        self._named = {shape(name): name for name in names}
        fit = {each for each in self._named if (len(each) >= _LEAST or not each.isascii()) and not each.isdecimal()}
        ordered = sorted(fit - ordinary_words() - said, key=len, reverse=True)
        self._pattern = (
            re.compile("|".join(rf"(?<![^\W_]){re.escape(each)}(?![^\W_])" for each in ordered)) if ordered else None
        )
        self._names, self._may_stay, self._home = bool(names), may_stay, home
        self._style = html.templates(PACKAGE)[1]

    def in_page(self, page: str) -> str | None:
        """The first thing that should be gone; None if there is none."""
        return next(self._in_page(page), None)

    def in_report(self, report: FlightReport) -> str | None:
        """The first thing in the texts of a report that should be gone. The digest of the whole log stays."""
        texts = _texts(as_plain(report._replace(log="", root="")))
        return next((found for text in texts for found in (*self._in_text(text), *self._in_places(text))), None)

    def _in_page(self, page: str) -> Iterator[str]:
        reader = _Reader()
        reader.feed(page)
        reader.close()
        for text in reader.texts:
            yield from self._in_text(text)
        for text in _without_digests(reader.texts):
            yield from self._in_places(text)
        for text in reader.attributes:
            yield from self._in_text(_DIGEST.sub("", text))
            if self._home is not None:  # numbers of drawings have two decimals at most
                yield from (found[0] for found in _DECIMALS.finditer(text))
        for tag, of, name, content in reader.raw:
            if name == "flight-data":
                yield from self._in_data(content)
            elif of == "application/gzip+base64":
                yield from self._in_document(content)
            elif not self._ships(tag, content):
                yield from self._in_text(content)
                yield from self._in_places(content)

    def _ships(self, tag: str, content: str) -> bool:
        if tag == "style":
            return content == self._style
        return content == html.visibly(embedding.script()) or any(
            content == html.visibly(script(each)) for each in _SCRIPTS
        )

    def _in_text(self, text: str) -> Iterator[str]:
        forms = dict.fromkeys((shape(text), shape(unquote(text))))
        if self._pattern is not None:
            yield from (self._named[found[0]] for form in forms for found in self._pattern.finditer(form))
        if self._names:
            yield from (found[0] for found in HEX.finditer(text))

    def _in_places(self, text: str) -> Iterator[str]:
        if self._home is None:
            return
        yield from (found[0] for found in _DECIMALS.finditer(text))
        for found in _WHOLE.finditer(text):
            if any(abs(int(found[0]) - each) < _NEAR for each in self._home):
                yield found[0]

    def _in_data(self, content: str) -> Iterator[str]:
        """What is left in the data for the cursor. Its numbers are differences: the lists of places must be empty."""
        data = json.loads(content)
        for text in _texts(data):
            yield from self._in_text(text)
            yield from self._in_places(text)
        if self._home is not None:
            track = data.get("track") or {}
            places = {**{key: track.get(key) for key in ("x", "y")}, **{key: data.get(key) for key in ("map", "home")}}
            yield from (f"{key} in the data of the page" for key, value in places.items() if value)
        known = {"from", "to", "home", "track", "map", "signals"}
        yield from (f"{key} in the data of the page" for key in data if key not in known)

    def _in_document(self, content: str) -> Iterator[str]:
        """What is left in the embedded log: lines that may stay, and digests."""
        document = json.loads(embedding.extract(content))
        for leaf in (*document.pop("leaves"), document.pop("root")):
            if len(octets(leaf) or b"") != 32:
                yield leaf
        for _, line in document.pop("lines"):
            if not self._may_stay(line.encode() + b"\n"):
                yield line
            for text in _texts(json.loads(line)):
                yield from () if HEX.fullmatch(text) else self._in_text(text)
        for _, note in document.pop("checkpoints"):
            if self._names:
                yield note
        for text in _texts(document):
            yield from self._in_text(text)
            yield from self._in_places(text)


def _texts(value: Any) -> Iterator[str]:
    """All texts of a JSON value, keys too."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, each in value.items():
            yield key
            yield from _texts(each)
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each)
