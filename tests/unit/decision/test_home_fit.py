"""What of a bundle does not fit in a home of the boundary with little memory."""

import pytest
from msgspec.structs import replace

from reference.flat_case import MISSION, POLICY
from rtshcua.decision.checks.home_fit import exceeded
from rtshcua.model.flat.home_limits import TRUSTZONE_M


def test_small_bundle_fits() -> None:
    assert exceeded(POLICY, MISSION, 1 << 16, TRUSTZONE_M) == ()


def test_every_exceeded_limit_is_named() -> None:
    policy = replace(POLICY, rules=POLICY.rules * 129, roles=POLICY.roles * 17)
    mission = replace(MISSION, invocations=MISSION.invocations[:1] * 65)
    found = exceeded(policy, mission, 65_537, TRUSTZONE_M)
    assert found[:2] == ("65,537 octets (at most 65,536)", "65 steps (at most 64)")
    assert found[2].endswith(" rules (at most 128)")
    assert found[3].endswith(" roles (at most 16)")


@pytest.mark.parametrize("name", ["MAX_CONTRACTS", "MAX_ZONES", "MAX_TOTAL_VERTICES", "MAX_TABLES", "MAX_SETS"])
def test_limit_of_the_policy_is_compared(name: str) -> None:
    counts = {
        "MAX_CONTRACTS": len(POLICY.contracts), "MAX_ZONES": len(POLICY.zones), "MAX_TOTAL_VERTICES": 4,
        "MAX_TABLES": len(POLICY.tables), "MAX_SETS": len(POLICY.sets),
    }  # fmt: skip
    limits = {**TRUSTZONE_M, name: counts[name] - 1}
    assert len(exceeded(POLICY, MISSION, 0, limits)) == (counts[name] > 0)
