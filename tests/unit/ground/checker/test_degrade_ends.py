"""The target of a `degrade` rule must end, because its chain follows."""

import pytest

from reference.sources import found, policy, program, skill


@pytest.mark.parametrize(
    ("target", "codes"),
    [("stay", ["E0611"]), ("stay for 10 s", []), ("return_home", []), ("emergency_land", [])],
)
def test_degrade_target_must_end(target: str, codes: list[str]) -> None:
    rule = f"degrade goto when battery < 30 % to {target}"
    assert [code for code, _ in found(program(skill("stay()", lasts=""), policy(rule)))] == codes
