"""Whether a bundle fits in a home of the boundary with little memory. Its C refuses what does not, without a reason."""

from collections.abc import Iterator, Mapping

from rtshcua.decision.checks.zones import vertices
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy


def exceeded(policy: Policy, mission: Mission, octets: int, limits: Mapping[str, int]) -> tuple[str, ...]:
    """What of a bundle of so many octets does not fit under such limits, each in words; empty where all of it does."""
    return tuple(
        f"{count:,} {what} (at most {limits[name]:,})"
        for name, what, count in _counted(policy, mission, octets)
        if count > limits[name]
    )


def _counted(policy: Policy, mission: Mission, octets: int) -> Iterator[tuple[str, str, int]]:
    yield "MAX_BUNDLE", "octets", octets
    yield "MAX_INVOCATIONS", "steps", len(mission.invocations)
    yield "MAX_RULES", "rules", len(policy.rules)
    yield "MAX_ROLES", "roles", len(policy.roles)
    yield "MAX_CONTRACTS", "skills", len(policy.contracts)
    yield "MAX_ZONES", "zones, with those grown from others", len(policy.zones)
    yield "MAX_TOTAL_VERTICES", "corners of zones", sum(map(vertices, policy.zones))
    yield "MAX_TABLES", "margins by which zones of arguments grow", len(policy.tables)
    yield "MAX_SETS", "sets of values in conditions", len(policy.sets)
