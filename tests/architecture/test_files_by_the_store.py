"""Only `rtshcua/adapters/store` opens, replaces and creates files; the exceptions are listed here with reasons."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from rtshcua.adapters.store import writing
from virtual.rows import rows

PACKAGE = Path(__file__).resolve().parents[2] / "rtshcua"

#: modules outside the store that open or write files
ALLOWED = {
    "adapters/archive/asking.py": "reads the SQL that ships",
    "adapters/boundary/optee.py": "reads what `.make/optee` built; its disk is opened for the emulator",
    "adapters/vehicle/transport.py": "a serial device is not a regular file",
    "campaign/campaign_report.py": "reads the template that ships",
    "evaluation/footprint.py": "reads this program's own sources and programs, and a process of its own in /proc",
    "front/cli/commands/agent_bundle.py": "reads the example that ships",
    "front/cli/commands/init.py": "reads the example that ships",
    "app/flights/left_over.py": "reads the templates that ship",
    "app/lint/cache.py": "reads this program's own modules",
    "front/cli/render/pages.py": "reads the pages that ship",
    "front/cli/unlock.py": "a passphrase may well come from a pipe",
    "ground/checker/time_zones.py": "reads the data of the package `tzdata`",
    "ground/drawing/html.py": "reads the templates that ship",
    "ground/flight/flight_page.py": "reads the scripts that ship",
    "ground/flight/embedding.py": "reads the scripts that ship",
    "ground/language/generate.py": "a developer's tool: from the grammar to its table",
    "ground/language/table.py": "reads the table that ships",
    "codec/build_dialect.py": "a developer's tool: from pymavlink to the table",
    "mavlink/dialect.py": "reads the table that ships",
    "simulation/process.py": "the simulated vehicle's own key, and no sibling is imported from there",
}
#: of modules, and of paths
MODULES = {
    "os": {"open", "replace", "rename", "renames", "link", "symlink", "truncate", "creat"},
    "io": {"open", "open_code", "FileIO"},
    "shutil": {"copy", "copy2", "copyfile", "copytree", "move"},
    "tempfile": {"mkstemp", "mkdtemp", "mktemp", "NamedTemporaryFile", "SpooledTemporaryFile", "TemporaryFile"},
}
METHODS = {"read_bytes", "read_text", "write_bytes", "write_text", "rename", "hardlink_to", "symlink_to"}
#: strings that such a module contains, so that few modules need parsing: calls or imports of these names
WORDS = re.compile(
    rf"\.(?:{'|'.join(METHODS.union(*MODULES.values()))})\s*\(|(?<![\w.])open\s*\("
    rf"|\bfrom\s+(?:{'|'.join(MODULES)})\s+import\b"
)


def opened(source: str) -> Iterator[str]:
    """Yield the imports and calls by which a module opens, creates or renames files."""
    if not WORDS.search(source):
        return
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call | ast.ImportFrom):
            continue
        match node:
            case ast.ImportFrom(module=str(module), names=names):
                yield from (f"{module}.{each.name}" for each in names if each.name in MODULES.get(module, ()))
            case ast.Call(func=ast.Attribute(value=ast.Name(id="os"), attr="open"), args=[place, *_]):
                if ast.unparse(place) != "os.devnull":
                    yield "os.open"
            case ast.Call(func=ast.Attribute(value=ast.Name(id=module), attr=name)) if name in MODULES.get(module, ()):
                yield f"{module}.{name}"
            case ast.Call(func=ast.Name(id="open")):
                yield "open"
            case ast.Call(func=ast.Attribute(attr="open"), args=args) if not args or _is_mode(args[0]):
                yield ".open"
            case ast.Call(func=ast.Attribute(attr="replace"), args=[what], keywords=[]):
                if not ast.unparse(what).endswith("mission"):  # of a flight; text is replaced with two arguments
                    yield ".replace"
            case ast.Call(func=ast.Attribute(attr=name)) if name in METHODS:
                yield f".{name}"


def _is_mode(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and set(node.value) <= set("rwxabt+")


@rows(
    "way",
    [
        "from tempfile import mkstemp", "from os import replace", "from shutil import move",
        "os.open(path, 0)", "os.replace(a, b)", "shutil.copyfile(a, b)", "open(path)", "path.open()", "path.open('rb')",
        "Path(name).read_bytes()", "path.write_text(text)", "path.rename(other)", "fresh.replace(path)",
        "def f():\n    with path.open('wb') as file:\n        pass",
    ],
)  # fmt: skip
def test_scan_finds_every_way_to_open_files(way: str) -> None:
    assert list(opened(way))


@pytest.mark.parametrize(
    "other", ["os.open(os.devnull, 0)", "text.replace('a', 'b')", "session.open(uri, 1)", "replace(path, data)"]
)
def test_scan_ignores_other_calls(other: str) -> None:
    assert not list(opened(other))


def test_only_the_store_opens_and_writes_files() -> None:
    found = {
        str(file.relative_to(PACKAGE)): sorted(set(opened(file.read_text(encoding="utf-8"))))
        for file in sorted(PACKAGE.rglob("*.py"))
        if not file.is_relative_to(PACKAGE / "adapters" / "store")
    }
    ways = {name: each for name, each in found.items() if each}
    assert {name: each for name, each in ways.items() if name not in ALLOWED} == {}
    assert sorted(ALLOWED.keys() - ways.keys()) == [], "these may go from the list"


def test_folders_are_created_with_a_mode() -> None:
    """Without a mode a folder gets the umask's, which may be open to everybody."""
    without = []
    for file in sorted(PACKAGE.rglob("*.py")):
        source = file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(source)) if re.search(r"mkdir|makedirs|touch\(|mkfifo", source) else ():
            match node:
                case ast.Call(func=ast.Attribute(attr="mkdir" | "makedirs" | "touch" | "mkfifo")):
                    path = isinstance(node.func, ast.Attribute) and ast.unparse(node.func.value) != "os"
                    given = len(node.args) > (0 if path else 1) or any(each.arg == "mode" for each in node.keywords)
                    if not given:
                        without.append(f"{file.relative_to(PACKAGE)}:{node.lineno}")
    assert [each for each in without if not each.startswith("app/lint/findings.py")] == []


def test_no_mode_allows_others_to_write() -> None:
    modes = {name: mode for name, mode in vars(writing).items() if name.endswith(("_FILE", "_FOLDER"))}
    assert len(modes) == 4
    assert {name: oct(mode) for name, mode in modes.items() if mode & 0o022} == {}
