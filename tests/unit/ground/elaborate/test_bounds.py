"""Bounds of a mission, computed by hand."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from rtshcua.front.cli.render.bounds import bounds_told
from rtshcua.ground.pipeline.program import Checked, Compiled
from rtshcua.ground.prove.mission_bounds import Bounds, _taken, greatest, rounded_energy, rounded_time

Compile = Callable[..., Compiled]
Check = Callable[[str], Checked]

SECOND = 1_000_000


def mission(header: str = "", steps: str = "hover(5 s)", confirm: str = "") -> str:
    return f"""
policy p version 1 {{
  permit takeoff by role operator through agent
  permit hover, return_home, emergency_land by any
  {confirm}
  contingency hover for 10 s, return_home, emergency_land
}}
mission m under p@1 on quad {{
  proposed by agent openclaw for role operator
  {header}
  phase departure {{ takeoff(altitude = 10 m)  {steps}  return_home() }}
}}
"""


def chain_us(compiled: Compiled) -> int:
    assert compiled.policy is not None
    contracts = compiled.policy.contracts
    chains = [compiled.policy.contingency, *(contract.fallback for contract in contracts)]
    return max(sum(link.limit_us or contracts[link.skill].duration_us for link in chain) for chain in chains)


def chain_energy(compiled: Compiled) -> int:
    assert compiled.policy is not None
    contracts = compiled.policy.contracts
    chains = [compiled.policy.contingency, *(contract.fallback for contract in contracts)]
    return max(sum(contracts[link.skill].energy for link in chain) for chain in chains)


@pytest.mark.parametrize("waits", [0, 30])
def test_bounds_are_sums_over_all_steps(compile_text: Compile, site: str, waits: int) -> None:
    confirm = f"confirm hover when height > 2 m by role operator within {waits} s" if waits else ""
    compiled = compile_text(site + mission(confirm=confirm))
    assert compiled.mission is not None, compiled.diagnostics
    steps = [step.contract for step in compiled.mission.invocations]
    time = 300 * SECOND + sum(step.deadline_us + step.duration_us for step in steps) + waits * SECOND
    assert compiled.bounds is not None
    assert compiled.bounds.invocations == 3
    assert compiled.bounds.time_us == time + chain_us(compiled)
    # `takeoff`, `hover` and the contingency: more than all steps and what follows a return that fails
    assert compiled.bounds.energy == sum(step.energy for step in steps[:2]) + chain_energy(compiled)


def test_bound_of_a_return_includes_the_way_home(compile_text: Compile, site: str) -> None:
    """The bound is the contract's, or the way from the farthest planned place if that is more."""
    compiled = compile_text(site + mission())
    assert compiled.mission is not None
    taken = [_taken(replace(step.contract, energy=300), 309) for step in compiled.mission.invocations]
    assert taken == [300, 300, 309]
    assert _taken(compiled.mission.invocations[-1].contract, 309) == 1700


def test_overridden_step_counts_with_its_own_bounds(compile_text: Compile, site: str) -> None:
    plain = compile_text(site + mission()).bounds
    own = compile_text(
        site + mission(steps="hover(5 s) { deadline 1 s  lasts at most 10 s  energy at most 6 % }")
    ).bounds
    assert plain is not None
    assert own is not None
    assert plain.time_us - own.time_us == (4 + 25) * SECOND
    assert own.energy - plain.energy == 200


@pytest.mark.parametrize(
    ("header", "codes"),
    [
        ("steps at most 3  lasts at most 1 h  energy at most 100 %", []),
        ("steps at most 2", ["E0810"]),
        ("lasts at most 5 min", ["E0809"]),
        ("energy at most 1 %", ["E0811"]),
        ("lasts at most 5 m", ["E0310"]),
        ("energy at most 5 m", ["E0310"]),
        ("lasts at most 0 s", ["E0319"]),
    ],
)
def test_bounds_are_compared_with_the_declared_limits(
    check_text: Check, site: str, header: str, codes: list[str]
) -> None:
    assert [each.code.id for each in check_text(site + mission(header)).diagnostics] == codes


def test_bound_equal_to_the_limit_is_accepted(compile_text: Compile, check_text: Check, site: str) -> None:
    bounds = compile_text(site + mission()).bounds
    assert bounds is not None
    for less, codes in ((0, []), (1, ["E0809"])):
        header = f"lasts at most {bounds.time_us - less} us"
        assert [each.code.id for each in check_text(site + mission(header)).diagnostics] == codes


def test_finding_shows_the_largest_steps_once(check_text: Check, site: str) -> None:
    text = site + mission("energy at most 1 %", steps="repeat 4 { hover(5 s) }")
    found = check_text(text).diagnostics[0]
    assert [(text[label.span.start : label.span.end], label.text) for label in found.labels] == [
        ("return_home()", "up to 17 %"),
        ("hover(5 s)", "up to 16 %, 4 times 4 %"),
        ("takeoff(altitude = 10 m)", "up to 4 %"),
    ]


def test_bounds_of_a_mission_with_parameters_are_the_largest() -> None:
    assert greatest(Bounds(3, 5, 9), None) == Bounds(3, 5, 9)
    assert greatest(Bounds(3, 5, 9), Bounds(4, 4, 10)) == Bounds(4, 5, 10)


def test_bounds_are_shown_on_one_line() -> None:
    assert (
        bounds_told(Bounds(1, 59 * SECOND + 1, 101)) == "at most 1 step, 1 min from issue to end, 2 % of a full charge"
    )
    assert [rounded_time(us) for us in (0, 1, 61 * SECOND)] == ["0 s", "1 s", "1 min 1 s"]
    assert [rounded_energy(energy) for energy in (0, 1, 100, 12_345)] == ["0 %", "1 %", "1 %", "124 %"]
