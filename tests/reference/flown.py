"""Fly the scenarios of a program and return their findings."""

from rtshcua.app.testing.flying import Flying
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.mavlink import dialect


def flown(program: Program) -> tuple[Diagnostic, ...]:
    """Return the findings about flights that differ from the expectations."""
    found = scenarios(program, dialect.load(), 0).found
    return tuple(each for one in Flying(with_coverage=False, say=lambda text: None).fly(found) for each in one.findings)
