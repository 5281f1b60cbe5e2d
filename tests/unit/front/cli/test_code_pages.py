"""Every code has a page; its bad example has that code's finding alone, its good example none."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from reference.flown import flown
from reference.linted import linted
from reference.unmet import unmet
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import REGISTRY, Code
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render
from rtshcua.front.cli.render.pages import HEADINGS, example, read_page
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect
from virtual.sampling import parts

CHECKOUT = Path(__file__).resolve().parents[4]
PAGES = CHECKOUT / "docs" / "codes"

#: codes that one source cannot show: invalid text, size, depth, other files and formats, command lines
TOLD = {
    codes.NOT_TEXT,
    codes.HIDDEN_CHARACTER,
    codes.TOO_LARGE,
    codes.TOO_DEEP,
    codes.TOO_MANY_FINDINGS,
    codes.REFUSED_ON_BOARD,
    codes.IMPORT_CYCLE,
    codes.NOT_GEOJSON,
    codes.GEOJSON_SHAPE,
    codes.GEOJSON_UNREAD,
    codes.NOT_A_SOURCE,
    codes.NO_MISSION,
    codes.NOT_IN_POLICY,
    codes.VERSION_NOT_RAISED,
    codes.NOT_JSON,
    codes.SPECIFICATION_SHAPE,
    codes.DUPLICATE_KEY,
    codes.SPECIFICATION_SIZE,
    codes.CLAIMED_AUTHORITY,
    codes.POLICY_NOT_NAMED,
    codes.TOO_MANY,
    codes.UNDECIDED,
    codes.NOT_FORMATTED,
    codes.UNSAFE_FORMAT,
}
#: 12:00 of some day where the shipped site is, which has 10:00 UTC then
NOON = 1_777_629_600_000_000
SHOWN = [code for code in REGISTRY.values() if code not in TOLD]


def findings(text: str, code: Code) -> tuple[tuple[Diagnostic, ...], Program]:
    """The findings of an example as a single file; its mission is also compiled.

    Lint findings are only computed for examples of lint codes.
    """

    def read(path: str) -> bytes:
        return text.encode() if path == "example.rts" else Path(path).read_bytes()

    program = load(["example.rts"], read, str(CHECKOUT))
    if program.units and len(program.units[0].missions) == 1:
        found = compile_program(program, dialect.load(), mission=None, issued_at_us=NOON).diagnostics
    else:
        found = check_program(program, dialect.load())
    if code is codes.NOT_MET:
        found += unmet(program)
    if code is codes.FLIGHT_FAILED:
        found += flown(program)
    return found + (linted(program) if code.id.startswith("E13") else ()), program


def test_each_code_has_exactly_one_page() -> None:
    assert {path.stem for path in PAGES.iterdir()} == set(REGISTRY)


def test_a_page_has_its_title_its_sentence_and_its_sections() -> None:
    for code in REGISTRY.values():
        page = read_page(code)
        title, _, sentence, *_ = page.text.split("\n")
        assert title == f"# {code.id} {code.slug}"
        assert sentence.rstrip(".").lower() == code.meaning.lower(), code.id
        assert tuple(re.findall(r"^## (.+)$", page.text, re.MULTILINE)) == HEADINGS, code.id
        assert all(page), code.id
        assert max(map(len, page.text.splitlines())) <= 120, code.id


@pytest.mark.slow
def test_a_bad_example_has_its_finding_alone() -> None:
    wrong = {}
    for code in SHOWN:
        text = example(read_page(code).bad)
        assert text is not None, code.id
        found, program = findings(text, code)
        if {each.code.id for each in found} != {code.id}:
            wrong[code.id] = render(found, program.sources)
    assert wrong == {}


@pytest.mark.slow
@pytest.mark.parametrize("shown", parts(SHOWN, 3))
def test_a_good_example_has_no_finding(shown: Sequence[Code]) -> None:
    wrong = {}
    for code in shown:
        text = example(read_page(code).good)
        assert text is not None, code.id
        found, program = findings(text, code)
        if found:
            wrong[code.id] = render(found, program.sources)
    assert wrong == {}
