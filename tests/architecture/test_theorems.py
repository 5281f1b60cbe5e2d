"""docs/theorems.md is up to date, and every theorem and assumption has tests that attack it over random histories."""

from pathlib import Path

import pytest

from reference.claims import CLAIMS, PAGE, PARTS, Marked, collected, marked, named_files, page, problems, stated
from virtual.rows import rows

ROOT = Path(__file__).resolve().parents[2]
TESTS, STATED = collected(), stated()
SOURCE = """
@pytest.mark.soak
@pytest.mark.claim("T1")
@given(some.integers())
def test_a(number): ...

@pytest.mark.claim("T2", drawn="by seed")
def test_b(): ...

@pytest.mark.claim("T1", broken="everything")
def test_c(): ...
"""


def test_every_claim_is_stated_and_attacked() -> None:
    assert problems(TESTS, STATED) == []


def test_page_is_up_to_date() -> None:
    assert (ROOT / PAGE).read_text(encoding="utf-8") == page(TESTS, STATED), "run .make/theorems"


def test_statements_name_existing_files() -> None:
    named = named_files(STATED)
    assert len(named) > 20
    assert [each for each in sorted(named) if not (ROOT / each).exists()] == []


def test_markers_are_read() -> None:
    assert list(marked(SOURCE, "a.py")) == [
        Marked("T1", "a.py", "test_a", "make soak", "property test", ""),
        Marked("T2", "a.py", "test_b", "make test", "by seed", ""),
        Marked("T1", "a.py", "test_c", "make test", "", "everything"),
    ]
    everywhere = 'pytestmark = [pytest.mark.slow, pytest.mark.claim("A1", drawn="by seed")]\ndef test_a(): ...\n'
    assert list(marked(everywhere, "a.py")) == [Marked("A1", "a.py", "test_a", "make slow", "by seed", "")]


@rows("written", ["claim()", 'claim("T1", "T2")', "claim(name)", 'claim("T1", by="x")', 'claim("T1", broken=BROKEN)'])
def test_marker_written_otherwise_is_refused(written: str) -> None:
    with pytest.raises(ValueError, match="write claim"):
        list(marked(f"@pytest.mark.{written}\ndef test_a(): ...\n", "a.py"))


@rows("name", list(CLAIMS))
def test_missing_test_is_a_problem(name: str) -> None:
    """For each claim: without its tests of each kind, and without each part of its statement."""
    for leave_out, text in (
        (lambda each: each.runs == "make test" and not each.broken, "no test of `make test`"),
        (lambda each: each.runs == "make soak", "no soak test"),
        (lambda each: bool(each.broken), "something broken"),
    ):
        left = [each for each in TESTS if each.claim != name or not leave_out(each)]
        (found,) = problems(left, STATED)
        assert found.startswith(f"{name}: ")
        assert text in found
    for part in PARTS:
        (found,) = problems(TESTS, STATED | {name: {**STATED[name], part: ""}})
        assert part in found


def test_unknown_name_and_undrawn_test_are_problems() -> None:
    (found,) = problems([*TESTS, TESTS[0]._replace(claim="T9")], STATED)
    assert found.endswith("there is no claim T9")
    (found,) = problems([*TESTS, TESTS[0]._replace(drawn="", broken="")], STATED)
    assert "no property test" in found
