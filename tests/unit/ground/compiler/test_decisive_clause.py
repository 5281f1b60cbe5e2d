"""E0702 to E0704: which clause refuses a step, where the state of the vehicle decides on others."""

from reference.sources import findings, mission, program
from rtshcua.diagnostics.diagnostic import Diagnostic
from virtual.rows import rows

#: for every state of the vehicle that makes these forbid there is one that does not
BY_STATE = ["", "forbid takeoff by any when wind.speed > 9 m/s", "forbid takeoff by any when position inside school"]


def only(*rules: str) -> Diagnostic:
    """The only finding on a flight that climbs to 20 m."""
    rest = ("permit return_home, emergency_land, hover by any", *rules, "contingency return_home, emergency_land")
    text = "policy rules version 1 {\n" + "".join(f"  {rule}\n" for rule in rest if rule) + "}\n"
    (found,) = findings(program(text, mission("takeoff(altitude = 20 m)", "return_home()")))
    return found


@rows("forbid", BY_STATE)
def test_what_is_out_of_scope_is_told_with_the_nearest_value(forbid: str) -> None:
    found = only("permit takeoff by role operator through agent when altitude <= 15 m", forbid)
    assert found.code.id == "E0703"
    assert found.help == "nearest accepted: `altitude = 15 m`"


@rows("forbid", BY_STATE)
def test_that_no_rule_permits_the_role_is_told(forbid: str) -> None:
    found = only("permit takeoff by role supervisor through agent", forbid)
    assert found.code.id == "E0702"
    assert found.help == "it is permitted to `supervisor` through `agent`"


@rows("forbid", BY_STATE)
def test_what_forbids_in_every_state_is_told_before_what_does_in_some(forbid: str) -> None:
    found = only("permit takeoff by role operator through agent", forbid, "forbid takeoff by any when altitude > 19 m")
    assert found.code.id == "E0704"
    assert [each.text for each in found.labels] == ["by this rule"]


@rows(
    ("rule", "window", "expected"),
    [
        ("forbid takeoff by any when wind.speed > 9 m/s within the last", 30, ["E0717"]),
        ("forbid takeoff by any when wind.speed > 9 m/s within the last", 8, []),
        ("forbid return_home by any when wind.speed > 9 m/s within the last", 30, []),  # by then it was observed
        ("forbid takeoff by any when wind.speed > 9 m/s for the last", 30, []),  # a calm moment makes it false
        ("degrade takeoff when wind.speed > 9 m/s within the last", 30, ["E0717"]),
    ],
)
def test_observation_begins_with_the_run(rule: str, window: int, expected: list[str]) -> None:
    permit = "permit takeoff by role operator through agent"
    rules = [permit, "permit return_home, emergency_land, hover by any", f"{rule} {window} s"]
    if rule.startswith("degrade"):
        rules[-1] += " to return_home"
    text = "policy rules version 1 {\n" + "\n".join((*rules, "contingency return_home, emergency_land")) + "\n}\n"
    found = findings(program(text, mission("takeoff(altitude = 20 m)", "return_home()")))
    assert [each.code.id for each in found if each.code.id == "E0717"] == expected
