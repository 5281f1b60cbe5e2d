"""Conditions over time, also nested ones, in a state that has lasted."""

from reference.deciding import made
from rtshcua.decision.temporal import initial, lasting, observe
from rtshcua.model.flat.limits import MAX_GAP, MAX_WINDOW
from rtshcua.model.flat.situation import Now, State

POLICY = """import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

role supervisor
policy stacked version 1 {
  permit any by any
  forbid hover by any when ((wind.speed > 6 m/s for the last 8 min) within the last 9 min) for the last 10 min
  forbid hover by any when rising battery < 30 % within the last 200 ms or falling battery < 30 %
  confirm hover when battery < 40 % within 2 s of wind.speed > 9 m/s by role supervisor within 30 s
  contingency return_home, emergency_land
}
nominal here {
  under stacked on quad by role operator at "2026-06-01T08:00:00Z" phase departure
  given battery = 80 %, wind.speed = 3 m/s, position = 47.39774 N, 8.54559 E, height = 5 m, gps.fix = fix_3d
}
test "it" {
  when hover(1 s)
  table wind.speed, battery {
    3 m/s, 80 %  expect allow
    7 m/s, 20 %  expect allow
    10 m/s, 35 %  expect allow
    unknown, 80 %  expect allow
  }
}
"""


def test_lasting_state_equals_one_observed_longer_than_every_window() -> None:
    suite = made(POLICY, "")
    assert suite.diagnostics == ()
    seen = set()
    for case in suite.cases:
        policy, bare = case.policy.prepared, State(case.state.values, case.state.ages)
        memory, monitors = initial(policy), bare.monitors
        for at_us in range(0, 4 * MAX_WINDOW, MAX_GAP):
            memory, monitors = observe(memory, policy, bare, Now(at_us, case.now.utc_us, 0))
        assert case.state.monitors == monitors == lasting(bare, policy, case.now).monitors
        seen.add(monitors)
    assert len(seen) == len(suite.cases)
