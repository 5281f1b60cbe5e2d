"""Findings as plain text: the message, the source line with the span underlined, and the help.

The text has no colours; a caller may colour lines by their beginning. Sources are untrusted: control characters and
characters that change the writing direction are shown by their number and never reach the terminal.
"""

from collections.abc import Iterable, Mapping, Sequence

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import MAX_WIDTH, Mark, excerpt, together, visible
from rtshcua.diagnostics.span import Source

PRIMARY, SECONDARY = "^", "-"
#: the most findings that are shown to a person, and the most places of one finding
MOST_SHOWN, MOST_PLACES = 200, 20
#: the most characters of a message, which may quote a source
MOST_TEXT = 2_000


def most_severe(diagnostics: Sequence[Diagnostic], most: int = MOST_SHOWN) -> tuple[Diagnostic, ...]:
    """Return at most `most` findings, in their order: errors before warnings before notes, then the earlier ones."""
    if len(diagnostics) <= most:
        return tuple(diagnostics)
    rank = {severity: number for number, severity in enumerate(Severity)}
    order = sorted(range(len(diagnostics)), key=lambda number: rank[diagnostics[number].severity])
    return tuple(diagnostics[number] for number in sorted(order[:most]))


def render(diagnostics: Iterable[Diagnostic], sources: Mapping[str, Source], width: int = MAX_WIDTH) -> str:
    """Render all findings, separated by empty lines. Source lines take at most `width` columns, with their numbers."""
    return "\n".join(render_one(diagnostic, sources, width) for diagnostic in diagnostics)


def render_one(diagnostic: Diagnostic, sources: Mapping[str, Source], width: int = MAX_WIDTH) -> str:
    """Render one finding, ending in a newline."""
    code = diagnostic.code
    lines = [f"{diagnostic.severity.value}[{code.id}]: {_shown(diagnostic.message)}"]
    places = _places(diagnostic, sources)
    further = sum(len(marks) for _, _, marks in places[MOST_PLACES:])
    places = places[:MOST_PLACES]
    gutter = max((len(str(line)) for _, line, _ in places), default=1)
    margin = " " * gutter
    room = width - gutter - len(" | ")
    shown: str | None = None
    for file, line, marks in places:
        source = sources[file]
        if file != shown:
            at = source.position(marks[0][0].start)
            arrow = "-->" if shown is None else ":::"
            lines.append(f"{margin}{arrow} {visible(file)}:{at.line}:{at.column}")
            lines.append(f"{margin} |")
        elif shown is not None:
            lines.append(f"{margin} :")
        shown = file
        for group in together(source, line, marks, room):
            text, underlines = excerpt(source, line, group, room)
            lines.append(f"{line:>{gutter}} | {text}".rstrip())
            lines += [f"{margin} | {underline}" for underline in underlines]
    if diagnostic.span is not None and not places:
        lines.append(f" --> {visible(diagnostic.span.file)}")
    lines += [f"{margin} = and {further} more places"] if further else []
    lines += [f"{margin} = at: {_shown(diagnostic.pointer)}"] if diagnostic.pointer else []
    lines += [f"{margin} = help: {_shown(diagnostic.help)}"] if diagnostic.help is not None else []
    return "\n".join(lines) + "\n"


def _shown(text: str) -> str:
    return visible(text if len(text) <= MOST_TEXT else f"{text[:MOST_TEXT]}...")


def _places(diagnostic: Diagnostic, sources: Mapping[str, Source]) -> list[tuple[str, int, list[Mark]]]:
    """The lines to show with their marks: first the line of the finding, then those of its labels, by file."""
    marks: list[Mark] = [] if diagnostic.span is None else [(diagnostic.span, PRIMARY, "")]
    marks += [(label.span, SECONDARY, label.text) for label in diagnostic.labels]
    by_line: dict[tuple[str, int], list[Mark]] = {}
    files: list[str] = []
    for mark in marks:
        file = mark[0].file
        if file in sources:
            line = sources[file].position(mark[0].start).line
            by_line.setdefault((file, line), []).append(mark)
            if file not in files:
                files.append(file)
    return [(file, line, found) for each in files for (file, line), found in by_line.items() if file == each]
