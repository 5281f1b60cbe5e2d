"""A step of a mission in JSON is shown as a source would write it, not as the agent's JSON."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from rtshcua.app.fly.narrator import plan_of
from rtshcua.app.programs import compile_sources
from rtshcua.onboard.calls import call

CHECKOUT = Path(__file__).resolve().parents[5]


@pytest.mark.parametrize(
    ("mission", "first"),
    [("proposal.json", "takeoff(altitude = 25 m)"), ("standard.rts", "takeoff(altitude = 20 m)")],
)
def test_steps_are_calls(mission: str, first: str) -> None:
    compiled, _ = compile_sources([CHECKOUT / "missions" / mission], mission=None, issued_at_us=0)
    assert compiled.mission is not None
    assert compiled.policy is not None
    plan = plan_of(compiled.policy, compiled.mission, mode="software", speed=1.0)
    assert plan.steps[0].text == first
    assert not any("{" in step.text for step in plan.steps)


def test_a_text_that_lies_about_the_arguments_is_not_shown() -> None:
    compiled, _ = compile_sources([CHECKOUT / "missions" / "standard.rts"], mission=None, issued_at_us=0)
    assert compiled.mission is not None
    assert compiled.policy is not None
    first, *others = compiled.mission.invocations
    lying = replace(first, text="takeoff(altitude = 2 m)")
    mission = replace(compiled.mission, invocations=(lying, *others))
    assert plan_of(compiled.policy, mission, mode="software", speed=1.0).steps[0].text == "takeoff(altitude = 20 m)"
    assert call(compiled.policy, replace(lying, skill=99)) == "not a call of a skill of the policy"
