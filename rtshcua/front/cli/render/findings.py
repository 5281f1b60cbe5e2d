"""Report the findings of commands that read sources, as text or as one JSON object."""

import json
import os
import sys
from collections.abc import Iterable, Mapping
from typing import Any

from rtshcua.app.exit_codes import code_of, is_unreadable
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic, folded
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.render import MOST_SHOWN, most_severe, render
from rtshcua.diagnostics.serialise import as_json
from rtshcua.diagnostics.span import Source
from rtshcua.front.cli.faults import error_object, fail, say, say_lines, say_rendered
from rtshcua.front.cli.stdout import out_json
from rtshcua.front.cli.width import columns, fitted

_BOLD, _RED, _YELLOW, _BLUE, _CYAN, _END = "\033[1m", "\033[1;31m", "\033[1;33m", "\033[1;34m", "\033[36m", "\033[0m"
_COLOURS = {"error": _RED, "warning": _YELLOW, "note": _CYAN}


class Findings:
    """Collects the findings of a command. With `json`, standard output contains only the JSON object."""

    def __init__(self, *, json: bool, deny_warnings: bool = False) -> None:
        self._json = json
        self._deny_warnings = deny_warnings
        self._found: tuple[Diagnostic, ...] = ()
        self._object: dict[str, Any] = as_json((), {})

    def report(self, diagnostics: Iterable[Diagnostic], sources: Mapping[str, Source]) -> bool:
        """Report findings; return whether they prevent the command from continuing."""
        self._found = found = tuple(diagnostics)
        if self._json:
            self._object = as_json(found, sources)
        elif found:
            found = folded(found)
            text = laid_out(render(most_severe(found), sources, columns()))
            say_rendered((_coloured(text) if _wants_colour() else text).rstrip("\n"))
            say_lines(f"\n{_count(found)}")
            if len(found) > MOST_SHOWN:
                say(f"the {len(found) - MOST_SHOWN:,} least severe are not shown; use `--json` for all")
        forbidding = {Severity.ERROR, Severity.WARNING} if self._deny_warnings else {Severity.ERROR}
        return any(each.severity in forbidding for each in found)

    def add(self, **members: Any) -> None:
        """Add members to the object of `json`, however the command ends."""
        self._object |= members

    def refuse(self, code: ExitCode, slug: str, message: str, help: str | None = None) -> ExitCode:
        """End with an error that is not about a source."""
        if not self._json:
            return fail(code, message, help, slug=slug)
        return self.finish(code, **_error(code, message, help, slug))

    def end(self, refusal: Refusal) -> ExitCode:
        """End with a refusal; its slug determines the exit code unless it has one."""
        slug, text, help, code = refusal
        return self.refuse(code or code_of(slug), slug, text, help)

    def finish(self, code: ExitCode, **result: Any) -> ExitCode:
        """Return the exit code; with `json`, print the object."""
        if self._json:
            told = self._object | ended(code, self._found) | result
            out_json(json.dumps(told, indent=2, ensure_ascii=False))
        return code


def ended(code: ExitCode, found: Iterable[Diagnostic]) -> dict[str, Any]:
    """Return the exit members of the JSON object; an unreadable file is also an error in the common form."""
    unread = next((each for each in found if is_unreadable(each)), None)
    error = {} if unread is None or code is not ExitCode.INPUT else _error(code, unread.message, unread.help)
    return {"exit": code.slug, "exit_code": int(code)} | error


def _error(code: ExitCode, text: str, help: str | None, slug: str | None = None) -> dict[str, Any]:
    """Return an error in the common form; `message` is the former name of `text`."""
    told: dict[str, Any] = error_object(code, text, help, slug=slug)
    told["error"]["message"] = text
    return told


def _count(found: tuple[Diagnostic, ...]) -> str:
    numbers = ((severity.value, sum(each.severity is severity for each in found)) for severity in Severity)
    parts = [f"{number} {word}{'s' * (number > 1)}" for word, number in numbers if number]
    first = next((each.code.id for each in found if each.severity is not Severity.NOTE), found[0].code.id)
    return f"{', '.join(parts)}; run `rtshcua explain {first}` for details"


def _wants_colour() -> bool:
    return sys.stderr is not None and sys.stderr.isatty() and not os.environ.get("NO_COLOR")


def laid_out(text: str) -> str:
    """Wrap a text at the terminal's width; excerpts of sources stay unchanged."""
    lines = text.split("\n")
    return "\n".join("\n".join([line] if " | " in line else fitted(line)) for line in lines)


def _coloured(text: str) -> str:
    return "\n".join(_line(line) for line in text.split("\n"))


def _line(line: str) -> str:
    """Colour one rendered line by its beginning, without changing its text."""
    head, bar, rest = line.partition(" | ")
    severity, bracket, _ = line.partition("[")
    if bracket and severity in _COLOURS:
        kind, _, message = line.partition(": ")
        return f"{_COLOURS[severity]}{kind}{_END}{_BOLD}: {message}{_END}"
    if bar and not head.strip() and set(rest.lstrip()[:1]) <= {"^", "-"}:
        return f"{_BLUE}{head}{bar}{_END}{_RED if '^' in rest else _BLUE}{rest}{_END}"
    if bar and (not head.strip() or head.strip().isdigit()):
        return f"{_BLUE}{head}{bar}{_END}{rest}"
    if line.lstrip().startswith(("= help:", "= at:")):
        return f"{_CYAN}{line}{_END}"
    return f"{_BLUE}{line}{_END}" if line.lstrip().startswith(("-->", ":::", "|", ":")) else line
