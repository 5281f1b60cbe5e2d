"""Exit codes are a stable interface: a change breaks scripts."""

import re
from pathlib import Path

from rtshcua.diagnostics.exits import ExitCode, as_markdown


def test_codes_and_slugs_never_change() -> None:
    assert {code.value: code.slug for code in ExitCode} == {
        0: "ok",
        1: "diagnostics",
        2: "usage",
        3: "input",
        4: "untrusted",
        5: "refused",
        6: "aborted",
        7: "stood-down",
        8: "link",
        9: "evidence",
        10: "incomplete",
        11: "decision",
        12: "anchor",
        13: "tests",
        14: "crashed",
        15: "boundary",
        70: "fault",
        74: "io",
        130: "interrupted",
    }


def test_meanings_are_one_line_each() -> None:
    for code in ExitCode:
        assert re.fullmatch(r"[^\n|]{20,110}", code.meaning), code


def test_markdown_table_has_a_row_for_each_code() -> None:
    lines = as_markdown().splitlines()
    assert lines[:3] == [
        "| code | slug | meaning |",
        "|---:|---|---|",
        "| 0 | `ok` | done; a flight succeeded, a log verified, sources have no errors |",
    ]
    assert len(lines) == 2 + len(ExitCode)


def test_readme_contains_the_current_table(checkout: Path) -> None:
    assert as_markdown() in (checkout / "README.md").read_text(encoding="utf-8")
