"""Suggestions for unknown words."""

from rtshcua.diagnostics.suggest import LISTED, listed, nearest
from virtual.rows import rows

CASES = [
    ("baterry", ["battery", "height"], "", "battery"),
    ("remaining", ["time_remaining", "battery_remaining", "id"], "BATTERY_STATUS", "battery_remaining"),
    ("remaining", ["battery_function", "time_remaining"], "BATTERY_STATUS", "time_remaining"),
    ("bridge", ["bridge_a", "school"], "", "bridge_a"),
    ("home", ["return_home", "hover"], "", "return_home"),
    ("battery.level", ["battery", "height"], "", "battery"),
    ("time_remainign", ["time_remaining", "battery_remaining"], "BATTERY_STATUS", "time_remaining"),
    ("a", ["bridge_a", "bridge_b"], "", None),
    ("fix_4d", ["fix_2d", "fix_3d", "no_fix"], "", "fix_3d"),
    ("MAV_LANDING_STATE", ["MAV_STATE", "MAV_LANDED_STATE"], "", "MAV_LANDED_STATE"),
    ("battery.of.the.vehicle", ["battery", "the"], "", "battery"),
    ("zzz", ["battery"], "", None),
    ("", ["battery"], "", None),
    ("x", [], "", None),
]


@rows(("word", "known", "about", "meant"), CASES)
def test_nearest_name_is_suggested(word: str, known: list[str], about: str, meant: str | None) -> None:
    assert nearest(word, known, about) == meant
    assert nearest(word, reversed(known), about) == meant


def test_list_of_names_is_bounded() -> None:
    assert listed(["a", "b"]) == "`a`, `b`"
    many = [f"n{number}" for number in range(LISTED + 3)]
    assert listed(many).endswith(f"`n{LISTED - 1}` and 3 more")
    assert listed([]) == ""
