"""A mission may begin in flight: it is proved from the place, the charge and the speeds of that moment."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from rtshcua.app.propose import Missions, ProposalAnswer
from rtshcua.ground.prove.step_starts import FROM_HOME, MissionStart, StartPlace

CHECKOUT = Path(__file__).resolve().parents[4]
PROPOSAL = json.loads((CHECKOUT / "missions/proposal.json").read_text("utf-8"))
ISSUED_US = 1_780_000_000_000_000

#: over home, 25 m up
OVER_HOME = StartPlace(0, 0, 25_000, aloft=True)


@pytest.fixture(scope="module")
def missions() -> Missions:
    return Missions([CHECKOUT / "policies/bridge_inspection.rts"])


def checked(missions: Missions, start: MissionStart, *steps: dict[str, Any]) -> ProposalAnswer:
    mission = deepcopy(PROPOSAL) | {"phases": [{"name": "inspection", "steps": [*steps]}]}
    return missions.check(mission, ISSUED_US, start)


def goto(target: str) -> dict[str, Any]:
    return {"skill": "goto", "arguments": {"target": target, "altitude": "25 m"}}


def codes(answer: ProposalAnswer) -> list[str]:
    return [each["code"] for each in answer.rejections]


def test_a_step_that_needs_the_air_begins_in_the_air(missions: Missions) -> None:
    assert codes(checked(missions, FROM_HOME, goto("bridge_b.entry"))) == ["E0619"]
    assert checked(missions, MissionStart(OVER_HOME), goto("bridge_b.entry")).accepted


def test_the_charge_is_the_present_one(missions: Missions) -> None:
    assert checked(missions, MissionStart(OVER_HOME, charge=6_000), goto("bridge_b.entry")).accepted
    refused = checked(missions, MissionStart(OVER_HOME, charge=2_700), goto("bridge_b.entry"))
    assert codes(refused) == ["E0620"]
    assert "27 %" in refused.rejections[0]["repair"]


def test_the_path_begins_at_the_present_place(missions: Missions) -> None:
    # east of the school, which lies on the straight way to bridge B
    behind = StartPlace(240_000, -50_000, 25_000, aloft=True)
    assert codes(checked(missions, MissionStart(behind), goto("bridge_b.entry"))) == ["E0508"]
    assert checked(missions, MissionStart(OVER_HOME), goto("bridge_b.entry")).accepted


def test_the_way_home_is_as_slow_as_an_earlier_step(missions: Missions) -> None:
    quick, slow = MissionStart(OVER_HOME, charge=3_400), MissionStart(OVER_HOME, charge=3_400, speed=1_000)
    assert checked(missions, quick, goto("bridge_b.entry")).accepted
    assert "E0620" in codes(checked(missions, slow, goto("bridge_b.entry")))
