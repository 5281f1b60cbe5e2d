"""docs/linting.md matches the program."""

import re
from pathlib import Path

from rtshcua.app.lint.scope import FORMATS
from rtshcua.diagnostics import codes
from rtshcua.ground.project.project_settings import ProjectSettings, parse_settings


def page(checkout: Path) -> str:
    return (checkout / "docs" / "linting.md").read_text(encoding="utf-8")


def test_table_lists_every_rule(checkout: Path) -> None:
    rows = re.findall(r"^\| (E\d+) \| `([a-z-]+)` \|", page(checkout), re.MULTILINE)
    rules = [code for code in codes.REGISTRY.values() if code.id.startswith("E13")] + [codes.NOT_FORMATTED]
    assert rows == [(code.id, code.slug) for code in rules]


def test_shown_configuration_is_valid(checkout: Path) -> None:
    shown = re.search(r"^```toml\n(.*?)^```$", page(checkout), re.DOTALL | re.MULTILINE)
    assert shown is not None
    found = parse_settings(shown[1], "rtshcua.toml")
    assert isinstance(found, ProjectSettings), found
    assert [each.pattern for each in found.lint.ignored] == [None, "missions/**"]


def test_page_lists_the_formats(checkout: Path) -> None:
    told = page(checkout).split("| `--format` | is |")[1]
    assert tuple(re.findall(r"^\| `(\w+)` \|", told, re.MULTILINE)) == FORMATS
