"""The clause that refuses a step if others depend on the state of the vehicle (E0702 to E0704, E0719)."""

from reference.sources import findings, mission, policy, program
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from virtual.rows import rows

#: conditions that hold in some states of the vehicle and fail in others
BY_STATE = ["", "forbid takeoff by any when wind.speed > 9 m/s", "forbid takeoff by any when position inside school"]


def only(*rules: str) -> Diagnostic:
    """Return the only finding about a flight that climbs to 20 m."""
    rest = ("permit return_home, emergency_land, hover by any", *rules, "contingency return_home, emergency_land")
    text = "policy rules version 1 {\n" + "".join(f"  {rule}\n" for rule in rest if rule) + "}\n"
    (found,) = findings(program(text, mission("takeoff(altitude = 20 m)", "return_home()")))
    return found


@rows("forbid", BY_STATE)
def test_message_names_the_nearest_permitted_value(forbid: str) -> None:
    found = only("permit takeoff by role operator through agent when altitude <= 15 m", forbid)
    assert found.code.id == "E0703"
    assert found.help == "nearest accepted: `altitude = 15 m`"


@rows("forbid", BY_STATE)
def test_missing_permit_for_the_role_is_reported(forbid: str) -> None:
    found = only("permit takeoff by role supervisor through agent", forbid)
    assert found.code.id == "E0702"
    assert found.help == "it is permitted to `supervisor` through `agent`"


@rows("forbid", BY_STATE)
def test_forbid_in_every_state_precedes_a_forbid_in_some(forbid: str) -> None:
    found = only("permit takeoff by role operator through agent", forbid, "forbid takeoff by any when altitude > 19 m")
    assert found.code.id == "E0704"
    assert [each.text for each in found.labels] == ["by this rule"]


@rows(
    ("when", "expected", "help"),
    [
        ("altitude > 19 m", "E0719", "nearest accepted: `altitude = 19 m`"),
        ("battery < 20 % or altitude in 15 m .. 30 m", "E0719", "nearest accepted: `altitude = 14.999 m`"),
        ("battery <= 100 %", "E0719", "narrow the condition of the rule, or remove the step"),
        ("battery < 30 % or battery > 20 %", "", None),  # atoms of one signal are considered one by one
        ("battery < 30 %", "", None),
        ("altitude > 20 m", "", None),
        ("position inside school", "", None),
    ],
)
def test_step_that_a_degrade_always_replaces_is_reported(when: str, expected: str, help: str | None) -> None:
    permit = "permit takeoff by role operator through agent"
    rules = ["permit return_home, emergency_land by any", permit, f"degrade takeoff when {when} to return_home"]
    text = "policy rules version 1 {\n" + "\n".join((*rules, "contingency return_home, emergency_land")) + "\n}\n"
    found = [
        (each.code.id, each.help, [label.text for label in each.labels])
        for each in findings(program(text, mission("takeoff(altitude = 20 m)", "return_home()")))
        if each.code.severity is Severity.ERROR
    ]
    assert found == ([(expected, help, ["by this rule"])] if expected else [])


@rows(
    ("when", "expected"),
    [
        ("battery < 20 %", []),
        ("altitude > 30 m", []),
        ("altitude in 18 m .. 22 m", ["E0719"]),  # not at the ends of the parameter's range
        ("local time in 08:00 .. 09:00", []),
        ("local time in 09:00 .. 08:59", ["E0718"]),  # the window is too short for any time of issue
    ],
)
def test_degrade_counts_between_instances_and_at_every_time(when: str, expected: list[str]) -> None:
    flight = mission("takeoff(altitude = high)", "return_home()").replace(
        "flight under", "flight(high: altitude in 10 m .. 30 m = 10 m) under"
    )
    rules = policy(f"degrade takeoff when {when} to return_home")
    found = [each.code for each in findings(program(rules, flight)) if each.code.severity is Severity.ERROR]
    assert [each.id for each in found] == expected


@rows(
    ("rule", "window", "expected"),
    [
        ("forbid takeoff by any when wind.speed > 9 m/s within the last", 30, ["E0717"]),
        ("forbid takeoff by any when wind.speed > 9 m/s within the last", 8, []),
        ("forbid return_home by any when wind.speed > 9 m/s within the last", 30, []),  # observed long enough by then
        ("forbid takeoff by any when wind.speed > 9 m/s for the last", 30, []),  # false at a calm moment
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
