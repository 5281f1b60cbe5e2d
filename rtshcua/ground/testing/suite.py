"""The cases of a program: its tests, elaborated, lowered and prepared as real requests are."""

from rtshcua.ground.compiler.program import Compilation
from rtshcua.ground.language.load import Program
from rtshcua.ground.testing.case import Suite
from rtshcua.mavlink.dialect import Dialect


def suite(program: Program, dialect: Dialect) -> Suite:
    """The cases of the first file of a program; findings on the declarations and the tests.

    What is proved of policies and missions is not asked here: that is `check_program`'s business.
    """
    run = Compilation(program, dialect, 0)
    run.check()
    cases = run.cases()
    found = run.diagnostics()
    if run.report.failed():
        return Suite((), found, (), run.report.sources)
    policies = tuple(dict.fromkeys(case.policy for case in cases))
    return Suite(cases, found, policies, run.report.sources)
