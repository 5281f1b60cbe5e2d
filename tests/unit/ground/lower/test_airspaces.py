"""Empty airspaces, vehicles without an identity, and the sources of missions."""

from reference.sources import findings, mission, policy, program
from virtual.rows import rows

ZONES = """
zone a = circle(47.39774 N, 8.54559 E, 200 m)
zone far = circle(47.40774 N, 8.54559 E, 200 m)
zone all = circle(47.39774 N, 8.54559 E, 300 m)
zone low = circle(47.39774 N, 8.54559 E, 200 m) ceiling 20 m above home
zone high = circle(47.39774 N, 8.54559 E, 200 m) floor 30 m above home
zone day = circle(47.39774 N, 8.54559 E, 400 m) active 08:00 .. 18:00
zone once = circle(47.39774 N, 8.54559 E, 400 m) active "2026-01-01T00:00Z" .. "2027-01-01T00:00Z"
"""


@rows(
    ("airspace", "conflict"),
    [
        ("inside a outside a", ["a", "a"]),
        ("inside a, far", ["a", "far"]),
        ("inside all, a, far", ["a", "far"]),
        ("inside a outside far, all", ["a", "all"]),
        ("inside low, high", ["low", "high"]),
        ("inside a outside low", []),
        ("inside all outside a", []),
        ("inside a outside day", []),  # at night
        ("inside a outside once", []),
        ("inside a outside once, day", []),
        ("outside a", []),  # no bound but this one
        ("outside a, all, far", []),
    ],
)
def test_empty_airspace_is_reported(airspace: str, conflict: list[str]) -> None:
    text = program(ZONES, policy(f"airspace {airspace}"))
    found = [each for each in findings(text) if each.code.id == "E1101"]
    assert [text[each.span.start : each.span.end] for each in found if each.span] == [f"airspace {airspace}"] * bool(
        conflict
    )
    assert [text[label.span.start : label.span.end] for each in found for label in each.labels] == conflict


@rows(("name", "expected"), [("", ["E0107"]), (" ", ["E0107"]), ("quad-1", [])])
def test_vehicle_needs_an_identity(name: str, expected: list[str]) -> None:
    vehicle = (
        f'vehicle v {{ identity "{name}"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s\n'
        "climb at most 3 m/s  position error 3 m  energy 100 % = 18 min hover  reserve 15 %  clock utc +02:00 }\n"
    )
    flight = mission("takeoff(altitude = 20 m)", "return_home()").replace("on quad", "on v")
    text = program(vehicle, policy(), flight)
    found = [(each.code.id, text[each.span.start : each.span.end]) for each in findings(text) if each.span]
    assert found == [(code, f'identity "{name}"') for code in expected]


@rows(("source", "expected"), [("agent", []), ("operator", []), ("onboard", ["E0709"]), ("reflex", ["E0709"])])
def test_mission_must_be_proposed_by_an_agent_or_operator(source: str, expected: list[str]) -> None:
    flight = mission("takeoff(altitude = 20 m)", "return_home()").replace("by agent", f"by {source}")
    assert [each.code.id for each in findings(program(policy(), flight))] == expected
