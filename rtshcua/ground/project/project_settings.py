"""What a project says in `rtshcua.toml`, or in `pyproject.toml` below `[tool.rtshcua]`: the text, as `ProjectSettings`.

Nothing is guessed: an unknown key, a value of the wrong type, an ignore without a reason is a refusal, with the nearest
that would be accepted. `docs/linting.md` has all keys.
"""

import tomllib
from dataclasses import dataclass
from typing import Literal

from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.project.strict_tables import SettingError, SettingsTable

#: the names under which a configuration is looked for, of one folder the first that has one
OWN, SHARED = "rtshcua.toml", "pyproject.toml"
NAMES = (OWN, SHARED)

FailOn = Literal["error", "warning", "note", "never"]
LEVELS: tuple[FailOn, ...] = ("error", "warning", "note", "never")
WIDTH, NARROWEST, WIDEST = 120, 40, 400


@dataclass(frozen=True, slots=True)
class IgnoredCode:
    """A kind of finding that is ignored, and why; `pattern` says in which files, None: in all."""

    code: Code
    reason: str
    pattern: str | None = None


@dataclass(frozen=True, slots=True)
class LintSettings:
    """`[lint]`: what is ignored, which files are left out, from which level on a run fails, further sources, whether
    what was found is remembered, and whether the format is looked at.
    """

    ignored: tuple[IgnoredCode, ...] = ()
    exclude: tuple[str, ...] = ()
    fail_on: FailOn = "warning"
    further: tuple[str, ...] = ()
    cache: bool = True
    format: bool = False


@dataclass(frozen=True, slots=True)
class FormatSettings:
    """`[format]`: how many characters wide lines are, and which files are left out."""

    width: int = WIDTH
    exclude: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TestSettings:
    """`[test]`: the coverage in whole per cent below which a run fails, None for any; and which files are left out."""

    __test__ = False  # for pytest

    fail_under: int | None = None
    exclude: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ProjectSettings:
    """A whole configuration. Paths and patterns in it are relative to the folder that it stands in."""

    lint: LintSettings = LintSettings()
    format: FormatSettings = FormatSettings()
    test: TestSettings = TestSettings()


#: parts of a dotted key; ours have three
_MOST_PARTS = 64


def misconfigured(file: str, what: str, help: str = "", line: int | None = None) -> Refusal:
    """Why a configuration is none: in `file`, at `line` where that is known (from 1)."""
    return Refusal("configuration", f"{file}{'' if line is None else f':{line}'}: {what}", help)


def parse_settings(text: str, file: str, *, shared: bool = False) -> ProjectSettings | Refusal | None:
    """The settings in a configuration called `file`; `shared` where it is a `pyproject.toml`, in which others have
    tables too: None where that has none of ours.
    """
    if _longest_key(text) > _MOST_PARTS:
        return misconfigured(file, f"a key has more than {_MOST_PARTS} parts")
    try:
        found = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return _not_toml(file, str(error))
    except RecursionError:
        return misconfigured(file, "it is nested too deeply to be read")
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
    """How many parts the longest dotted key has, or what looks like one: `tomllib` takes the square of that in time."""
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
    """What `tomllib` says, as our messages are written; its place, which it puts at the end, goes to the front."""
    words, _, place = error.removesuffix(")").partition(" (at ")
    words = words[:1].lower() + words[1:]
    line = place.removeprefix("line ").partition(",")[0]
    return misconfigured(file, f"it is not TOML: {words}", "", int(line) if line.isdecimal() else None)


def _line(text: str, key: str) -> int | None:
    """The first line on which a key stands; it may be one of the same name in another table, so it is only said where
    there is one such line.
    """
    written = (key, f'"{key}"', f"'{key}'")
    lines = [
        number
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip().startswith(written) or any(f"{mark}{each}" in line for each in written for mark in "{.[, ")
    ]
    return lines[0] if len(lines) == 1 else None
