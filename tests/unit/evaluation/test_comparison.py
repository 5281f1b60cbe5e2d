"""The comparison table: the published rows by hand, sources for peers, and what shows each entry of this system."""

import re
from pathlib import Path

from rtshcua.evaluation.comparison import COLUMNS, COMPARISON, OURS, Aim, Judge
from virtual.rows import rows

ROOT = Path(__file__).resolve().parents[3]
#: the table of the paper, word by word
PUBLISHED = """
natural-language UAV control                  | yes  | part | part | part | no   | no
agentic aerial frameworks (AerialClaw)        | yes  | part | part | part | no   | part
embodied agents, VLAs                         | yes  | part | part | part | no   | no
tool-use and computer-use agents              | part | no   | part | part | no   | no
computer-use agent safety                     | part | no   | part | yes  | part | part
host-side SHCUA, OpenClaw security            | part | part | part | yes  | part | part
low-latency planning, compact forms (TypeFly) | part | yes  | part | part | no   | no
safety supervision, runtime assurance         | yes  | part | yes  | part | no   | no
prompt-injection defence                      | part | no   | part | yes  | part | no
TEE, isolated enforcement                     | part | part | part | yes  | yes  | no
the paper                                     | yes  | yes  | yes  | yes  | yes  | yes
"""
SHOWN = [(column.key, path) for column, entry in zip(COLUMNS, OURS.entries, strict=True) for path in entry.shown_by]


def test_rows_of_the_paper_are_the_published_ones() -> None:
    published = [tuple(cell.strip() for cell in line.split("|")) for line in PUBLISHED.strip().splitlines()]
    of_paper = [each for each in COMPARISON if each.judge is Judge.PAPER]
    assert [(each.work, *(str(entry.aim) for entry in each.entries)) for each in of_paper] == published
    assert not any(each.sources or each.note for each in of_paper), "what is only repeated has no source of ours"


def test_every_row_has_every_column_and_a_name_of_its_own() -> None:
    assert len({column.key for column in COLUMNS}) == 6
    assert len({each.work for each in COMPARISON}) == len(COMPARISON)
    assert all(len(each.entries) == len(COLUMNS) for each in COMPARISON)
    assert OURS.entry("isolation") is OURS.entries[4]


def test_every_peer_has_sources_and_a_reason() -> None:
    peers = [each for each in COMPARISON if each.judge is Judge.OURS and each is not OURS]
    assert {"MAVSDK", "QGroundControl", "Flight Review", "Cedar", "OPA", "TUF", "mavlink-router"} <= {
        each.work for each in peers
    }
    for each in peers:
        assert each.sources, each.work
        assert each.note.endswith("."), each.work
        assert all(re.fullmatch(r"https://[\w.-]+/\S+", source) for source in each.sources), each.work
        assert not any(entry.shown_by for entry in each.entries), each.work


def test_each_entry_of_this_system_is_shown_by_a_test() -> None:
    assert COMPARISON[-1] is OURS
    for column, entry in zip(COLUMNS, OURS.entries, strict=True):
        tests = [path for path in entry.shown_by if path.startswith("tests/")]
        assert tests or entry.aim is Aim.NO, column.key


@rows(("column", "path"), SHOWN)
def test_what_shows_an_entry_exists(column: str, path: str) -> None:
    file = ROOT / path
    assert file.is_file(), path
    assert not path.startswith("tests/") or "def test_" in file.read_text(encoding="utf-8"), path
