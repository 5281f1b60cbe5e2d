"""What may stand for an option or an argument, where its type does not say so: files of some kind, codes, shells."""

from collections.abc import Sequence
from typing import Final

from rtshcua.app.lint.scope import FORMATS
from rtshcua.diagnostics.codes import REGISTRY
from rtshcua.front.cli.table import COMMANDS
from rtshcua.ground.agent.tool_forms import FORMS
from rtshcua.ground.project.project_settings import LEVELS

_SOURCES, _BUNDLE, _LOGS, _ROOTS = ("*.rts",), ("*.bundle",), ("*.jsonl",), ("*.trust",)

#: which files are meant, by the name of the parameter, or by command and parameter where that has a meaning of its own
FILES: Final[dict[str, Sequence[str]]] = {
    "paths": _SOURCES,
    "with_": _SOURCES,
    "check paths": ("*.rts", "*.json"),
    "check map_": ("*.html",),
    "check since": ("*.bundle", "*.rts"),
    "compile source": ("*.rts", "*.json"),
    "compile replaces": _BUNDLE,
    "config": ("*.toml",),
    "witness paths": _LOGS,
    "root": _ROOTS,
    "revocations": _ROOTS,
    "roots": _ROOTS,
    "bundle": _BUNDLE,
    "log": _LOGS,
    "logs": _LOGS,
    "anchors": ("*.anchors",),
    "why path": ("*.rts", "*.json", "*.bundle", "*.jsonl"),
}

#: parameters that are folders
FOLDERS: Final = frozenset({"directory", "folder", "runs", "state_dir", "archive"})


def words(command: str, parameter: str) -> tuple[str, ...]:
    """The words that an argument may be, for a parameter that takes any text; none where nobody knows."""
    if (command, parameter) == ("explain", "code"):
        return (*REGISTRY, *(code.slug for code in REGISTRY.values()))
    if (command, parameter) == ("help", "command"):
        return tuple(row.name for row in COMMANDS)
    if (command, parameter) == ("lint", "format"):
        return FORMATS
    if (command, parameter) == ("schema", "form"):
        return tuple(FORMS)
    return LEVELS if parameter == "fail_on" else ()


def patterns(command: str, parameter: str) -> Sequence[str]:
    """The patterns of files that are meant; none where any file may be."""
    return FILES.get(f"{command} {parameter}", FILES.get(parameter, ()))
