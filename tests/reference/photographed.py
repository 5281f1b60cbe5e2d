"""Three jobs with a camera: the photo orbit of a turbine, the scan of a bridge's face, a grid over four hectares."""

from typing import NamedTuple

_HEAD = """
import "lib:skills/signals.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

vehicle quad {
  identity "m-1"  home 47.39774 N, 8.54559 E within 5 m  speed at most 12 m/s  climb at most 3 m/s
  position error 1 m  energy 100 % = 90 min hover  reserve 15 %
  camera mapper sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 every at least 700 ms exposure at most 1 ms
}
"""
_POLICY = """
policy rules version 1 {
  permit return_home, emergency_land, hover by any
  permit takeoff, photograph by role operator through agent
  contingency return_home, emergency_land
}
mission flight under rules@1 on quad {
  proposed by agent openclaw for role operator
  phase departure {
    takeoff(altitude = 20 m)
    {step}
    return_home()
  }
}
"""
_SIDEWAYS = """
skill photograph(
  structure: zone,
  lowest:    altitude in 8 m .. 60 m,
  highest:   altitude in 8 m .. 60 m,
  away:      length in 8 m .. 12 m = 10 m,
  apart:     length in 2 m .. 8 m = 8 m,
  pattern:   one of face, around,
  speed:     speed in 1 m/s .. 3 m/s = 3 m/s,
) {
  motion   cover structure from lowest to highest every apart distance away pattern pattern facing inward speed speed
  class    tactical  deadline 5 s  valid for 90 min  lasts at most 12 min
  pictures by mapper every 3 m resolution 4 mm overlap 60 % forward {side} % side blur 200 %
  fallback hover for 10 s, return_home, emergency_land
  energy   at most 35 %
  emits    MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW to gimbal with param1 = 0 deg, param2 = 0 deg at begin
           succeeds with attitude within 2 deg within 5 s
  emits    MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every 3 m succeeds with image within 3 s
}
"""
_DOWN = """
skill photograph(
  area:     zone,
  altitude: altitude in 40 m .. 60 m,
  speed:    speed in 1 m/s .. 8 m/s = 8 m/s,
) {
  motion   cover area at altitude speed speed
  class    tactical  deadline 5 s  valid for 90 min  lasts at most 12 min
  pictures by mapper every 8 m resolution 2 cm overlap 80 % forward 70 % side blur 100 %
  fallback hover for 10 s, return_home, emergency_land
  energy   at most 35 %
  emits    MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every 8 m succeeds with image within 3 s
}
"""


class Job(NamedTuple):
    """A job: its source, the spacing of its pictures in mm, and how many there are at least."""

    source: str
    spacing: int
    least: int


def _job(skill: str, zone: str, step: str, spacing: int, least: int) -> Job:
    return Job(f"{_HEAD}\n{zone}\n{skill}{_POLICY.replace('{step}', step)}", spacing, least)


JOBS = {
    "turbine": _job(
        _SIDEWAYS.replace("{side}", "0"),
        "zone turbine = difference(circle(47.3985 N, 8.5460 E, 40 m), circle(47.3985 N, 8.5460 E, 3 m)) ceiling 90 m",
        "photograph(turbine, 16 m, 32 m, pattern = around)", 3_000, 80,
    ),
    "bridge": _job(
        _SIDEWAYS.replace("{side}", "20"),
        "zone bridge = corridor(47.3980 N, 8.5455 E, 47.3980 N, 8.5466 E, width 60 m) ceiling 90 m",
        "photograph(bridge, 8 m, 20 m, apart = 6 m, pattern = face)", 3_000, 70,
    ),
    "grid": _job(
        _DOWN,
        "zone field = polygon(47.3982 N, 8.5445 E, 47.4000 N, 8.5445 E, 47.4000 N, 8.54716 E, "
        "47.3982 N, 8.54716 E) ceiling 90 m",
        "photograph(field, 50 m)", 8_000, 200,
    ),
}  # fmt: skip

#: a camera that loses a tenth of its pictures
LOSES = """
scenario "it loses a tenth" {
  flies  flight
  aboard px4, ardupilot
  at 0 s camera_loss(part = 10 %)
  expect ends completed
}
"""
