"""What the scenarios of a program find when they are flown."""

from rtshcua.app.testing.flying import Flying
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.mavlink import dialect


def flown(program: Program) -> tuple[Diagnostic, ...]:
    """The findings on flights that are not as expected."""
    found = scenarios(program, dialect.load(), 0).found
    return tuple(each for one in Flying(with_coverage=False, say=lambda text: None).fly(found) for each in one.findings)
