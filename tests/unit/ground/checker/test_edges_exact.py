"""An edge needs its condition exactly, so it cannot read a zone with an inexact band."""

from pathlib import Path

import pytest

from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).parents[4]

SOURCE = """
import "lib:skills/signals.rts"
import "lib:skills/return_home.rts"
import "lib:skills/hover.rts"
import "lib:skills/emergency_land.rts"
vehicle glider {
  identity "g-1"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %  elevation 400 m above sea WITHIN
}
zone layer = circle(47.3977 N, 8.5456 E, 200 m) floor FLOOR ceiling 440 m above sea
role watcher
policy p version 1 {
  permit hover by role watcher through agent when CONDITION
  permit hover, return_home, emergency_land by any
  contingency emergency_land
}
"""


@pytest.mark.parametrize(
    ("within", "floor", "condition", "codes"),
    [
        ("within 5 m", "10 m", "rising position inside layer", {"E0320"}),
        ("within 5 m", "410 m above sea", "(falling position outside layer) within the last 3 s", {"E0320"}),
        ("within 5 m", "410 m above sea", "position inside layer for the last 3 s", set()),
        ("", "410 m above sea", "rising position inside layer", set()),
    ],
)
def test_edge_refuses_an_inexact_band(within: str, floor: str, condition: str, codes: set[str]) -> None:
    text = SOURCE.replace("WITHIN", within).replace("FLOOR", floor).replace("CONDITION", condition)

    def read(path: str) -> bytes:
        return text.encode() if path == "x.rts" else Path(path).read_bytes()

    found = check_program(load(["x.rts"], read, str(CHECKOUT)), dialect.load())
    assert {each.code.id for each in found if each.code.severity.value == "error"} == codes
