"""Runs all checks of declarations, in the order in which findings are most useful."""

from rtshcua.ground.checker.checks.accepts import check_accepts
from rtshcua.ground.checker.checks.contracts import check_contracts, check_durability, check_fallbacks, check_records
from rtshcua.ground.checker.checks.emits import check_emits
from rtshcua.ground.checker.checks.missions import check_missions
from rtshcua.ground.checker.checks.names import check_names
from rtshcua.ground.checker.checks.parameters import check_parameters, check_sizes
from rtshcua.ground.checker.checks.policies import check_policies
from rtshcua.ground.checker.checks.premises import check_nominals
from rtshcua.ground.checker.checks.roles import check_roles
from rtshcua.ground.checker.checks.scenarios import check_scenarios
from rtshcua.ground.checker.checks.signals import check_signals
from rtshcua.ground.checker.checks.survey_demands import check_survey_demands
from rtshcua.ground.checker.checks.tests import check_tests
from rtshcua.ground.checker.checks.times import check_times
from rtshcua.ground.checker.checks.vehicles import check_vehicles
from rtshcua.ground.checker.checks.zones import check_zones
from rtshcua.ground.checker.context import CheckContext

CHECKS = (
    check_names,
    check_signals,
    check_zones,
    check_vehicles,
    check_parameters,
    check_sizes,
    check_contracts,
    check_fallbacks,
    check_roles,
    check_policies,
    check_missions,
    check_times,
    check_records,
    check_durability,
    check_accepts,
    check_survey_demands,
    check_emits,
    check_nominals,
    check_tests,
    check_scenarios,
)


def check_declarations(context: CheckContext) -> None:
    """Report all findings on the declarations of a program."""
    for check in CHECKS:
        check(context)
