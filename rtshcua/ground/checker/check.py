"""All checks of declarations, in the order in which a reader wants to hear of them."""

from rtshcua.ground.checker.checks import (
    contracts,
    durability,
    fallbacks,
    missions,
    names,
    nominals,
    parameters,
    policies,
    records,
    roles,
    scenarios,
    signals,
    sizes,
    tests,
    times,
    vehicles,
    zones,
)
from rtshcua.ground.checker.context import Context

CHECKS = (
    names,
    signals,
    zones,
    vehicles,
    parameters,
    sizes,
    contracts,
    fallbacks,
    roles,
    policies,
    missions,
    times,
    records,
    durability,
    nominals,
    tests,
    scenarios,
)


def check_declarations(context: Context) -> None:
    """Report everything that is wrong with the declarations of a program."""
    for each in CHECKS:
        each.check(context)
