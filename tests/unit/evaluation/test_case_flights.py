"""X3 in flight: what is dispatched after a case strikes, and a runtime that does otherwise is found."""

import pytest
from msgspec.structs import replace

from rtshcua.evaluation import case_flights
from rtshcua.evaluation.case_flights import FLAVOURS, ON_GROUND, units
from rtshcua.evaluation.cases import CASES
from rtshcua.evaluation.design import POINTS, WorkUnit
from rtshcua.evaluation.results import CaseFlight
from rtshcua.model.decision import Decision
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.enforcement.boundary import SoftwareBoundary
from virtual.rows import rows


def flown(case: str, *point: str | int, flavour: str = "px4", place: str = "aloft") -> CaseFlight:
    (found,) = case_flights.run(WorkUnit("X3", ("flight", case, *(point or ("standard", 1_000_000)), flavour, place)))
    return found


def test_each_case_flies_with_each_flavour_at_points_of_each_mission() -> None:
    found = units()
    assert len(found) == len(FLAVOURS) * (len(CASES) + len(ON_GROUND))
    assert {unit.key[1] for unit in found} == {case.name for case in CASES}
    assert {unit.key[2] for unit in found} == {point.mission for point in POINTS}
    assert len(units(POINTS)) == len(POINTS) * len(found)


@rows("name", [case.name for case in ON_GROUND if case.outcome is not Outcome.ALLOW])
def test_nothing_is_dispatched_on_the_ground(name: str) -> None:
    found = flown(name, place="ground", flavour=FLAVOURS[len(name) % 2])
    assert (found.holds, found.differs, found.dispatched, found.ending) == (True, "", (), "refused")


@pytest.mark.slow
def test_takeoff_that_is_not_to_happen_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    step = SoftwareBoundary._permit

    def generous(self: SoftwareBoundary, prepared: object, decision: Decision, now_us: int) -> bytes:
        return step(self, prepared, replace(decision, outcome=Outcome.ALLOW, valid_until_us=now_us + 500_000), now_us)  # type: ignore[arg-type]

    monkeypatch.setattr(SoftwareBoundary, "_permit", generous)
    found = flown("low battery", place="ground")
    assert not found.holds
    assert found.differs == "something was dispatched on the ground, or the vehicle was armed"


@pytest.mark.slow
@pytest.mark.parametrize(("name", "flavour"), [("low battery", "px4"), ("GPS missing", "ardupilot"), ("replay", "px4")])
def test_case_in_the_air(name: str, flavour: str) -> None:
    found = flown(name, "short", 300_000, flavour=flavour)
    assert (found.holds, found.differs) == (True, "")


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_what_a_step_maintains_ends_its_wait_before_a_longer_deadline(flavour: str) -> None:
    """The survey maintains its place, with a grace of 1 s: a position that stays stale ends the wait then."""
    found = flown("stale state", "standard", 1_500_000, flavour=flavour)
    assert (found.holds, found.differs, found.dispatched) == (True, "", ("hover", "hover", "emergency_land"))


@pytest.mark.slow
def test_wait_that_ends_at_another_time_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(case_flights, "_waits_us", lambda *_: 500_000)
    assert "us after it had to be" in flown("stale state", "standard", 1_500_000).differs
    monkeypatch.setattr(case_flights, "_waits_us", lambda *_: 1_500_000)
    assert "not (1, 2, 0)" in flown("stale state", "standard", 1_500_000).differs


@pytest.mark.slow
def test_other_reason_or_link_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    cases = {each.name: each for each in CASES}
    other = cases["low battery"]._replace(reason=Reason.ENERGY)
    monkeypatch.setattr(case_flights, "BY_NAME", cases | {"low battery": other})
    monkeypatch.setattr(case_flights, "_link", lambda *_: 1)
    found = flown("low battery", "short", 300_000)
    assert not found.holds
    assert found.differs.startswith("decided: fallback because state/violated; dispatched first: [Dispatched(")


@pytest.mark.soak
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_each_case_at_each_point(flavour: str) -> None:
    asked = [unit for unit in units(POINTS) if unit.key[4] == flavour]
    found = [result for unit in asked for result in case_flights.run(unit)]
    assert [f"{each.case} {each.mission} {each.deadline_us}: {each.differs}" for each in found if not each.holds] == []
    assert len(found) == len(asked)
