"""Each figure of a vehicle is of its dimension, and a reserve leaves something to fly with."""

from reference.sources import found
from virtual.rows import rows

VEHICLE = """
vehicle glider {
  identity "g-1"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %  elevation 400 m above sea within 5 m
}
"""


@rows(
    ("old", "new", "codes"),
    [
        ("", "", []),
        ("within 50 m", "within 50 s", ["E0310"]),
        ("12 m/s", "12 m", ["E0310"]),
        ("3 m/s", "3 s", ["E0310"]),
        ("error 3 m", "error 3 s", ["E0310"]),
        ("error 3 m", "error 0 m", []),
        ("18 min", "18 m", ["E0310"]),
        ("reserve 15 %", "reserve 15 s", ["E0310"]),
        ("reserve 15 %", "reserve 0 %", []),
        ("reserve 15 %", "reserve 99.99 %", []),
        ("reserve 15 %", "reserve 100 %", ["E1003"]),
        ("within 5 m", "within 5 s", ["E0310"]),
    ],
)
def test_a_vehicle(old: str, new: str, codes: list[str]) -> None:
    assert [code for code, _ in found(VEHICLE.replace(f"{old} ", f"{new} ").replace(f"{old}\n", f"{new}\n"))] == codes
