"""A project for lint tests: a policy with one finding, and two missions with another."""

from collections.abc import Callable
from pathlib import Path

#: an unused import that is safe to delete, since it is repeated below
UNUSED = 'import  "lib:skills/hover.rts"'
POLICY = f"""import "lib:policies/site.rts"
{UNUSED}
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

policy meadow_flight version 2 {{
  permit takeoff by role operator through agent when altitude <= 15 m
  permit hover, return_home, emergency_land by any
  airspace inside meadow
  contingency return_home, emergency_land
}}
"""
MISSION = """import "policy.rts"

mission Look under meadow_flight@2 on quad {
  proposed by agent openclaw for role operator
  phase departure  { takeoff(altitude = 10 m) }
  phase inspection { hover(5 s) }
  phase recovery   { return_home() }
}
"""
#: the expected findings: code and file
HABITS = [("E1302", "one.rts"), ("E1305", "policy.rts"), ("E1302", "two.rts")]

Lint = Callable[..., tuple[int, list[tuple[str, str]]]]


def put(files: dict[str, str]) -> None:
    for name, text in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")
