"""X7: code lines, sections of programs, and which files a component has."""

import subprocess
from pathlib import Path

import pytest

from rtshcua.evaluation import footprint
from rtshcua.evaluation.design import WorkUnit
from rtshcua.evaluation.footprint import COMPANION, HOMES, PACKAGE, c_code_lines, code_lines, elf_sizes, files_of, total
from rtshcua.evaluation.results import ComponentSize


def test_code_lines_of_python_leave_out_blanks_comments_and_docstrings() -> None:
    source = b'''"""Says
what it is."""

# a comment
X = """not
a docstring"""  # and a comment


def f() -> int:
    """A docstring."""

    return (
        1
    )
'''
    assert code_lines(source) == 6


def test_code_lines_of_c_leave_out_blanks_and_comments() -> None:
    source = b"""/* what
it is */
#include "x.h" // why

char *text = "// no comment /* at all"; /* a
comment */ int x;
char quote = '"'; // "
"""
    assert c_code_lines(source) == 4


def test_files_belong_to_one_component_and_exist() -> None:
    found = [file for each in COMPANION for file in files_of(each)]
    assert len(found) == len(set(found))
    assert all(files_of(each) for each in COMPANION)
    onboard = {*(PACKAGE / "onboard" / "runtime").glob("*.py"), *(PACKAGE / "onboard" / "enforcement").glob("*.py")}
    assert onboard <= set(found)


def test_sizes_of_a_program_are_those_of_readelf() -> None:
    program = next((each.program for each in HOMES if each.program.is_file()), None)
    if program is None:
        pytest.skip("no home of the boundary was built")
    said = subprocess.run(["readelf", "-SW", program], capture_output=True, text=True, check=True).stdout
    code = sum(
        int(fields[-6], 16)
        for fields in (line.replace("[ ", "[").split() for line in said.splitlines())
        if len(fields) > 9 and fields[-4].startswith("A") and "W" not in fields[-4]
    )
    found = elf_sizes(program.read_bytes())
    assert found.code == code
    assert found.code < found.artifact <= program.stat().st_size
    with pytest.raises(ValueError, match="ELF"):
        elf_sizes(b"#!/bin/sh\n")


@pytest.mark.slow
def test_each_component_has_lines_octets_and_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(footprint, "SAMPLE_US", 60_000_000)
    found = footprint.run(WorkUnit("X7", ("components", "short")))
    sizes = [each for each in found if isinstance(each, ComponentSize)]
    assert [each.component for each in sizes] == [each.name for each in (*COMPANION, *HOMES)]
    companion = sizes[: len(COMPANION)]
    assert all(each.code_lines and each.artifact and each.memory for each in companion)
    assert total(companion)[2] < 2_000_000
    assert not Path("log.jsonl").exists()
