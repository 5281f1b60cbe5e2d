"""Reads the configuration of a project, `rtshcua.toml` or `[tool.rtshcua]` of `pyproject.toml`, as `ProjectSettings`.

Reading is strict: an unknown key, a value of the wrong type and an ignore without a reason are refused, with the
nearest accepted value. `docs/linting.md` lists all keys.
"""

import tomllib
from dataclasses import dataclass
from typing import Literal

from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.project.strict_tables import SettingError, SettingsTable

#: the file names of a configuration; the first one that exists in a folder is used
OWN, SHARED = "rtshcua.toml", "pyproject.toml"
NAMES = (OWN, SHARED)

FailOn = Literal["error", "warning", "note", "never"]
LEVELS: tuple[FailOn, ...] = ("error", "warning", "note", "never")
WIDTH, NARROWEST, WIDEST = 120, 40, 400


@dataclass(frozen=True, slots=True)
class IgnoredCode:
    """An ignored code with its reason. `pattern` limits it to some files; None means all files."""

    code: Code
    reason: str
    pattern: str | None = None


@dataclass(frozen=True, slots=True)
class LintSettings:
    """`[lint]`: ignored codes, excluded files, the lowest level that fails a run, further sources, whether to cache
    results, and whether to check the format.
    """

    ignored: tuple[IgnoredCode, ...] = ()
    exclude: tuple[str, ...] = ()
    fail_on: FailOn = "warning"
    further: tuple[str, ...] = ()
    cache: bool = True
    format: bool = False


@dataclass(frozen=True, slots=True)
class FormatSettings:
    """`[format]`: the line width in characters, and the excluded files."""

    width: int = WIDTH
    exclude: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TestSettings:
    """`[test]`: the least coverage in per cent (None: no minimum), and the excluded files."""

    __test__ = False  # for pytest

    fail_under: int | None = None
    exclude: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ProjectSettings:
    """A whole configuration. Its paths and patterns are relative to its folder."""

    lint: LintSettings = LintSettings()
    format: FormatSettings = FormatSettings()
    test: TestSettings = TestSettings()


#: the most parts of a dotted key; ours have three
_MOST_PARTS = 64


def misconfigured(file: str, what: str, help: str = "", line: int | None = None) -> Refusal:
    """Return the refusal of a configuration: `what` is wrong in `file`, at `line` (from 1) if known."""
    return Refusal("configuration", f"{file}{'' if line is None else f':{line}'}: {what}", help)


def parse_settings(text: str, file: str, *, shared: bool = False) -> ProjectSettings | Refusal | None:
    """Return the settings in the configuration `file`. `shared` means a `pyproject.toml`; None if it has no table of
    ours.
    """
    if _longest_key(text) > _MOST_PARTS:
        return misconfigured(file, f"a key has more than {_MOST_PARTS} parts")
    try:
        found = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return _not_toml(file, str(error))
    except RecursionError:
        return misconfigured(file, "the configuration is nested too deeply")
    prefix = ""
    if shared:
        tool = found.get("tool")
        if not isinstance(tool, dict) or "rtshcua" not in tool:
            return None
        found, prefix = tool["rtshcua"], "tool.rtshcua"
    try:
        return _settings(SettingsTable.of(found, prefix))
    except SettingError as error:
        return misconfigured(file, error.message, error.help, _line(text, error.key))


def _longest_key(text: str) -> int:
    """The number of parts of the longest text that looks like a dotted key. `tomllib` takes quadratic time for one."""
    longest = parts = 0
    for each in text.split("."):
        word = each.strip(" \t")
        quoted = len(word) > 1 and word[0] == word[-1] and word[0] in "\"'"
        parts = parts + 1 if quoted or word.replace("-", "").replace("_", "").isalnum() else 0
        longest = max(longest, parts)
    return longest


def _settings(table: SettingsTable) -> ProjectSettings:
    lint, form, test = (table.table(name) for name in ("lint", "format", "test"))
    table.close()
    return ProjectSettings(_lint(lint), _format(form), _test(test))


def _lint(table: SettingsTable) -> LintSettings:
    ignored = list(_ignored(table.table("ignore"), None))
    files = table.table("per-file-ignore")
    for pattern in files.names():
        ignored += _ignored(files.table(pattern), pattern)
    settings = LintSettings(
        tuple(ignored),
        table.texts("exclude"),
        table.one_of("fail-on", LEVELS, "warning"),
        table.texts("with"),
        table.flag("cache", default=True),
        table.flag("format", default=False),
    )
    table.close()
    return settings


def _ignored(table: SettingsTable, pattern: str | None) -> list[IgnoredCode]:
    return [IgnoredCode(table.code(name), table.reason(name), pattern) for name in table.names()]


def _format(table: SettingsTable) -> FormatSettings:
    width = table.number("width", NARROWEST, WIDEST)
    settings = FormatSettings(WIDTH if width is None else width, table.texts("exclude"))
    table.close()
    return settings


def _test(table: SettingsTable) -> TestSettings:
    settings = TestSettings(table.number("fail-under", 0, 100), table.texts("exclude"))
    table.close()
    return settings


def _not_toml(file: str, error: str) -> Refusal:
    """The error of `tomllib` in the style of our messages, with its line at the front."""
    words, _, place = error.removesuffix(")").partition(" (at ")
    words = words[:1].lower() + words[1:]
    line = place.removeprefix("line ").partition(",")[0]
    return misconfigured(file, f"not valid TOML: {words}", "", int(line) if line.isdecimal() else None)


def _line(text: str, key: str) -> int | None:
    """The line of a key; None unless exactly one line has it, because another table may have a key of the same name."""
    written = (key, f'"{key}"', f"'{key}'")
    lines = [
        number
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip().startswith(written) or any(f"{mark}{each}" in line for each in written for mark in "{.[, ")
    ]
    return lines[0] if len(lines) == 1 else None
