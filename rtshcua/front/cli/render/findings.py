"""How commands that read sources report: findings for a person, or one JSON object for a machine."""

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
    """Collects what a command has to say. With `json` nothing else is on the standard output."""

    def __init__(self, *, json: bool, deny_warnings: bool = False) -> None:
        self._json = json
        self._deny_warnings = deny_warnings
        self._found: tuple[Diagnostic, ...] = ()
        self._object: dict[str, Any] = as_json((), {})

    def report(self, diagnostics: Iterable[Diagnostic], sources: Mapping[str, Source]) -> bool:
        """Report findings; true when they forbid going on."""
        self._found = found = tuple(diagnostics)
        if self._json:
            self._object = as_json(found, sources)
        elif found:
            found = folded(found)
            text = laid_out(render(most_severe(found), sources, columns()))
            say_rendered((_coloured(text) if _wants_colour() else text).rstrip("\n"))
            say_lines(f"\n{_count(found)}")
            if len(found) > MOST_SHOWN:
                say(f"{len(found) - MOST_SHOWN:,} of them are not shown, the least severe: `--json` has all")
        forbidding = {Severity.ERROR, Severity.WARNING} if self._deny_warnings else {Severity.ERROR}
        return any(each.severity in forbidding for each in found)

    def refuse(self, code: ExitCode, slug: str, message: str, help: str | None = None) -> ExitCode:
        """End with a refusal that is about no source."""
        if not self._json:
            return fail(code, message, help, slug=slug)
        return self.finish(code, **_error(code, message, help, slug))

    def end(self, refusal: Refusal) -> ExitCode:
        """`refuse` for a value, whose slug says the exit code."""
        slug, text, help, code = refusal
        return self.refuse(code or code_of(slug), slug, text, help)

    def finish(self, code: ExitCode, **result: Any) -> ExitCode:
        """End; with `json`, print everything."""
        if self._json:
            told = self._object | ended(code, self._found) | result
            out_json(json.dumps(told, indent=2, ensure_ascii=False))
        return code


def ended(code: ExitCode, found: Iterable[Diagnostic]) -> dict[str, Any]:
    """How a command that reports findings ended; a file that cannot be read is an error in the one form, too."""
    unread = next((each for each in found if is_unreadable(each)), None)
    error = {} if unread is None or code is not ExitCode.INPUT else _error(code, unread.message, unread.help)
    return {"exit": code.slug, "exit_code": int(code)} | error


def _error(code: ExitCode, text: str, help: str | None, slug: str | None = None) -> dict[str, Any]:
    """An error in the one form of errors; `message` is what its text was called first."""
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
    """What is said, in lines of a terminal; lines of a source stay as they are cut."""
    lines = text.split("\n")
    return "\n".join("\n".join([line] if " | " in line else fitted(line)) for line in lines)


def _coloured(text: str) -> str:
    return "\n".join(_line(line) for line in text.split("\n"))


def _line(line: str) -> str:
    """Colour one rendered line by how it begins; the text itself stays as it is."""
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
