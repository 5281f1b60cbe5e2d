"""Completion values of options and arguments that their types do not define: file patterns, codes, formats."""

from collections.abc import Sequence
from typing import Final

from rtshcua.app.importing import PROPOSERS, SUFFIXES, TARGETS, USES
from rtshcua.app.lint.scope import FORMATS
from rtshcua.diagnostics.codes import REGISTRY
from rtshcua.front.cli.table import COMMANDS
from rtshcua.ground.agent.tool_forms import FORMS
from rtshcua.ground.flight.export import FORMATS as EXPORTS
from rtshcua.ground.project.project_settings import LEVELS

_SOURCES, _BUNDLE, _LOGS, _ROOTS = ("*.rts",), ("*.bundle",), ("*.jsonl",), ("*.trust",)

#: file patterns by parameter name, or by command and parameter name
FILES: Final[dict[str, Sequence[str]]] = {
    "paths": _SOURCES,
    "with_": _SOURCES,
    "bind file": ("*.ulg", "*.bin", "*.BIN"),
    "check paths": ("*.rts", "*.json"),
    "check map_": ("*.html",),
    "picture": ("*.svg",),
    "check since": ("*.bundle", "*.rts"),
    "gateway inside": ("*.kml", "*.kmz", "*.geojson", "*.json"),
    "gateway policy": _SOURCES,
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
    "export run": _LOGS,
    "import file": tuple(f"*{each}" for each in SUFFIXES),
    "import policy": _SOURCES,
    "why path": ("*.rts", "*.json", "*.bundle", "*.jsonl"),
}

#: the values of parameters of `import`
IMPORTED: Final = {"to": TARGETS, "proposer": PROPOSERS, "use": USES}

#: parameters that take folders
FOLDERS: Final = frozenset({"directory", "folder", "runs", "save", "state_dir", "archive"})


def words(command: str, parameter: str) -> tuple[str, ...]:
    """Return the known values of a text parameter; empty if there are none."""
    if (command, parameter) == ("explain", "code"):
        return (*REGISTRY, *(code.slug for code in REGISTRY.values()))
    if (command, parameter) == ("help", "command"):
        return tuple(row.name for row in COMMANDS)
    if (command, parameter) == ("lint", "format"):
        return FORMATS
    if (command, parameter) == ("export", "to"):
        return EXPORTS
    if command == "import" and parameter in IMPORTED:
        return IMPORTED[parameter]
    if (command, parameter) == ("schema", "form"):
        return tuple(FORMS)
    return LEVELS if parameter == "fail_on" else ()


def patterns(command: str, parameter: str) -> Sequence[str]:
    """Return the file patterns of a parameter; empty if any file is accepted."""
    return FILES.get(f"{command} {parameter}", FILES.get(parameter, ()))
