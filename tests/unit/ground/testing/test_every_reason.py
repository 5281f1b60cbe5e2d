"""Every reason of a decision is reached by a test in the language."""

import pytest

from reference.deciding import IMPORT, NOMINAL, WHEN, decided
from rtshcua.model.outcome import Reason, outcome_of
from virtual.rows import rows

#: a policy for reasons that the shipped one never gives
OWN = """import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/goto.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

vehicle slow {
  identity "slow-01"  home 47.39774 N, 8.54559 E within 50 m  speed at most 2 m/s  climb at most 1 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %  clock utc +02:00
}

policy own version 1 {
  permit any by any through agent, operator, onboard, reflex
  forbid goto by any when wind.speed > 11 m/s
  degrade goto when (wind.speed > 6 m/s for the last 3 s) to hover
  contingency return_home, emergency_land
}

nominal here {
  under own  on VEHICLE  by role operator
  at "2026-06-01T08:00:00Z"  phase departure
  given position = 47.39774 N, 8.54559 E, height = 20 m, battery = 80 %, gps.fix = fix_3d, wind.speed = 3 m/s
}
"""
QUAD, SLOW = OWN.replace("VEHICLE", "quad"), OWN.replace("VEHICLE", "slow")
GO = "when goto(bridge_a.entry, altitude = 20 m)"
LOW = "when inspect_area(bridge_a, altitude = 8 m)"

SHIPPED = IMPORT + NOMINAL
CASES = [
    (SHIPPED, (WHEN,), "allow admitted"),
    (SHIPPED, (WHEN, "tampered"), "deny integrity/binding-mismatch"),
    (SHIPPED, (WHEN, 'identity "quad-08"'), "deny integrity/wrong-vehicle"),
    (SHIPPED, (WHEN, "version 8 in force"), "deny integrity/policy-version"),
    (SHIPPED, (WHEN, "version 7 in force"), "allow admitted"),
    (SHIPPED, ("when inspect_area(bridge_a, altitude = 61 m)",), "deny integrity/argument-out-of-range"),
    (SHIPPED, ("when inspect_area(bridge_a, altitude = -1 m)",), "deny integrity/argument-out-of-range"),
    (SHIPPED, ("when inspect_area(bridge_a, 20 m, speed = 9 m/s)",), "deny integrity/argument-out-of-range"),
    (SHIPPED, (WHEN, "replayed"), "deny freshness/replayed"),
    (SHIPPED, (WHEN, "issued in 1 us"), "deny freshness/issued-in-future"),
    (SHIPPED, (WHEN, "issued 40 min ago"), "allow admitted"),
    (SHIPPED, (WHEN, "issued 2401 s ago"), "deny freshness/expired"),
    (SHIPPED, (WHEN, 'at "2026-06-01T08:00:00Z" within 1 s'), "defer freshness/clock-uncertain"),
    (SHIPPED, (WHEN, 'at "2026-06-01T08:00:00Z" within 1 s', "issued 1 s ago"), "allow admitted"),
    (SHIPPED, (WHEN + " through reflex",), "deny authority/class-not-permitted"),
    (SHIPPED, ("when goto(47.39729 N, 8.54771 E, 20 m)",), "deny authority/forbidden"),
    (QUAD, (GO, "given wind.speed = unknown"), "defer authority/forbid-unknown"),
    (SHIPPED, (WHEN + " by supervisor",), "deny authority/not-permitted"),
    (SHIPPED, (WHEN + " through onboard",), "deny authority/not-permitted"),
    (SHIPPED, ("when inspect_area(meadow, altitude = 20 m)",), "deny authority/out-of-scope"),
    (SHIPPED, (LOW, "given height = 8 m"), "defer approval/awaited"),
    (SHIPPED, (LOW, "given height = 8 m", "approved by role supervisor"), "allow admitted"),
    (SHIPPED, (LOW, "given height = 8 m", "approved by supervisor 3 s ago", "released 20 s ago"), "allow admitted"),
    (SHIPPED, (LOW, "approved by supervisor 11 s ago", "released 20 s ago"), "fallback hover for 10 s timing/no-slack"),
    (SHIPPED, (LOW, "approved by supervisor", "released 31 s ago"), "deny approval/timed-out"),
    (SHIPPED, (LOW, "refused by role supervisor"), "deny approval/refused"),
    (SHIPPED, (WHEN, "phase departure"), "defer context/phase-not-reached"),
    (SHIPPED, (WHEN, "phase recovery"), "deny context/phase-passed"),
    (SHIPPED, (WHEN, "released 4980 ms ago"), "allow admitted"),
    (SHIPPED, (WHEN, "released 4981 ms ago"), "fallback hover for 10 s timing/no-slack"),
    (SHIPPED, (WHEN, "given battery = 20 %"), "fallback return_home state/violated"),
    (SHIPPED, (WHEN, "given gps.fix = unknown"), "defer state/unknown"),
    (SHIPPED, (WHEN, "given gps.fix = fix_2d"), "defer state/unknown"),
    (SHIPPED, (WHEN, "given gps.fix = fix_3d measured 2 s ago"), "allow admitted"),
    (SHIPPED, (WHEN, "given gps.fix = fix_3d measured 2001 ms ago"), "defer state/unknown"),
    (SLOW, (GO,), "fallback hover for 10 s safety/envelope"),
    (SHIPPED, (WHEN, "given position = 47.30000 N, 8.54559 E"), "fallback hover for 10 s safety/airspace"),
    (SHIPPED, (WHEN, "given height = 30 m"), "fallback hover for 10 s safety/invariant-violated"),
    (SHIPPED, ("when hover(10 s)", "given battery = 10 %"), "fallback return_home safety/energy"),
    (SHIPPED, ("when hover(10 s)", "given battery = 24 %"), "fallback return_home safety/energy"),
    (SHIPPED, (WHEN, "given position = unknown"), "defer safety/unknown"),
    (QUAD, (GO, "given wind.speed = 7 m/s"), "fallback hover safety/degraded"),
    (QUAD, (GO, "given (wind.speed > 6 m/s for the last 3 s) = true"), "fallback hover safety/degraded"),
    (QUAD, (GO, "given (wind.speed>6 m/s for the last 3000 ms) = unknown"), "defer safety/unknown"),
    (QUAD, (GO, "given wind.speed = 7 m/s, (wind.speed > 6 m/s for the last 3 s) = false"), "allow admitted"),
]


@pytest.mark.slow
@rows(("before", "parts", "expected"), CASES, ids=[" ".join(case[1])[-60:] for case in CASES])
def test_case_is_met(before: str, parts: tuple[str, ...], expected: str) -> None:
    assert decided(*parts, before=before) == expected


def test_every_reason_is_reached() -> None:
    assert {expected.split()[-1] for _, _, expected in CASES} == {reason.value for reason in Reason}


def test_each_reason_has_its_one_outcome() -> None:
    for _, _, expected in CASES:
        words = expected.split()
        assert outcome_of(Reason(words[-1])).name.lower() == words[0]
