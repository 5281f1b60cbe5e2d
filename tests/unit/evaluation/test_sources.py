"""The programs of the evaluation: all 21 points compile, and what the cases strike is what the evaluation says."""

import pytest

from rtshcua import library
from rtshcua.evaluation.design import DEADLINES_US, MISSIONS, POINTS
from rtshcua.evaluation.sources import RADIO_US, SHIPPED_US, compiled, fitted, source
from rtshcua.model.flat.contract import Contract
from rtshcua.simulation.config import EQUIPPED
from virtual import case

SKILLS = {
    "short": ["takeoff", "hover", "return_home"],
    "standard": ["takeoff", "goto", "inspect_area", "inspect_area", "hover", "return_home"],
    "extended": [
        "takeoff", "hover", "goto", "inspect_area", "hover", "hover", "goto", "inspect_area", "hover", "goto", "hover",
        "return_home",
    ],
}  # fmt: skip


def conditions(contract: Contract) -> set[str]:
    return {clause.text for clause in (*contract.require, *contract.assume)}


def test_each_point_compiles_with_its_deadline_on_each_step() -> None:
    assert len(POINTS) == 21
    for point in POINTS:
        policy, mission = compiled(*point, case.flat.ISSUED)
        assert mission.name == point.mission
        assert [policy.contracts[step.skill].name for step in mission.invocations] == SKILLS[point.mission]
        assert {step.contract.deadline_us for step in mission.invocations} == {point.deadline_us}
        assert policy.vehicle.without == ()


def test_text_of_a_point_differs_in_the_deadlines_only() -> None:
    for mission in MISSIONS:
        written = (library.root() / "evaluation" / f"{mission}.rts").read_text(encoding="utf-8")
        assert source(mission, SHIPPED_US) == written
        for deadline_us in DEADLINES_US:
            text = source(mission, deadline_us)
            assert text.count("deadline") == len(SKILLS[mission])
            assert text.count(f"{{ deadline {deadline_us // 1_000} ms }}") in (0, len(SKILLS[mission]))


def test_struck_skills_assume_what_the_cases_disturb() -> None:
    policy, _ = compiled("standard", SHIPPED_US, case.flat.ISSUED)
    contracts = {contract.name: contract for contract in policy.contracts}
    for name, clearance in (("inspect_area", "3 m + speed * 2 s"), ("hover", "3 m")):
        assert conditions(contracts[name]) == {
            "battery >= 35 %", "gps.fix >= fix_3d", "link.quality >= 40 %", "wind.speed <= 10 m/s",
            f"obstacle.distance > {clearance}",
        }  # fmt: skip
    chain = [policy.contracts[link.skill].name for link in contracts["inspect_area"].fallback]
    assert chain == ["hover", "return_home", "emergency_land"]


def test_impossible_deadline_is_an_error_with_its_code() -> None:
    with pytest.raises(ValueError, match=r"E0717: .* waits at most 49 ms"):
        compiled("standard", 49_000, case.flat.ISSUED)


def test_radio_of_the_simulated_vehicle_reports_as_the_signals_declare() -> None:
    declared = (library.root() / "evaluation" / "signals.rts").read_text(encoding="utf-8")
    assert f"RADIO_STATUS.txbuf  unknown at 255  every {RADIO_US // 1_000} ms" in declared
    policy, _ = compiled("short", SHIPPED_US, case.flat.ISSUED)
    vehicle = fitted(policy, seed=7)
    assert (vehicle.radio_us, vehicle.seed) == (RADIO_US, 7)
    assert vehicle.extras == EQUIPPED
