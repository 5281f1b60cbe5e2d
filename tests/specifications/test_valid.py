"""A hundred specifications, written from docs/language.md alone, are compiled, and nothing is found in any of them."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from rtshcua.diagnostics.render import render
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect
from virtual.sampling import parts

CHECKOUT = Path(__file__).resolve().parents[2]
SPECIFICATIONS = sorted((Path(__file__).resolve().parent / "valid").glob("*.rts"))


def findings(path: Path) -> str:
    """What a person reads when the specification at `path` is checked."""
    program = load([str(path)], lambda name: Path(name).read_bytes(), str(CHECKOUT))
    return render(check_program(program, dialect.load()), program.sources)


def test_there_are_a_hundred_numbered_from_one() -> None:
    assert [path.name[:4] for path in SPECIFICATIONS] == [f"{number:03}_" for number in range(1, 101)]


def test_each_specification_begins_with_a_unique_comment() -> None:
    first_lines = [path.read_text(encoding="utf-8").splitlines()[0] for path in SPECIFICATIONS]
    assert all(line.startswith(("// ", "/* ")) for line in first_lines)
    assert len(set(first_lines)) == len(SPECIFICATIONS)


@pytest.mark.slow
@pytest.mark.parametrize("specifications", parts(SPECIFICATIONS, 4))
def test_valid_specifications_have_no_findings(specifications: Sequence[Path]) -> None:
    found = {path.stem: findings(path) for path in specifications}
    assert {name: text for name, text in found.items() if text} == {}
