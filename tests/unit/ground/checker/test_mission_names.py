"""Names in a mission and in an airspace must be declared."""

import pytest

from reference.sources import found, mission, policy, program
from virtual.rows import rows

FLIGHT = mission("takeoff(altitude = 10 m)", "hover(10 s)", "return_home()")


@rows(
    ("old", "new", "code", "word"),
    [
        ("on quad", "on quod", "E0201", "`quod`"),
        ("under rules@1", "under ruler@1", "E0201", "`ruler`"),
        ("under rules@1", "under rules@2", "E0701", "version 2"),
        ("hover(10 s)", "hoover(10 s)", "E0201", "`hoover`"),
        ("by agent", "by angel", "E0709", "`angel`"),
        ("on quad", "on rules", "E0204", "`rules`"),
    ],
)
def test_unknown_name_in_a_mission_is_reported(old: str, new: str, code: str, word: str) -> None:
    assert not found(program(policy(), FLIGHT))
    (only,) = found(program(policy(), FLIGHT.replace(old, new)))
    assert only[0] == code
    assert word in only[1]


@pytest.mark.parametrize("airspace", ["airspace inside nowhere", "airspace inside city outside nowhere"])
def test_unknown_zone_in_an_airspace_is_reported(airspace: str) -> None:
    assert [code for code, _ in found(program(policy(airspace)))] == ["E0201"]
