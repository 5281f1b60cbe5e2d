"""Run the tests of a program and return their findings."""

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case_result import run_case
from rtshcua.mavlink import dialect


def unmet(program: Program) -> tuple[Diagnostic, ...]:
    """Return the findings about failed expectations."""
    ran = (run_case(case) for case in suite(program, dialect.load()).cases)
    return tuple(each.finding for each in ran if each.finding is not None)
