"""The rules of docs/architecture.md: layers, purity, and the modules on board."""

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "rtshcua"
CORE = ("diagnostics", "model", "mavlink", "wire", "decision", "evidence")
WORLD = {"lark", "os", "pymavlink", "random", "rich", "socket", "subprocess", "threading", "time", "typer"}
NOT_ON_BOARD = {"lark", "pydantic", "pymavlink", "rich", "shapely", "typer"}


def imports(source: str) -> Iterator[str]:
    """Return every module that `source` imports, also in functions and through importlib."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=str(module)):
                yield module
            case ast.Call(
                func=ast.Name(id="__import__" | "import_module") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(module)), *_],
            ):
                yield module


def test_scan_finds_every_way_to_import() -> None:
    source = (
        "import a.b, c\nfrom d.e import f\ndef g():\n    import h\n    import_module('i')\n    x.import_module('j.k')\n"
    )
    assert sorted(imports(source)) == ["a.b", "c", "d.e", "h", "i", "j.k"]


@pytest.mark.parametrize("layer", CORE)
def test_core_imports_no_input_or_output(layer: str) -> None:
    files = sorted((PACKAGE / layer).rglob("*.py"))
    assert files
    found = {
        f"{file.relative_to(PACKAGE)}: {module}"
        for file in files
        for module in imports(file.read_text(encoding="utf-8"))
        if module.partition(".")[0] in WORLD
    }
    assert not found


def test_import_contracts_hold(checkout: Path) -> None:
    tool = Path(sys.executable).with_name("lint-imports")
    run = subprocess.run([tool, "--no-cache"], cwd=checkout, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr


def test_onboard_imports_no_ground_module(checkout: Path) -> None:
    modules = [
        ".".join(file.relative_to(checkout).with_suffix("").parts).removesuffix(".__init__")
        for file in sorted((PACKAGE / "onboard").rglob("*.py"))
    ]
    assert modules
    program = f"import importlib, sys\nfor name in {modules}: importlib.import_module(name)\nprint(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], cwd=checkout, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    loaded = run.stdout.split()
    assert not {name for name in loaded if name.partition(".")[0] in NOT_ON_BOARD or name.startswith("rtshcua.ground")}


def test_exhaustive_contract_names_every_part(checkout: Path) -> None:
    config = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))
    layers = [c for c in config["tool"]["importlinter"]["contracts"] if c["type"] == "layers"]
    assert {"rtshcua"} <= {container for each in layers for container in each["containers"]}
    for each in layers:
        assert each["exhaustive"]
        assert "exhaustive_ignores" not in each
        assert "ignore_imports" not in each
