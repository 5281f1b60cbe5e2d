"""Handbooks of the shipped library and of a source that has every construct of the language once."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.pipeline.program import compile_program, examine_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.report.policy_report import CompiledMission, DecidedCases, ReportPart, policy_report
from rtshcua.ground.report.report_model import PolicyReport
from rtshcua.ground.testing.case_result import run_case
from rtshcua.mavlink import dialect
from virtual.once import once

CHECKOUT = Path(__file__).resolve().parents[4]
EVERYTHING = Path(__file__).with_name("everything.rts")
STANDARD = CHECKOUT / "missions" / "standard.rts"
#: 2026-01-31 08:00 UTC
AT = 1_769_846_400_000_000


@cache
def program_of(path: Path) -> Program:
    program = load([str(path)], lambda name: Path(name).read_bytes(), str(CHECKOUT))
    assert not has_errors(program.diagnostics), program.diagnostics
    return program


@cache
def part_of(path: Path) -> ReportPart:
    program = program_of(path)
    checked = examine_program(program, dialect.load())
    assert not has_errors(checked.diagnostics), checked.diagnostics
    flown = []
    for mission in program.units[0].missions:
        compiled = compile_program(program, dialect.load(), mission=mission.name.text, issued_at_us=0)
        assert compiled.policy is not None
        assert compiled.mission is not None
        bounds, pictures = checked.bounds.get(mission.name.text), checked.pictures[mission.name.text]
        flown.append(CompiledMission(compiled.policy, compiled.mission, mission, bounds, pictures))
    tried = DecidedCases(program, tuple(run_case(case) for case in suite(program, dialect.load()).cases))
    return ReportPart(
        program, checked.policies, tuple(flown), checked.diagnostics, (tried,), program.units[0].scenarios
    )


@cache
def book_of(path: Path) -> PolicyReport:
    return once(f"handbook_{path.stem}", lambda: policy_report([part_of(path)], made_at_us=AT, made_by="rtshcua"))


@pytest.fixture(name="everything_program", scope="session")
def read_everything() -> Program:
    """The source that has every construct, and what it imports."""
    return program_of(EVERYTHING)


@pytest.fixture(name="everything", scope="session")
def made_everything() -> PolicyReport:
    """Its handbook."""
    return book_of(EVERYTHING)


@pytest.fixture(name="standard", scope="session")
def made_standard() -> PolicyReport:
    """The handbook of the shipped policy, with a mission."""
    return book_of(STANDARD)


@pytest.fixture(name="part", scope="session")
def parts() -> Callable[[Path], ReportPart]:
    """The program of a file, examined."""
    return part_of
