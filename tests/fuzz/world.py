"""Shared parts of the fuzz targets: a library in memory, and the checks of every finding."""

import json
import posixpath
from collections.abc import Callable, Iterable, Mapping
from errno import ENOENT
from functools import cache
from pathlib import Path

from rtshcua.diagnostics.codes import REFUSED_ON_BOARD
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.serialise import as_json
from rtshcua.diagnostics.span import Source, Span

CHECKOUT = Path(__file__).resolve().parents[2]
LIBRARY = "lib"
#: the name of the source under test
PROBE = "probe/probe.rts"
ISSUED = 1_790_000_000_000_000  # us, UTC

Read = Callable[[str], bytes]


@cache
def files() -> dict[str, bytes]:
    """Every file that a source may import: the shipped library, and the files beside the accepted sources."""
    found = {
        f"{LIBRARY}/{folder}/{path.name}": path.read_bytes()
        for folder in ("skills", "policies", "missions")
        for path in sorted((CHECKOUT / folder).glob("*.rts"))
    }
    for path in sorted((CHECKOUT / "tests" / "accepted" / "parts").iterdir()):
        found[f"probe/parts/{path.name}"] = path.read_bytes()
    for path in sorted((CHECKOUT / "tests" / "specifications" / "valid").glob("*.geojson")):
        found[f"probe/{path.name}"] = path.read_bytes()
    return found


def reading(more: Mapping[str, bytes]) -> Read:
    """Read from memory: these files, and those of `files`."""

    def read(path: str) -> bytes:
        data = more.get(path, files().get(path))
        if data is None:
            raise FileNotFoundError(ENOENT, "No such file or directory", path)
        return data

    return read


def listing(folder: str) -> Iterable[str]:
    """The names in a folder in memory."""
    return [posixpath.basename(path) for path in files() if posixpath.dirname(path) == folder]


def hold(diagnostics: Iterable[Diagnostic], sources: Mapping[str, Source]) -> None:
    """Check that every finding has a message, points into its source, and can be shown as text and JSON."""
    found = tuple(diagnostics)
    for each in found:
        assert each.message, each
        assert each.code is not REFUSED_ON_BOARD, each
        places = [label.span for label in each.labels] + [fix.span for fix in each.fixes]
        for span in places if each.span is None else [each.span, *places]:
            _within(span, sources)
        assert render([each], sources).encode(), each
    shown = render(found, sources)
    assert shown.replace("\n", "").isprintable(), shown
    assert json.loads(json.dumps(as_json(found, sources), ensure_ascii=False).encode())["format"]


def _within(span: Span, sources: Mapping[str, Source]) -> None:
    source = sources.get(span.file)
    assert source is not None, f"no source is called `{span.file}`"
    assert 0 <= span.start <= span.end <= len(source.text), f"{span} of {len(source.text)}"
