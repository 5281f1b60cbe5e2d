"""Scenarios are checked and lowered with their mission and policy."""

from collections.abc import Sequence
from pathlib import Path

from reference.deciding import program
from rtshcua.ground.checker.faults import NAMED, example
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.ground.pipeline.suite import scenarios
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight, ScenarioSuite
from rtshcua.mavlink import dialect
from rtshcua.model.faults import KINDS, Direction, FlightMode, GpsJump, LinkSilence, PilotMode, WindStep, parameters
from rtshcua.model.flat.code import Op
from rtshcua.model.scenario import (
    ENDINGS,
    AfterStep,
    AtTime,
    Decides,
    EndsInside,
    EndsWith,
    Flies,
    KeepsAway,
    OnCondition,
    ReactsWithin,
    Start,
    When,
)
from rtshcua.onboard.ports import Ending
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
IMPORT = 'import "lib:missions/standard.rts"\n'
S = 1_000_000


def made(text: str, before: str = IMPORT) -> ScenarioSuite:
    return scenarios(program(before + text), dialect.load(), 5)


def found(body: str, before: str = IMPORT) -> list[tuple[str, str, str | None]]:
    """The codes, messages and helps of the findings on a scenario of the standard mission."""
    diagnostics = made(f'scenario "it" {{ flies standard {body} }}', before).diagnostics
    return [(each.code.id, each.message, each.help) for each in diagnostics]


def flown(body: str, before: str = IMPORT) -> ScenarioFlight:
    """A lowered scenario of the standard mission, without findings."""
    made_of = made(f'scenario "it" {{ flies standard {body} }}', before)
    assert made_of.diagnostics == ()
    (one,) = made_of.found
    return one


def test_endings_are_those_of_a_run() -> None:
    assert list(ENDINGS) == [str(ending) for ending in Ending]


def test_empty_scenario_has_the_defaults_of_the_simulated_vehicle() -> None:
    scenario = flown("").scenario
    assert (scenario.name, scenario.flavours) == ("it", ("px4", "ardupilot"))
    assert (scenario.first_seed, scenario.last_seed, scenario.start) == (1, 1, Start())
    assert (scenario.incidents, scenario.expectations) == ((), ())


def test_start_is_lowered() -> None:
    scenario = flown("aboard px4 seeds 3 .. 9 start wind(speed = 3 m/s, from = 270 deg, gust = 1 m/s), battery = 80 %")
    assert scenario.scenario.flavours == ("px4",)
    assert (scenario.scenario.first_seed, scenario.scenario.last_seed) == (3, 9)
    assert scenario.scenario.start == Start(battery=8000, wind_mm_s=3000, wind_from_deg=270, gust_mm_s=1000)


def test_start_or_a_fault_fits_a_camera_and_a_gimbal() -> None:
    for body, fitted in (
        ("", (None, None)),
        ("start camera()", (True, None)),
        ("start camera(fitted = yes), gimbal(fitted = no)", (True, False)),
        ("start gimbal(), camera(), battery = 80 %", (True, True)),
        ("at 3 s camera_loss(part = 10 %)", (True, None)),
        ("at 3 s camera_reboot(counter = continues)", (True, None)),
        ("start camera(fitted = no) at 3 s gimbal_stuck(for = 5 s)", (False, True)),
        ("at 3 s gimbal_stuck(for = 5 s)", (True, True)),
    ):
        scenario = flown(body).scenario
        assert (scenario.has_camera, scenario.has_gimbal) == fitted, body


MOMENTS: list[tuple[str, When]] = [
    ("at 20 s", AtTime(20 * S, 20 * S)),
    ("at 0 s .. 1 min", AtTime(0, 60 * S)),
    ("after takeoff", AfterStep(0, 0, 0)),
    ("after inspect_area", AfterStep(2, 0, 0)),
    ("after inspect_area 2", AfterStep(3, 0, 0)),
    ("2 s .. 4 s after return_home 1", AfterStep(5, 2 * S, 4 * S)),
]


@rows(("text", "when"), MOMENTS)
def test_moment_is_lowered(text: str, when: When) -> None:
    (incident,) = flown(f"{text} kill()").scenario.incidents
    assert incident.when == when
    assert incident.text == f"{text} kill()"


def test_condition_has_the_slots_of_the_policy() -> None:
    one = flown("3 s after when height > 10 m and battery < 50 % kill()")
    (incident,) = one.scenario.incidents
    assert isinstance(incident.when, OnCondition)
    assert (incident.when.from_us, incident.when.to_us) == (3 * S, 3 * S)
    assert incident.when.condition.text == "height > 10 m and battery < 50 %"
    code = incident.when.condition.code
    read = {code[at + 1] for at in range(0, len(code), 3) if code[at] == Op.SIGNAL}
    assert read == {one.policy.lowered.policy.vehicle.height, one.policy.lowered.policy.vehicle.battery}


def test_grown_zone_of_the_policy_is_found_on_either_safe_side() -> None:
    zones = [zone.name for zone in flown("").policy.lowered.policy.zones]
    assert "grow(school, 20 m)" in zones
    flown("when not position outside grow(school, 20 m) kill()")
    flown("when position outside grow(school, 20 m) kill()")


FAULTS = [
    ("link_silence(for = 5 s, way = up, held = yes)", LinkSilence(0, 5 * S, Direction.UP, held=True)),
    ("link_silence()", LinkSilence(0, None, Direction.BOTH, held=False)),
    ("wind(speed = 2 * 6 m/s, from = 270 deg)", WindStep(0, 12_000, 270, 0)),
    ("gps_jump(east = -3 m, north = 20 cm)", GpsJump(0, 200, -3000)),
    ("pilot_mode(mode = manual)", PilotMode(0, FlightMode.MANUAL)),
    ("pilot()", PilotMode(0, FlightMode.POSITION)),
]


@rows(("text", "fault"), FAULTS)
def test_fault_is_lowered(text: str, fault: object) -> None:
    (incident,) = flown(f"at 2 s {text}").scenario.incidents
    assert incident.fault == fault


def test_every_kind_of_fault_can_be_written() -> None:
    names = {"message": "HEARTBEAT", "role": "supervisor"}
    body = ""
    for name, kind in NAMED.items():
        said = [f"{each.name} = {names.get(each.name, example(each))}" for each in parameters(kind)]
        body += f"\n  at 2 s {name}({', '.join(said)})"
    incidents = flown(body).scenario.incidents
    assert [type(each.fault) for each in incidents] == list(KINDS.values())
    assert {each.fault.at_us for each in incidents} == {0}


def test_reference_lists_every_kind_of_fault_with_its_parameters() -> None:
    page = (CHECKOUT / "docs" / "language.md").read_text(encoding="utf-8")
    for name, kind in NAMED.items():
        needed = [each.name for each in parameters(kind) if each.needed]
        optional = [each.name for each in parameters(kind) if not each.needed]
        said = ", ".join([*needed, *([f"[{', '.join(optional)}]"] if optional else [])])
        assert f"`{name}({said})`" in page


def test_expectation_is_lowered() -> None:
    one = flown("""
  expect ends completed, stood_down
  expect fallback return_home because state/violated at "wind.speed < 10 ..."
  expect deny
  expect flies hover
  expect never emergency_land
  expect reaction <= 200 ms
  expect distance to school >= 20 m
  expect distance to obstacle >= 3 m
  expect lands in city
""")
    names = [zone.name for zone in one.policy.lowered.policy.zones]
    assert [each.what for each in one.scenario.expectations] == [
        EndsWith(("completed", "stood-down")),
        Decides("fallback", "return_home", "state/violated", "wind.speed < 10 m/s"),
        Decides("deny"),
        Flies("hover"),
        Flies("emergency_land", never=True),
        ReactsWithin(200_000),
        KeepsAway(names.index("school"), 20_000),
        KeepsAway(None, 3000),
        EndsInside(names.index("city")),
    ]
    first = one.scenario.expectations[0]
    assert (first.text, first.source) == ("expect ends completed, stood_down", "probe.rts")
    text = IMPORT + 'scenario "it" { flies standard '
    assert first.start == len(text) + 3
    assert first.end == first.start + len(first.text)


def test_mission_is_the_compiled_one() -> None:
    one = flown("")
    compiled = compile_program(program(IMPORT), dialect.load(), mission="standard", issued_at_us=5)
    assert (one.policy.lowered.policy, one.mission) == (compiled.policy, compiled.mission)


def test_mission_with_parameters_flies_with_their_defaults() -> None:
    mission = """import "lib:policies/bridge_inspection.rts"
mission lift(top: altitude in 10 m .. 30 m = 20 m) under bridge_inspection@7 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = top) }  phase recovery { return_home() }
}
scenario "it" { flies lift after takeoff kill() }
"""
    for default in ("20 m", "30 m"):  # `check` uses the end of the range in any case
        text = mission.replace("20 m", default)
        (one,) = made(text, "").found
        compiled = compile_program(program(text), dialect.load(), mission="lift", issued_at_us=5)
        assert one.mission == compiled.mission
    without = made(mission.replace(" = 20 m)", ")"), "")
    assert ("E0603", "`lift` has no value for `top`") in [(each.code.id, each.message) for each in without.diagnostics]
    assert without.found == ()


def test_mission_is_proved_for_the_begin_of_its_scenarios() -> None:
    """A mission that may only fly on Saturdays fails on another day; each scenario has its own time."""
    text = """import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
policy weekend version 1 {
  permit takeoff by role operator when local time on saturday
  permit return_home, emergency_land by any
  airspace inside city
  contingency return_home, emergency_land
}
mission lift under weekend@1 on quad {
  proposed by operator ada for role operator
  phase departure { takeoff(altitude = 20 m) }  phase recovery { return_home() }
}
mission other under weekend@1 on quad {
  proposed by operator ada for role operator
  phase departure { takeoff(altitude = 30 m) }  phase recovery { return_home() }
}
scenario "early" { flies lift start at "2026-11-21T09:00:00Z" }
scenario "late" { flies lift start at "2026-11-28T15:00:00Z" }
"""
    of_both = scenarios(program(text), dialect.load(), 5, 60 * S)
    assert of_both.diagnostics == ()
    assert [each.scenario.name for each in of_both.found] == ["early", "late"]
    starts = [(each.mission.issued_at_us + 60 * S, each.scenario.start.utc_us) for each in of_both.found]
    assert all(issued == begins for issued, begins in starts)
    on_monday = scenarios(program(text.replace("11-28", "11-30")), dialect.load(), 5, 60 * S)
    assert [each.code.id for each in on_monday.diagnostics] == ["E0718"]
    assert on_monday.found == ()


def test_scenarios_of_an_imported_file_are_ignored() -> None:
    files = {"other": IMPORT + 'scenario "theirs" { flies nothing }'}
    made_of = scenarios(
        program('import "other.rts"\n' + 'scenario "ours" { flies standard }', **files), dialect.load(), 0
    )
    assert [each.scenario.name for each in made_of.found] == ["ours"]
    assert made_of.diagnostics == ()


def test_error_elsewhere_is_found_and_no_scenario_flies() -> None:
    made_of = made('zone z = circle(47 N, 8 E, 3 s)\nscenario "it" { flies standard }')
    assert made_of.found == ()
    assert [each.code.id for each in made_of.diagnostics] == ["E0310"]


OTHERS = """import "lib:missions/standard.rts"
signal satellites : count = GPS_RAW_INT.satellites_visible stale after 2 s
zone elsewhere = circle(47.3970 N, 8.5446 E, 15 m)
skill dance() {
  motion land  class tactical  deadline 5 s  valid for 40 min  lasts at most 1 min
  fallback emergency_land  energy at most 5 %
}
"""

WRONG: Sequence[tuple[str, str, str, str | None]] = [
    ("aboard px5", "E1603", "unknown kind of autopilot `px5`", "did you mean `px4`?"),
    ("aboard px4, px4", "E0202", "`px4` is named twice", None),
    ("seeds 9 .. 1", "E0316", "the range `9 .. 1` is empty: its lower end is above its upper end", "write `1 .. 9`"),
    ("seeds 0 .. 100_000", "E1001", "the scenario has 100001 seeds; the limit is 100000", None),
    ("start batery = 8 %", "E1608", "`batery = 8 %` is not allowed in `start`", "did you mean `battery`?"),
    ("start battery = 101 %", "E1003", "`101 %` is too large", "the maximum is 100 %"),
    ("start battery = 8 m", "E0310", "expected a ratio; `8 m` is a length", None),
    ("start kill()", "E1608", "`kill` is not allowed in `start`", "write `at 0 s kill()`, outside of `start`"),
    ("start camra()", "E1608", "`camra()` is not allowed in `start`", "did you mean `camera`?"),
    (
        "start gimbal(for = 3 s)",
        "E0601",
        "`gimbal` has no argument `for`",
        "its arguments are `fitted`",
    ),
    (
        "start camera(fitted = maybe)",
        "E0313",
        "`maybe` is not a value of `fitted` of `camera`",
        "its values are `yes`, `no`",
    ),
    (
        "start camera(fitted = no) at 3 s camera_full()",
        "E1608",
        "the vehicle starts without the camera that fails later",
        "write `camera()`, or leave the fault out",
    ),
    (
        "start gimbal(fitted = no) at 3 s gimbal_stuck()",
        "E1608",
        "the vehicle starts without the gimbal that fails later",
        None,
    ),
    ("start camera(), camera()", "E1406", "`camera` is given twice", "keep one of them"),
    ("start battery = 8 %, battery = 9 %", "E1406", "`battery` is given twice", "keep one of them"),
    ("at -1 s kill()", "E0319", "`-1 s` must not be negative", None),
    ("at 3 m kill()", "E0310", "expected a duration; `3 m` is a length", None),
    ("at 3 s .. 2 s kill()", "E0316", "the range `3 s .. 2 s` is empty: its lower end is above its upper end", None),
    ("after gotto kill()", "E0201", "`gotto` is not declared; expected a skill", "did you mean `goto`?"),
    ("after city kill()", "E0204", "`city` is a zone; expected a skill", None),
    ("after emergency_land kill()", "E1605", "`standard` has no step `emergency_land`", None),
    ("after hover 2 kill()", "E1605", "`standard` has no step `hover` number 2", "the last `hover` is number 1"),
    ("after hover 0 kill()", "E1605", "`standard` has no step `hover` number 0", None),
    ("when heigt > 3 m kill()", "E0201", "`heigt` is not declared", "did you mean `height`?"),
    ("when height > 3 s kill()", "E0310", "", None),
    ("when rising height > 3 m kill()", "E1606", "a fault cannot wait for a temporal condition", None),
    ("when not height > 3 m for the last 2 s kill()", "E1606", "a fault cannot wait for a temporal condition", None),
    ("when phase == inspection kill()", "E1606", "a fault cannot wait for a phase", None),
    (
        "when satellites > 3 kill()",
        "E1607",
        "the condition reads the signal `satellites`, which the policy does not read",
        None,
    ),
    (
        "when position inside grow(city, 3 m) kill()",
        "E1607",
        "the condition needs a grown zone that the policy does not have",
        None,
    ),
    (
        "when position inside elsewhere kill()",
        "E0207",
        "the policy `bridge_inspection` does not import the zone `elsewhere`",
        None,
    ),
    ("at 2 s kil()", "E1601", "unknown fault `kil`", "did you mean `kill`?"),
    ("at 2 s kill(for = 3 s)", "E0601", "`kill` has no argument `for`", "it takes no arguments"),
    ("at 2 s wind(spead = 3 m/s)", "E0601", "`wind` has no argument `spead`", "did you mean `speed`?"),
    ("at 2 s wind(from = 3 deg)", "E0603", "`wind` lacks `speed`", "add `speed = 5 m/s`"),
    ("at 2 s gps_loss(4 s)", "E0604", "an argument of `gps_loss` lacks its name", "write `for = 4 s`"),
    ("at 2 s gps_loss(for = 4 s, for = 4 s)", "E0602", "`for` is given twice", None),
    ("at 2 s gps_loss(for = 4 m)", "E0310", "expected a duration; `4 m` is a length", None),
    ("at 2 s gps_loss(for = -4 s)", "E0319", "`-4 s` must not be negative", None),
    ("at 2 s link_loss(loss = link.quality)", "E0318", "`link.quality` is not known before the flight", None),
    ("at 2 s link_loss(loss = 101 %)", "E1003", "`101 %` exceeds the maximum of `loss`", "the maximum is 100 %"),
    (
        "at 2 s wind(speed = 3 m/s, from = 361 deg)",
        "E1003",
        "`361 deg` exceeds the maximum of `from`",
        "the maximum is 360 deg",
    ),
    (
        "at 2 s wind(speed = 3 m/s, from = 1.5 deg)",
        "E0302",
        "`1.5 deg` is finer than the resolution of `from`",
        "the nearest lower value is `1 deg`",
    ),
    ("at 2 s babble(copies = 1001)", "E1003", "`1001` exceeds the maximum of `copies`", "the maximum is 1000"),
    (
        "at 2 s link_silence(way = upp)",
        "E0313",
        "`upp` is not a value of `way` of `link_silence`",
        "did you mean `up`?",
    ),
    ("at 2 s link_silence(way = 3 s)", "E0312", "`3 s` is not a value of `way` of `link_silence`", None),
    ("at 2 s mute(message = HEARTBEET)", "E0401", "the dialect has no message `HEARTBEET`", None),
    ("at 2 s mute(message = 3)", "E0312", "`3` is not a name, as `message` needs", None),
    (
        "at 2 s approve(role = supervisr)",
        "E1609",
        "no rule of `bridge_inspection` is about the role `supervisr`",
        "did you mean `supervisor`?",
    ),
    ("expect ends complete", "E1602", "unknown ending `complete`", "did you mean `completed`?"),
    ("expect fallback hoover", "E0201", "`hoover` is not declared; expected a skill", "did you mean `hover`?"),
    (
        "expect deny because state/violated",
        "E1404",
        "`state/violated` is a reason for `fallback`, not for `deny`",
        "write `expect fallback`, or another reason",
    ),
    ("expect deny because nothing", "E1403", "unknown reason `nothing`", None),
    (
        'expect deny at "permit ..."',
        "E1410",
        "`permit ...` quotes the beginning of several clauses",
        None,
    ),
    (
        'expect fallback at "wind.sped < 10 m/s"',
        "E1410",
        "no clause `wind.sped < 10 m/s` can decide on this mission",
        "did you mean `wind.speed < 10 m/s`?",
    ),
    (
        "expect flies dance",
        "E1404",
        "`dance` never flies: no rule and no chain of `bridge_inspection` names it",
        None,
    ),
    (
        "expect fallback dance",
        "E1404",
        "`dance` never flies: no rule and no chain of `bridge_inspection` names it",
        None,
    ),
    ("expect never dence", "E0201", "`dence` is not declared; expected a skill", "did you mean `dance`?"),
    ("expect reaction <= 0 s", "E0319", "`0 s` must be above zero", None),
    ("expect distance to schol >= 3 m", "E0201", "`schol` is not declared; expected a zone", "did you mean `school`?"),
    ("expect distance to school >= 3 s", "E0310", "expected a length; `3 s` is a duration", None),
    ("expect lands in hover", "E0204", "`hover` is a skill; expected a zone", None),
    (
        "expect lands in elsewhere",
        "E0207",
        "the policy `bridge_inspection` does not import the zone `elsewhere`",
        None,
    ),
]


@rows(("body", "code", "message", "help"), WRONG)
def test_wrong_scenario_is_found(body: str, code: str, message: str, help: str | None) -> None:
    ((has, said, more),) = found(body, OTHERS)
    assert has == code
    assert message in ("", said)
    assert help in (None, more)


def test_expectation_that_nothing_else_flies_has_no_finding() -> None:
    assert found("expect never dance", OTHERS) == []


def test_unknown_mission_is_found() -> None:
    diagnostics = made('scenario "it" { flies standrd after takeoff 9 kill() }').diagnostics
    assert [(each.code.id, each.message) for each in diagnostics] == [
        ("E0201", "`standrd` is not declared; expected a mission")
    ]


def test_two_scenarios_of_one_name_are_found() -> None:
    diagnostics = made('scenario "it" { flies standard }\nscenario "it" { flies standard }').diagnostics
    assert [(each.code.id, each.message) for each in diagnostics] == [("E1604", "two scenarios have the name `it`")]


def test_check_reports_findings_of_lowering() -> None:
    body = 'scenario "it" { flies standard when satellites > 3 kill() expect lands in elsewhere }'
    diagnostics = check_program(program(OTHERS + body), dialect.load())
    assert [each.code.id for each in diagnostics] == ["E1607", "E0207"]


def test_fix_is_the_nearest_name() -> None:
    for body in ("at 2 s gps_loss(4 s)", "at 2 s kil()", "seeds 9 .. 1", "at 2 s link_silence(way = upp)"):
        text = IMPORT + f'scenario "it" {{ flies standard {body} }}'
        (diagnostic,) = made(text, "").diagnostics
        (fix,) = diagnostic.fixes
        changed = text[: fix.span.start] + fix.replacement + text[fix.span.end :]
        assert made(changed, "").diagnostics == (), changed
