"""A nominal names a policy and a vehicle that exist, and gives what they can have."""

from rtshcua.ground.checker.checks.premises import check_asker, check_premises
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.lookup import find_policy, find_vehicle


def check_nominals(context: Context) -> None:
    """Report every nominal whose parts do not exist or do not fit."""
    for nominal in context.symbols.nominals.values():
        find_policy(context, nominal.policy)
        find_vehicle(context, nominal.vehicle)
        check_asker(context, nominal.asker)
        check_premises(context, nominal.premises)
