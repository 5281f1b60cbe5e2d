"""Missions with each of the seven published deadlines compile, get reports at the needed rates, and fly."""

from pathlib import Path

import pytest

from rtshcua.app.programs import compile_sources
from rtshcua.onboard.ports import Ending
from virtual import case
from virtual.flight import Flight
from virtual.sampling import each_once
from virtual.shipped import simulated

#: of the published evaluation, in ms
DEADLINES = (100, 200, 300, 500, 750, 1_000, 1_500)

MISSION = """
import "lib:policies/training_field.rts"

mission short under training_field@2 on quad {{
  intent   "Take off, look around for a moment, come home."
  proposed by agent openclaw for role operator

  phase departure {{
    takeoff(altitude = 10 m) {{ deadline {deadline} ms }}
  }}
  phase inspection {{
    hover(5 s) {{ deadline {deadline} ms }}
  }}
  phase recovery {{
    return_home() {{ deadline {deadline} ms }}
  }}
}}
"""


@pytest.mark.slow
@pytest.mark.parametrize(("deadline", "flavour"), each_once(DEADLINES, ("px4", "ardupilot")))
def test_mission_of_each_published_deadline_flies(tmp_path: Path, deadline: int, flavour: str) -> None:
    source = tmp_path / "short.rts"
    source.write_text(MISSION.format(deadline=deadline))
    compiled, _ = compile_sources([source], mission=None, issued_at_us=case.flat.ISSUED)
    assert compiled.policy is not None, [each.message for each in compiled.diagnostics]
    assert compiled.mission is not None
    assert [each.contract.deadline_us for each in compiled.mission.invocations] == [deadline * 1_000] * 3
    bundle = case.seal(compiled.mission, compiled.policy)
    flight = Flight(bundle, simulated(flavour))
    flown = flight.fly()
    assert flown.ending is Ending.COMPLETED
    assert [(step, outcome) for step, outcome, _ in flown.decisions()] == [(0, "allow"), (1, "allow"), (2, "allow")]
    asked = flight.vehicle.driver.stream_requests.plan.intervals
    for message in ("GPS_RAW_INT", "EXTENDED_SYS_STATE", "BATTERY_STATUS", "GLOBAL_POSITION_INT"):
        assert asked[message] <= deadline * 1_000 // 2, f"{message}: two reports within the deadline"
    delivery = [each["detail"] for each in flown.effects("noted") if each["detail"].startswith("streams: ")]
    assert len(delivery) == 1, "what was asked for and what came is recorded"
    assert "too seldom" not in delivery[0]
