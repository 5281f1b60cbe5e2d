"""A hundred programs with one plausible mistake each, written from the reference: the checker names that mistake."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from rtshcua.diagnostics.render import render
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from virtual.sampling import parts

CHECKOUT = Path(__file__).resolve().parents[2]
FILES = sorted((CHECKOUT / "tests" / "specifications" / "faulty").glob("*.rts"))


def first_line(path: Path) -> str:
    """The comment that says what is wrong."""
    return path.read_text(encoding="utf-8").splitlines()[0]


def test_there_are_a_hundred_of_all_kinds() -> None:
    assert len(FILES) == 100
    assert len({path.name[:5] for path in FILES}) >= 75
    assert {path.name[:3] for path in FILES} == {
        *("e01", "e02", "e03", "e04", "e05", "e06", "e07", "e08", "e10", "e11", "e12")
    }


def test_each_says_what_is_wrong() -> None:
    lines = [first_line(path) for path in FILES]
    assert all(line.startswith("// ") for line in lines)
    assert len(set(lines)) == len(lines)


@pytest.mark.slow
@pytest.mark.parametrize("files", parts(FILES, 2))
def test_the_one_mistake_is_found(files: Sequence[Path]) -> None:
    wrong = {}
    for path in files:
        program = load([str(path)], lambda name: Path(name).read_bytes(), str(CHECKOUT))
        findings = check_program(program, dialect.load())
        if {finding.code.id for finding in findings} != {path.name[:5].upper()}:
            wrong[path.stem] = render(findings, program.sources)
    assert wrong == {}
