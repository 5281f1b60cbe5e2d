"""The cases of a program, prepared as real requests are, and its scenarios with what they fly."""

from rtshcua.ground.compiler.program import Compilation
from rtshcua.ground.language.load import Program
from rtshcua.ground.testing.case import Suite
from rtshcua.ground.testing.scenarios import Scenarios
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


def scenarios(program: Program, dialect: Dialect, issued_at_us: int) -> Scenarios:
    """The scenarios of the first file of a program; all findings on the program, its proofs included.

    Their missions are issued at a UTC time in us.
    """
    run = Compilation(program, dialect, issued_at_us)
    run.check()
    run.lowered(None)
    flights = run.scenarios()
    found = run.diagnostics()
    return Scenarios(() if run.report.failed() else flights, found, run.report.sources)
