"""`--set height="20 m"`: values for a mission's parameters, given when it is compiled.

They are read by the language's own parser, and findings underline them: the options are a source of their own, one a
line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.agent_values import parse_value
from rtshcua.model.ir.expression import Value
from rtshcua.model.ir.node import Name

#: what the options are called in a finding
FILE = "--set"


@dataclass(frozen=True, slots=True)
class Settings:
    """The values by name, the text that they were read from, and what was wrong with it."""

    source: Source = Source(FILE, "")
    values: tuple[tuple[Name, Value], ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


def parse_settings(options: Sequence[str]) -> Settings:
    """Options as they are given, `name=value` each."""
    texts = [" ".join(option.split()) for option in options]
    values: dict[str, tuple[Name, Value]] = {}
    found: list[Diagnostic] = []
    start = 0
    for text in texts:
        name, separator, written = text.partition("=")
        here = Name(span=Span(FILE, start, start + len(name.rstrip())), text=name.strip())
        at = start + len(name) + 1
        place = Span(FILE, at, start + len(text))
        start += len(text) + 1
        if not separator or not here.text or not written.strip():
            whole = Span(FILE, here.span.start, place.end)
            message = f"`{text}` gives no value to a parameter"
            found.append(Diagnostic(codes.SYNTAX, message, whole, 'write a name and a value, as in `height="20 m"`'))
            continue
        value, wrong = parse_value(written, place, at.__add__)
        found += wrong
        first = values.get(here.text)
        if first is not None:
            message = f"`{here.text}` is given twice"
            label = Label(first[0].span, "first given here")
            found.append(Diagnostic(codes.DUPLICATE_ARGUMENT, message, here.span, labels=(label,)))
        elif value is not None:
            values[here.text] = (here, value)
    return Settings(Source(FILE, "\n".join(texts)), tuple(values.values()), tuple(found))
