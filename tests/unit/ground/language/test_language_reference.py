"""docs/language.md names every unit and reserved word, and the parser runs without Lark."""

import re
import subprocess
import sys
from pathlib import Path

from rtshcua.ground.language.table import table
from rtshcua.model.quantity import UNITS

PAGE = (Path(__file__).resolve().parents[4] / "docs" / "language.md").read_text(encoding="utf-8")


def test_language_page_names_all_units_and_reserved_words() -> None:
    quoted = set(re.findall(r"`([^`\n]+)`", PAGE))
    assert set(UNITS) <= quoted
    assert {word for word, free in table().words.items() if not free} <= quoted


def test_parser_does_not_import_lark() -> None:
    code = "import sys, rtshcua.ground.language.load; sys.exit('lark' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
