"""A small policy with a nominal, and tests of it, as text."""

POLICY = """import "lib:policies/site.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

policy yard version 1 {
  permit  hover by role operator through agent when battery > 50 %
  permit  return_home, emergency_land by any
  forbid  hover by any when battery > 90 %
  contingency return_home, emergency_land
}

nominal noon {
  under yard on quad by role operator through agent at "2026-06-01T10:00:00Z" phase flight
  given battery = 80 %, gps.fix = fix_3d, position = 47.39774 N, 8.54559 E, height = 10 m
  given velocity.north = 0 m/s, velocity.east = 0 m/s, velocity.down = 0 m/s
}
"""
TESTS = """import "policy.rts"

test "hovering" {
  when hover(10 s)
  table battery {
    60 %    expect allow
    40 %    expect deny because authority/out-of-scope
    unknown expect deny
  }
}
test "coming home" { when return_home() by role operator through operator  expect allow }
"""
