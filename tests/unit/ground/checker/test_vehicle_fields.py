"""Fields of a vehicle must have their dimension and a valid value."""

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
def test_invalid_vehicle_fields_are_reported(old: str, new: str, codes: list[str]) -> None:
    assert [code for code, _ in found(VEHICLE.replace(f"{old} ", f"{new} ").replace(f"{old}\n", f"{new}\n"))] == codes


@rows(
    ("parts", "codes"),
    [
        ("speeds cruise 12 m/s, climb 3 m/s, descent 9 m/s, landing 0.5 m/s below 0 m, return 12 m/s, air 20 m/s", []),
        ("speeds cruise 13 m/s", ["E1003"]),
        ("speeds return 13 m/s", ["E1003"]),
        ("speeds climb 4 m/s", ["E1003"]),
        ("speeds cruise 0 m/s", ["E0319"]),
        ("speeds cruise 5 m", ["E0310"]),
        ("speeds landing 0.5 m/s below 5 s", ["E0310"]),
        ("speeds cruise 5 m/s below 10 m", ["E0101"]),
        ("speeds cruise 5 m/s, cruise 6 m/s", ["E0106"]),
        ("speeds crusie 5 m/s", ["E0201"]),
        ("accelerates to 5 m/s in 5 s", []),
        ("accelerates to 5 m/s in 0 s", ["E0319"]),
        ("accelerates to 5 m in 5 s", ["E0310"]),
        ("accelerates to 0.001 m/s in 5 s", ["E1003"]),
        ("wind at most 11.9 m/s", []),
        ("wind at most 0 m/s", []),
        ("wind at most 12 m/s", ["E1003"]),
        ("wind at most 12 m/s  speeds air 13 m/s", []),
        ("wind at most 12 s", ["E0310"]),
    ],
)
def test_invalid_speeds_are_reported(parts: str, codes: list[str]) -> None:
    assert [code for code, _ in found(VEHICLE.replace("reserve", f"{parts}  reserve"))] == codes


def test_misspelt_speed_is_corrected() -> None:
    [(_, message)] = found(VEHICLE.replace("reserve", "speeds crusie 5 m/s  reserve"))
    assert message == "unknown speed `crusie`"


@rows(
    ("hover", "codes"),
    [
        ("18 min hover, 15 min flight", []),
        ("18 min hover, 15 m flight", ["E0310"]),
        ("18 min hover, 0 min flight", ["E0319"]),
    ],
)
def test_flight_time_must_be_a_positive_duration(hover: str, codes: list[str]) -> None:
    assert [code for code, _ in found(VEHICLE.replace("18 min hover", hover))] == codes
