"""docs/paper-map.md names only existing code, and covers every field of an invocation and a contract."""

import importlib
import re
from pathlib import Path

import pytest

from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.mission import Invocation
from virtual.rows import rows

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\|(?:[^|]*\|)? `([A-Za-z][\w.]*)` \| `(rtshcua/[\w/]+\.py)` \|", re.MULTILINE)
PAGE = (ROOT / "docs" / "paper-map.md").read_text(encoding="utf-8")
ROWS = ROW.findall(PAGE)
FILES = sorted(set(re.findall(r"`((?:rtshcua|tests)/[\w/]+\.py)`", PAGE)))


@rows(("name", "file"), ROWS, ids=[name for name, _ in ROWS])
def test_every_name_exists_in_its_file(name: str, file: str) -> None:
    module = importlib.import_module(file.removesuffix(".py").replace("/", "."))
    owner, _, field = name.partition(".")
    found = getattr(module, owner)
    assert found.__module__ == module.__name__
    assert not field or field in getattr(found, "__struct_fields__", ()) or callable(vars(found)[field])


@pytest.mark.parametrize("cls", [Invocation, Contract])
def test_every_field_is_on_the_map(cls: type) -> None:
    mapped = {name for name, _ in ROWS}
    assert {f"{cls.__name__}.{field}" for field in cls.__struct_fields__} <= mapped


@rows("file", FILES)
def test_every_named_file_exists(file: str) -> None:
    assert (ROOT / file).is_file()


def test_every_theorem_and_assumption_has_a_row() -> None:
    found = {str(path.relative_to(ROOT)) for path in (ROOT / "tests" / "theorems").glob("test_*.py")}
    assert len(found) == 8
    assert found <= set(FILES)


def test_every_predicate_names_its_test() -> None:
    part = PAGE.partition("## Predicates and functions")[2].partition("\n## ")[0]
    lines = [line for line in part.splitlines() if line.startswith("| ")][1:]
    assert len(lines) >= 13
    for line in lines:
        assert re.search(r"\| `rtshcua/[\w/]+\.py` \| `tests/[\w/]+\.py` \|$", line), line


@rows(
    "what",
    ["valid_T", "valid_S", "admissible", "Q_onboard", "enforce", "h_intent", "h_agent", "r_eta", "r_time", "act"],
)
def test_every_proof_notion_is_on_the_map(what: str) -> None:
    assert re.search(rf"^\|[^|]*\b{what}\b[^|]*\| `[A-Za-z][\w.]*` \| `rtshcua/", PAGE, re.MULTILINE), what
