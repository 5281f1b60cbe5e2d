"""Each code of the checker has twins: two sources that differ in one assumption, which their first line names.

The accepted one compiles without a finding. The rejected one has findings of that code only; the goldens beside this
file have their rendered text. `UPDATE_GOLDENS=1` rewrites them: check the diff. Only twins of lint codes are linted,
because all others import one set of skills.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from reference.flown import flown
from reference.linted import linted
from reference.unmet import unmet
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.span import Source
from rtshcua.ground.agent.specification import load_specification
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect
from virtual.sampling import parts

HERE = Path(__file__).resolve().parent
TESTS = HERE.parents[1]
CHECKOUT = TESTS.parent
#: skills and policies that the twins build on, kept apart from those that ship, which may change
LIBRARY = "tests/golden/checker/library"

#: how the names of twins begin that are linted
HABITS = "e13"

REJECTED = sorted(path.name for path in (TESTS / "rejected").iterdir() if path.is_file())
#: what no small source can bring about: bytes that are no text, size, depth, many findings, a compiler's own fault; and
#: what depends on when a mission is issued, or on an earlier policy (tests/unit/ground/versions)
WITHOUT_TWINS = {
    codes.NOT_TEXT,
    codes.TOO_LARGE,
    codes.TOO_DEEP,
    codes.TOO_MANY_FINDINGS,
    codes.REFUSED_ON_BOARD,
    codes.NOT_ALWAYS_PERMITTED,
    codes.VERSION_NOT_RAISED,
    codes.POLICY_NOT_NAMED,  # of the command line
    codes.NOT_FORMATTED,  # tests/golden/format has pairs
    codes.UNSAFE_FORMAT,
}


def findings(side: str, name: str) -> tuple[tuple[Diagnostic, ...], dict[str, Source]]:
    """What compiling a twin finds; a source without a mission is only checked."""
    path = f"tests/{side}/{name}"

    def read(file: str) -> bytes:
        return Path(file).read_bytes()

    if name.endswith(".json"):
        program, specification = load_specification(path, [], read, LIBRARY)
        compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=0)
        return specification.pointed(compiled.diagnostics), program.sources
    program = load([path], read, LIBRARY)
    if program.units and program.units[0].missions and "not_in_policy" not in name:
        found = compile_program(program, dialect.load(), mission=None, issued_at_us=0).diagnostics
    else:
        found = check_program(program, dialect.load())
    if name.startswith(codes.NOT_MET.id.lower()):
        found += unmet(program)
    if name.startswith(codes.FLIGHT_FAILED.id.lower()):
        found += flown(program)
    if name.startswith(HABITS):
        found += linted(program)
    return found, program.sources


@pytest.fixture(autouse=True)
def _in_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(CHECKOUT)


@pytest.mark.slow
def test_rejected_twin_has_only_its_code_and_the_golden_text() -> None:
    others, read, kept = {}, {}, {}
    for name in REJECTED:
        found, sources = findings("rejected", name)
        if {diagnostic.code.id.lower() for diagnostic in found} != {name.partition("_")[0]}:
            others[name] = [diagnostic.code.id for diagnostic in found]
        golden = HERE / f"{Path(name).stem}.txt"
        read[name] = render(found, sources)
        if os.environ.get("UPDATE_GOLDENS"):
            golden.write_text(read[name], encoding="utf-8")
        kept[name] = golden.read_text(encoding="utf-8")
    assert others == {}
    assert {name: text for name, text in read.items() if text != kept[name]} == {}


@pytest.mark.parametrize("names", parts(REJECTED, 3))
def test_accepted_twin_has_no_finding(names: Sequence[str]) -> None:
    seen = {name: findings("accepted", name) for name in names}
    assert {name: render(found, sources) for name, (found, sources) in seen.items() if found != ()} == {}


def test_every_code_has_twins_with_its_name() -> None:
    slugs = {f"{code.id.lower()}_{code.slug.replace('-', '_')}" for code in codes.REGISTRY.values()}
    without = {f"{code.id.lower()}_{code.slug.replace('-', '_')}" for code in WITHOUT_TWINS}
    assert {Path(name).stem for name in REJECTED} == slugs - without
    assert sorted(path.name for path in (TESTS / "accepted").iterdir() if path.is_file()) == REJECTED


def test_every_golden_has_a_twin() -> None:
    assert {path.stem for path in HERE.glob("*.txt")} == {Path(name).stem for name in REJECTED}
